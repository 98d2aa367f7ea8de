"""Measure whether `converged` holds for the tails: draws as shipped against long independent runs.

Records are drawn from every noise model of the catalogue that is a density, with curves of every kind below; each is
fitted with every noise of the catalogue in turn, and with `auto`, and in ten numbers of each twenty with the published
model, in the other ten with the richer ones of the ladder in turn. A long run of another algorithm, differential
evolution of emcee from dispersed starts, four ensembles that stop when they agree, is the reference; where it does not
reach its own target, the record is counted as undecided.

    python scripts/measure_tails.py --records 300
    python scripts/measure_tails.py --records 40 --quick

Options:

--records N      how many records (default 60)
--seed S         of the records and of all runs (default 0)
--first K        number of the first record, to measure in parts (default 0)
--quick          short references: errors of 0.05 sd and 2.5 % are theirs, and the limits are widened by them
--numbers N ...  of the records, in place of --records and --first
--out DIR        where `tails.csv` goes (default docs/data)

What has not converged has no reference: nothing is claimed of it. It prints, as Markdown, how many converged records
have a 2.5 or 97.5 % quantile off by more than 0.2 sd, a standard deviation off by more than 7 %, or ln Z off by more
than three stated errors; each limit is widened by two standard errors of the reference. What is interrupted prints
the table of what was measured so far.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

import emcee
import numpy as np
from threadpoolctl import threadpool_limits

from sma_bayes.arrays import Floats
from sma_bayes.fitting.fit_records import AUTO, fit_records
from sma_bayes.fitting.posterior import Posterior
from sma_bayes.noise import NOISE_MODELS, NoiseModel, Steps
from sma_bayes.records.types import Branch, Condition, Record
from sma_bayes.response import ResponseModel, ladder
from sma_bayes.sampling.bridge import bridge_evidence
from sma_bayes.sampling.convergence import Target, assess
from sma_bayes.sampling.moves import differential_evolution

QUANTILES = (0.025, 0.975)
OFF, SD_OFF, LN_Z_OFF = 0.2, 0.07, 3.0
NEAR = 5.0
"""Of the log density, times the number of dimensions, by which starts may be lower than the best draw."""
UNITS = {"temperature": "degC", "time": "s", "force": "N", "displacement": "m", "stiffness": "N/m"}
CHANNELS = (("force", "displacement"), ("displacement",), ("stiffness",))


@dataclass(frozen=True, slots=True)
class Length:
    """How long a reference is: autocorrelation times of each walker, and its greatest number of steps."""

    walkers: int
    block: int
    most: int
    quantile_error: float


LONG = Length(walkers=128, block=1000, most=40_000, quantile_error=0.025)
QUICK = Length(walkers=96, block=600, most=4_800, quantile_error=0.05)


@dataclass(frozen=True, slots=True)
class Curve:
    """Kind of curve: shares of span against temperature, how many samples over which temperatures, noise per span."""

    name: str
    share: Callable[[Floats, np.random.Generator], Floats]
    n: tuple[int, int] = (40, 110)
    span: tuple[float, float] = (30.0, 70.0)
    noise: tuple[float, float] = (0.004, 0.02)


def _logistic(x: Floats) -> Floats:
    return np.asarray(1.0 / (1.0 + np.exp(-x)))


def _one(t: Floats, rng: np.random.Generator) -> Floats:
    return _logistic(rng.uniform(0.2, 0.6) * (t - rng.uniform(46.0, 54.0)))


def _two_steps(t: Floats, rng: np.random.Generator) -> Floats:
    second, rate, middle = rng.uniform(0.15, 0.3), rng.uniform(0.3, 0.6), rng.uniform(43.0, 48.0)
    first = (1.0 - second) * _logistic(rate * (t - middle))
    return first + second * _logistic(rate * (t - middle - rng.uniform(10.0, 16.0)))


CURVES = (
    Curve("published", _one),
    Curve("second step", _two_steps, n=(45, 55)),
    Curve("partial sweep", _one, span=(30.0, 50.0)),
    Curve("few samples", _one, n=(12, 20)),
    Curve("low signal", _one, noise=(0.1, 0.3)),
)


@dataclass(frozen=True, slots=True)
class Row:
    """One record: what it is, and how far its draws are from the reference.

    Attributes
    ----------
    quantile_off : float
        Greatest distance of a 2.5 or 97.5 % quantile [sd of the reference]; `at` says which.
    sd_off : float
        Greatest relative distance of a standard deviation.
    ln_z_off : float
        Of ln Z, in its stated errors joined with those of the reference.
    reference_error : float
        Greatest standard error of the outer quantiles of the reference [sd].
    """

    number: int
    curve: str
    channels: str
    drawn_with: str
    asked: str
    model: str
    noise: str
    n: int
    method: str
    converged: bool
    pareto_k: float
    outside: float
    quantile_off: float
    at: str
    beyond: float
    sd_off: float
    ln_z_off: float
    ln_z_sd: float
    reference_reached: bool
    reference_error: float
    sample_s: float
    reference_s: float

    def wrong(self, slack: float = 0.0) -> list[str]:
        """Which limits it breaks; `slack` is what the reference may be off by [standard errors of it]."""
        found = []
        if self.quantile_off > OFF + slack * self.reference_error:
            found.append("quantile")
        if self.sd_off > SD_OFF + slack * 0.5 * self.reference_error:
            found.append("sd")
        if self.ln_z_off > LN_Z_OFF:
            found.append("ln Z")
        return found


def record_of(number: int, seed: int) -> tuple[Record, Curve, str, str]:
    """A record, its curve, the noise it is drawn with and the noise it is fitted with, all by its number."""
    rng = np.random.default_rng([seed, number])
    drawn = [name for name, model in NOISE_MODELS.items() if model.is_density]
    asked = [AUTO, *NOISE_MODELS]
    curve = CURVES[number % len(CURVES)]
    channels = CHANNELS[number // len(CURVES) % len(CHANNELS)]
    noise = drawn[int(rng.integers(len(drawn)))]
    asked_for = asked[number % len(asked)] if number % 2 else AUTO
    return _drawn(curve, channels, NOISE_MODELS[noise], number, rng), curve, noise, asked_for


def model_of(number: int, channels: Sequence[str]) -> type[ResponseModel]:
    """Model that a record is fitted with, by its number: the published one, or a richer one that its channels tell."""
    published, *richer = ladder(channels)
    return richer[number % len(richer)] if richer and number // 10 % 2 else published


def _drawn(
    curve: Curve, channels: Sequence[str], noise: NoiseModel, number: int, rng: np.random.Generator
) -> Record:
    n = int(rng.integers(*curve.n, endpoint=True))
    t = np.linspace(*curve.span, n)
    inputs = {"temperature": t, "time": np.cumsum(rng.uniform(0.5, 1.5, n)), "segment": np.zeros(n)}
    grid = np.linspace(curve.span[0] - 1.0, curve.span[1] + 1.0, 800)
    state = rng.bit_generator.state
    share = curve.share(grid, rng)
    rng.bit_generator.state = state
    later = curve.share(grid - rng.uniform(0.0, 2.0), rng)
    full = {"force": 0.5 + 2.5 * later, "displacement": 0.001 + 0.02 * share}
    full["stiffness"] = np.gradient(full["force"]) / np.gradient(full["displacement"])
    level = rng.uniform(*curve.noise)
    units = {name: UNITS[name] for name in ("temperature", "time", *channels)}
    condition, rows = Condition(f"tail-{number}"), np.arange(n) + 2
    clean = {c: np.interp(t, grid, full[c]) for c in channels}
    bare = Record(condition, Branch.HEATING, inputs, clean, rows, units)
    steps = Steps.of(bare)
    observed = {}
    for channel, value in clean.items():
        series = rng.standard_normal(n)
        shape = np.atleast_2d(noise.estimate(_remembering(series), steps)[1:])
        observed[channel] = value + level * np.ptp(value) * noise.draw(rng, shape, steps)[0]
    return Record(condition, Branch.HEATING, inputs, observed, rows, units)


def _remembering(series: Floats) -> Floats:
    """A series from which a noise model takes the shape that it draws with: neighbours alike, a few far out."""
    out = series.copy()
    out[::9] *= 3.0
    for i in range(1, len(out)):
        out[i] = 0.7 * out[i - 1] + 0.7 * out[i]
    return out


def reference(
    posterior: Posterior, z: Floats, length: Length, seed: np.random.SeedSequence
) -> tuple[Floats, bool, float]:
    """Draws (G, S, W, D) of four ensembles that start at dispersed points, whether they agree, and their error.

    Starts have twice the covariance of the draws `z` (N, D) and heavy tails (Student t, 3 degrees of freedom); among
    them are the best of many draws of the prior, where these are not so bad that walkers would never come back
    (`NEAR`). Of each run the first third is dropped.
    """
    d = z.shape[1]
    mean, root = z.mean(axis=0), np.linalg.cholesky(np.cov(z.T).reshape(d, d))
    walkers = max(length.walkers, 4 * d)
    samplers, states = [], []
    for stream in seed.spawn(4):
        rng = np.random.default_rng(stream)
        near = mean + 1.4 * rng.standard_normal((20 * walkers, d)) @ root.T / np.sqrt(
            rng.chisquare(3.0, (20 * walkers, 1)) / 3.0
        )
        log_prob = posterior.log_prob(near)
        near = near[log_prob > posterior.log_prob(z[:500]).max() - NEAR * d]
        if len(near) < walkers:  # bent, or bounded: the draws themselves, as they come
            near = np.concatenate([near, rng.permutation(z)[: 2 * walkers]])
        prior = posterior.draw_prior(rng, 4000)
        prior = prior[posterior.log_prob(prior) > log_prob.max() - NEAR * d][: walkers // 4]
        near = near[: walkers - len(prior)]
        walkers = len(near) + len(prior)
        sampler = emcee.EnsembleSampler(
            walkers, d, posterior.log_prob, moves=differential_evolution(d), vectorize=True
        )
        state = np.random.RandomState(np.random.MT19937(stream)).get_state()
        samplers.append(sampler)
        states.append(emcee.State(np.concatenate([near, prior]), random_state=state))
    target = Target(1.01, 1000.0, length.quantile_error)
    while True:
        for g, sampler in enumerate(samplers):
            states[g] = sampler.run_mcmc(states[g], length.block, skip_initial_state_check=True)
        done = samplers[0].iteration
        chains = np.stack([s.get_chain(discard=done // 3, thin=5) for s in samplers])
        found = assess(chains, target)
        if found.converged or done >= length.most:
            return chains, found.converged, float(np.max(found.quantile_error))


def measured(number: int, seed: int, length: Length) -> Row:
    """Fit one record as shipped, and compare it with its reference; what has not converged is not compared."""
    record, curve, drawn_with, asked = record_of(number, seed)
    kind = model_of(number, record.channels)
    fit = fit_records([record], kind.default_priors(), model=kind(record.channels), noise=asked, seed=seed)
    sample_s = fit.account.cpu["sample"]
    draws, posterior = fit.draws, fit.posterior
    d = draws.z.shape[-1]
    z = draws.z.reshape(-1, d)
    audit, unknown = draws.audit, float("nan")
    row = Row(
        number=number,
        curve=curve.name,
        channels="+".join(record.channels),
        drawn_with=drawn_with,
        asked=asked,
        model=kind.name,
        noise=posterior.noise.name,
        n=record.n,
        method=draws.method,
        converged=draws.convergence.converged,
        pareto_k=unknown if audit is None else audit.pareto_k,
        outside=unknown if audit is None else audit.outside,
        quantile_off=unknown,
        at="",
        beyond=unknown,
        sd_off=unknown,
        ln_z_off=unknown,
        ln_z_sd=draws.ln_evidence_sd,
        reference_reached=False,
        reference_error=unknown,
        sample_s=sample_s,
        reference_s=0.0,
    )
    if not row.converged:
        return row
    start = time.process_time()
    chains, reached, error = reference(posterior, z, length, np.random.SeedSequence([seed, number, 1]))
    other = chains.reshape(-1, d)
    few = other[np.linspace(0, len(other) - 1, 8000).astype(int)]
    bridge = bridge_evidence(
        posterior, few, np.zeros(len(few)), np.random.default_rng(np.random.SeedSequence([seed, number, 2]))
    )
    sd = other.std(axis=0)
    off = (np.quantile(z, QUANTILES, axis=0) - np.quantile(other, QUANTILES, axis=0)) / sd
    side, parameter = np.unravel_index(np.abs(off).argmax(), off.shape)
    end = np.quantile(z[:, parameter], QUANTILES[side])
    below = float(np.mean(other[:, parameter] <= end))
    ln_z = abs(draws.ln_evidence - bridge.value) / np.hypot(draws.ln_evidence_sd, bridge.sd)
    return replace(
        row,
        quantile_off=float(np.abs(off).max()),
        at=f"{posterior.names[parameter]} {100 * QUANTILES[side]:g} %",
        beyond=below if side == 0 else 1.0 - below,
        sd_off=float(np.abs(z.std(axis=0) / sd - 1.0).max()),
        ln_z_off=float(ln_z),
        reference_reached=reached,
        reference_error=error,
        reference_s=time.process_time() - start,
    )


def table(rows: Sequence[Row], slack: float) -> str:
    """Markdown table: for each noise and model fitted, converged records and how many of them are wrong in what."""
    lines = [
        "| noise or model | records | converged | decided | quantile | sd | ln Z | after an audit or DE | median s |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    if not rows:
        return "\n".join(lines)
    for name in ["all", *sorted({r.noise for r in rows}), *sorted({r.model for r in rows})]:
        own = [r for r in rows if name in ("all", r.noise, r.model)]
        good = [r for r in own if r.converged]
        decided = [r for r in good if r.reference_reached]
        wrong = [w for r in decided for w in r.wrong(slack)]
        slow = sum(r.method != "independence" for r in own)
        counts = " | ".join(str(wrong.count(what)) for what in ("quantile", "sd", "ln Z"))
        seconds = np.median([r.sample_s for r in own])
        lines.append(
            f"| {name} | {len(own)} | {len(good)} | {len(decided)} | {counts} | {slow} | {seconds:.2g} |"
        )
    return "\n".join(lines)


def _tell(row: Row) -> None:
    found = "not converged" if not row.converged else (
        f"off {row.quantile_off:.3f} sd ({row.at}, {100 * row.beyond:.1f} % beyond), "
        f"sd {100 * row.sd_off:.1f} %, ln Z {row.ln_z_off:.1f}; reference {row.reference_error:.3f}"
    )  # fmt: skip
    print(
        f"{row.number} {row.curve}, {row.channels}, {row.model}, {row.noise}: {row.method}, {found}; "
        f"{row.sample_s:.2f} s, {row.reference_s:.1f} s",
        file=sys.stderr,
        flush=True,
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the measurement."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--records", type=int, default=60, help="how many records")
    parser.add_argument("--seed", type=int, default=0, help="of the records and of all runs")
    parser.add_argument("--first", type=int, default=0, help="number of the first record")
    parser.add_argument("--quick", action="store_true", help="short references")
    parser.add_argument(
        "--numbers", type=int, nargs="+", help="of the records, in place of --records and --first"
    )
    parser.add_argument("--out", type=Path, default=Path("docs/data"), help="folder of tails.csv")
    options = parser.parse_args(arguments)
    numbers = options.numbers or range(options.first, options.first + options.records)
    if options.records < 1 or min([options.first, options.seed, *numbers]) < 0:
        parser.error("--records must be at least 1, --first, --seed and --numbers at least 0")
    length = QUICK if options.quick else LONG
    rows: list[Row] = []
    options.out.mkdir(parents=True, exist_ok=True)
    with (
        (options.out / "tails.csv").open("w", newline="", encoding="utf-8") as file,
        threadpool_limits(limits=1),
    ):
        writer = csv.DictWriter(file, [f.name for f in fields(Row)])
        writer.writeheader()
        try:
            for number in numbers:
                rows.append(measured(number, options.seed, length))
                writer.writerow(asdict(rows[-1]))
                file.flush()
                _tell(rows[-1])
        except KeyboardInterrupt:
            print(f"interrupted: {len(rows)} records", file=sys.stderr)
    print(table(rows, 2.0))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
