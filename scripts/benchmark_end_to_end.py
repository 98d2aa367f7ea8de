"""What people wait for: processor time and megabytes of a whole run, beside an earlier version and beside work by hand.

    python scripts/benchmark_end_to_end.py [--against CHECKOUT] [--runs 3] [--cases one,by-hand,demo,many]

Every run is a process of its own, and the versions take turns. Times are of the processor, user and system, of the
process and its workers: on a busy machine they mean more than the clock. `by-hand` is what somebody would write
instead, for the same outputs of one file: lmfit, emcee, arviz, corner and matplotlib.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent.parent
MANY = 100
"""Records of the case without figures; each is a branch of 100 samples."""


def rig(path: Path, seed: int, n: int = 200) -> None:
    """Write a file with one heating and one cooling of a spring: force and displacement, not on a straight line."""
    rng = np.random.default_rng(seed)
    t = np.concatenate([np.linspace(25.0, 95.0, n), np.linspace(95.0, 25.0, n)])
    middle = np.where(np.arange(2 * n) < n, 66.0, 52.0)
    force = 1.0 + 2.2 / (1.0 + np.exp(-(t - middle) / 4.0)) + rng.normal(0.0, 0.02, t.size)
    displacement = 14.0 + 26.0 / (1.0 + np.exp((t - middle + 1.5) / 3.6)) + rng.normal(0.0, 0.2, t.size)
    rows = zip(np.arange(t.size) * 0.5, t, force, displacement, strict=True)
    lines = [
        "time_s,temperature_C,force_N,displacement_mm",
        *(",".join(f"{v:.6g}" for v in row) for row in rows),
    ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def house(folder: Path) -> None:
    """Write a campaign of `MANY` records."""
    lines = ['[campaign]\nname = "house"\n\n[columns]']
    for quantity, unit in (("time", "s"), ("temperature", "degC"), ("force", "N"), ("displacement", "mm")):
        suffix = {"degC": "C"}.get(unit, unit)
        lines.append(f'{quantity} = {{ name = "{quantity}_{suffix}", unit = "{unit}" }}')
    for number in range(MANY // 2):
        rig(folder / f"c{number}.csv", number, 100)
        lines.append(f'\n[[condition]]\nid = "c{number}"\nfile = "c{number}.csv"')
    (folder / "campaign.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")


def measured(command: list[str], checkout: Path, out: Path) -> tuple[float, float]:
    """Processor time [s] of a command and its children, and what it has written [MB]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    environment = {
        **os.environ,
        "PYTHONPATH": str(checkout),
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
    subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL, cwd=out.parent)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    written = sum(p.stat().st_size for p in out.rglob("*") if p.is_file())
    if not written:
        raise SystemExit(f"{' '.join(command)} has written nothing")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, written / 1e6


def command_of(case: str, place: Path, out: Path) -> list[str]:
    """The command of a case."""
    program = [sys.executable, "-m", "sma_bayes"]
    if case == "one":
        return [*program, "fit", str(place / "one.csv"), "--out", str(out), "--quiet"]
    if case == "demo":
        return [*program, "demo", "--out", str(out), "--quiet"]
    if case == "many":
        return [*program, "fit", str(place / "house"), "--out", str(out), "--quiet", "--figures", "none"]
    return [sys.executable, str(Path(__file__).resolve()), "--by-hand", str(place / "one.csv"), str(out)]


def by_hand(path: Path, out: Path) -> None:
    """Least squares, posterior, summary, NetCDF, bands and figures of both branches, as users write it."""
    import arviz as az
    import corner
    import emcee
    import lmfit
    import matplotlib as mpl
    import pandas as pd

    mpl.use("agg")
    import matplotlib.pyplot as plt

    out.mkdir()
    frame = pd.read_csv(path)
    peak = int(frame["temperature_C"].argmax())
    names = ("A1", "A2", "A3", "A4", "B1", "B2", "B3", "B4")

    def curves(p, t):
        return p[4] / (1 + np.exp(-p[5] * (t - p[6]))) + p[7], p[0] / (1 + np.exp(-p[1] * (t - p[2]))) + p[3]

    summary, bands = {}, {}
    for branch, part in (("heating", frame[: peak + 1]), ("cooling", frame[peak + 1 :])):
        t, f, x = (part[c].to_numpy() for c in ("temperature_C", "force_N", "displacement_mm"))

        def residual(params, t=t, f=f, x=x):
            force, displacement = curves([params[n].value for n in names], t)
            return np.concatenate([(force - f) / 0.02, (displacement - x) / 0.2])

        start = (x.max() - x.min(), -0.25, t.mean(), x.min(), f.max() - f.min(), 0.25, t.mean(), f.min())
        params = lmfit.create_params(**dict(zip(names, start, strict=True)))
        best = lmfit.minimize(residual, params)
        centre = np.array([*(best.params[n].value for n in names), np.log(0.02), np.log(0.2)])

        def log_prob(theta, t=t, f=f, x=x):
            if abs(theta[1]) > 5 or abs(theta[5]) > 5 or not np.all(np.abs(theta[8:]) < 10):
                return -np.inf
            force, displacement = curves(theta, t)
            a, b = np.exp(theta[8]), np.exp(theta[9])
            z = np.sum(((force - f) / a) ** 2) + np.sum(((displacement - x) / b) ** 2)
            return -0.5 * z - t.size * (theta[8] + theta[9])

        rng = np.random.default_rng(0)
        walkers = centre * (1 + 1e-3 * rng.standard_normal((32, centre.size)))
        sampler = emcee.EnsembleSampler(32, centre.size, log_prob)
        sampler.run_mcmc(walkers, 5000)  # some 50 autocorrelation times
        data = az.from_emcee(sampler, var_names=[*names, "ln_force_sd", "ln_displacement_sd"])
        data = data.sel(draw=slice(1000, None, 20))
        data.to_netcdf(out / f"{branch}.nc")
        summary[branch] = az.summary(data, hdi_prob=0.9).to_dict()
        draws = sampler.get_chain(discard=1000, thin=20, flat=True)
        grid = np.linspace(t.min(), t.max(), 161)
        force, displacement = curves(draws.T[:, :, None], grid)
        stiffness = np.gradient(force, grid, axis=1) / np.gradient(displacement, grid, axis=1)
        shown = {"force": force, "displacement": displacement, "stiffness": stiffness}
        bands[branch] = {c: np.quantile(v, (0.05, 0.5, 0.95), axis=0) for c, v in shown.items()}
        for channel, q in bands[branch].items():
            pd.DataFrame(q.T, index=grid).to_csv(out / f"{branch}-{channel}.csv")
        corner.corner(draws[:, :8], labels=list(names))
        plt.savefig(out / f"corner-{branch}.png")
        plt.close()
    figure, axes = plt.subplots(1, 3, figsize=(10, 4))
    for branch, channels in bands.items():
        for ax, (channel, q) in zip(axes, channels.items(), strict=True):
            ax.fill_between(range(161), q[0], q[2], alpha=0.3, label=branch)
            ax.plot(q[1])
            ax.set_title(channel)
    for ending in ("png", "pdf"):
        figure.savefig(out / f"loop.{ending}")
    (out / "summary.json").write_text(json.dumps(summary))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", type=Path, help="checkout of another version, to take turns with")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--cases", default="one,by-hand,demo,many")
    parser.add_argument("--by-hand", nargs=2, type=Path, metavar=("FILE", "DIR"), help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.by_hand:
        by_hand(*given.by_hand)
        return
    versions = {"this": HERE, **({"against": given.against.resolve()} if given.against else {})}
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        rig(place / "one.csv", 1)
        (place / "house").mkdir()
        house(place / "house")
        print("case,version,cpu_s,cpu_s_least,cpu_s_greatest,written_MB")
        for case in given.cases.split(","):
            found: dict[str, list[tuple[float, float]]] = {}
            for run in range(given.runs):
                for version, checkout in (
                    versions.items() if case != "by-hand" else [("lmfit, emcee, arviz", HERE)]
                ):
                    out = place / f"{case}-{version}-{run}"
                    found.setdefault(version, []).append(
                        measured(command_of(case, place, out), checkout, out)
                    )
            for version, runs in found.items():
                times = [t for t, _ in runs]
                middle = statistics.median(times)
                print(
                    f"{case},{version!r},{middle:.2f},{min(times):.2f},{max(times):.2f},{runs[0][1]:.1f}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
