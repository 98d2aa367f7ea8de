"""Measure what `watch` is good for: false alarms in quiet cycles, and how soon faults are found and named.

python scripts/measure_watch.py files [--springs 100] [--cycles 100] [--out docs/data/watch.csv]
python scripts/measure_watch.py series [--springs 20] [--cycles 500] [--fitted 4] [--seed 0]
python scripts/measure_watch.py real FOLDER [--series 3] [--cycles 20] [--out docs/data/watch_real.csv]

Springs and faults are those of `tests/watched_spring.py`. Each spring is fitted by its first cycles; quiet ones follow.
A fault then begins after five more quiet cycles. `p_value` of the quiet ones is the least alpha with an alarm at any
look.

`files` does it as users do: each further cycle is a file of its own, and all are given to `watch`. Springs have in turn
the published curve, and grains with skewed temperatures, noise with a memory and a thermometer that errs. Each has one
of the faults. Rows that the table holds are not made again; what is said of all is printed.

`series` reads many cycles at once, without the verb, so that series may be long: grains alone, each with every fault.

`real` puts series together of real cycles: the last three of a wire that trained in seven (FOLDER holds
`isobaric_7cycle.txt`). Each further cycle is one of them, drawn at random, with the residuals about its smoothed
readings put back from another place. Faults are planted in the readings.
"""

from __future__ import annotations

import argparse
import csv
import importlib.util
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import Any, Final

import numpy as np
from scipy.interpolate import make_smoothing_spline

import sma_bayes
from sma_bayes.records.campaign import read_campaign
from sma_bayes.records.types import Record
from sma_bayes.studies.cycles.sweeps import sweeps_of
from sma_bayes.studies.watch.evidence import log_evidence, onset
from sma_bayes.studies.watch.naming import causes_of, change_of, named
from sma_bayes.studies.watch.reference import Reference, reference_of
from sma_bayes.studies.watch.state import StrandNumbers

QUIET_BEFORE, FAULTY, FITTED, ALPHA = 5, 15, 4, 0.01
COLUMNS: Final = ("spring", "kind", "fault", "cycles", "p_value", "alarm", "named")
QUIET: Final = "none"
GRAINS: Final = "grains"
FAULTS: Final = ("offset_drift", "loose_thermocouple", "worn", "moved")
TABLE: Final = Path(__file__).parents[1] / "docs" / "data" / "watch.csv"


def generator() -> ModuleType:
    """The springs of the tests."""
    path = Path(__file__).parents[1] / "tests" / "watched_spring.py"
    spec = importlib.util.spec_from_file_location("watched_spring", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def kinds(spring: Any) -> dict[str, Any]:
    """Rigs by name."""
    return {
        "published curve": spring.PLAIN,
        GRAINS: replace(spring.GRAINS, channels=("displacement",), samples=40),
    }


def faulty_cycles(spring: Any, rig: Any, fault: str, rng: np.random.Generator) -> Iterator[Any]:
    """Quiet cycles, then those of a fault."""
    for n in range(1 - QUIET_BEFORE, FAULTY + 1):
        if n < 1:
            yield rig.cycle(rng)
        elif fault == "worn":
            yield rig.cycle(rng, worn=0.03 * np.log1p(n))
        elif fault == "moved":
            yield rig.cycle(rng, moved=0.6)
        else:
            yield getattr(spring, fault)(n, rig.cycle(rng))


def rows_of(spring: Any, number: int, cycles: int) -> Iterator[dict[str, Any]]:
    """A fit, a watch of its quiet cycles, and one of a fault, each cycle a file."""
    rng = np.random.default_rng([20, number])
    names = list(kinds(spring))
    kind = names[number % len(names)]
    rig = kinds(spring)[kind]
    fault = FAULTS[number // len(names) % len(FAULTS)]
    with TemporaryDirectory() as place:
        folder = Path(place)
        campaign = sma_bayes.read_campaign(rig.campaign(folder / "bench", rng, FITTED))
        sma_bayes.fit_campaign(campaign, folder / "fit", jobs=1, figures="none", noise="independent")
        watched = {
            QUIET: [rig.cycle(rng) for _ in range(cycles)],
            fault: [*faulty_cycles(spring, rig, fault, rng)],
        }
        for name, read in watched.items():
            files = [spring.write(folder / name / f"{n:03}.csv", [cycle]) for n, cycle in enumerate(read, 1)]
            found = sma_bayes.watch(folder / "fit", files, alpha=ALPHA)
            yield row_of(number, kind, name, found)


def rows_of_series(
    spring: Any, number: int, cycles: int, fitted: int, rng: np.random.Generator
) -> Iterator[dict[str, Any]]:
    """The same of cycles that are read at once, and of every fault."""
    rig = kinds(spring)[GRAINS]
    with TemporaryDirectory() as place:
        records = _records_of(spring, rig, [rig.cycle(rng) for _ in range(fitted)], Path(place))
        reference = reference_of(records, {r.key: "sinh_arcsinh" for r in records}, 0)
        for fault in (QUIET, *FAULTS):
            read = (
                [rig.cycle(rng) for _ in range(cycles)]
                if fault == QUIET
                else [*faulty_cycles(spring, rig, fault, rng)]
            )
            watched = reference.watched(_numbers_of(reference, _records_of(spring, rig, read, Path(place))))
            evidence = log_evidence(watched)
            over = np.flatnonzero(evidence.max(axis=1) >= np.log(evidence.shape[1] / ALPHA))
            change = change_of(watched, onset(watched, int(evidence[-1].argmax()))) if over.size else None
            causes = [] if change is None else named(change, causes_of(reference.strands))
            yield {
                "spring": number,
                "kind": GRAINS,
                "fault": fault,
                "cycles": len(read),
                "p_value": f"{min(1.0, float(np.exp(np.log(evidence.shape[1]) - evidence.max()))):.4g}",
                "alarm": int(over[0]) + 1 if over.size else "",
                "named": "/".join("+".join(c.id for c in x.causes) for x in causes),
            }


def _records_of(spring: Any, rig: Any, cycles: Sequence[Any], folder: Path) -> tuple[Record, ...]:
    """Cycles written and read as a campaign."""
    spring.write(folder / "fitted.csv", cycles)
    text = spring.TOML.replace("{force}", spring.FORCE if "force" in rig.channels else "")
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    return read_campaign(folder).records


def _numbers_of(reference: Reference, records: tuple[Record, ...]) -> list[list[StrandNumbers]]:
    """Numbers of many cycles at once."""
    by_strand = []
    for strand in reference.strands:
        record = next(r for r in records if r.branch is strand.record.branch)
        sweeps, cycle, _ = sweeps_of(
            replace(record, observed={strand.channel: record.observed[strand.channel]}), strand.channel
        )
        own = strand.about(sweeps, cycle)
        ends = np.append(own.starts, sweeps.n)
        found = []
        for i in range(cycle.size):
            rows = slice(ends[i], ends[i + 1])
            left = sweeps.observed[strand.channel][rows] - strand.curve(
                own.numbers[i], sweeps.temperature[rows]
            )
            noise = float(np.log(np.sqrt(np.mean(left**2)) / strand.span))
            found.append(
                StrandNumbers(
                    value=(*own.numbers[i].tolist(), noise), sd=tuple(own.sds[i].tolist()), samples=left.size
                )
            )
        by_strand.append(found)
    return [list(cycle) for cycle in zip(*by_strand, strict=True)]


def told(rows: Sequence[Mapping[str, Any]]) -> None:
    """What the rows say."""
    quiet = [r for r in rows if r["fault"] == QUIET]
    p = np.array([float(r["p_value"]) for r in quiet])
    cycles = sum(int(r["cycles"]) for r in quiet)
    alarms = {alpha: int(np.sum(p <= alpha)) for alpha in (0.2, 0.1, 0.05, 0.01)}
    print(f"{len(quiet)} springs, {cycles} quiet cycles; springs with an alarm by alpha: {alarms}")
    for fault in sorted({r["fault"] for r in rows} - {QUIET}):
        for kind in sorted({r["kind"] for r in rows}):
            own = [r for r in rows if r["fault"] == fault and r["kind"] == kind]
            if not own:
                continue
            delay = np.array([int(r["alarm"]) - QUIET_BEFORE if r["alarm"] else np.inf for r in own])
            low, middle, high = np.quantile(delay, [0.1, 0.5, 0.9], method="inverted_cdf")
            print(
                f"{fault}, {kind}: {len(own)} springs, alarm after {middle:g} ({low:g} to {high:g}) cycles, "
                f"{int(np.sum(delay <= 0))} before the fault, {int(np.sum(np.isinf(delay)))} not within {FAULTY}"
            )
            names = [r["named"] for r in own]
            for name in sorted(set(names), key=names.count, reverse=True):
                print(f"    {names.count(name)}: {name or 'no name'}")


def measure_files(springs: int, cycles: int, out: Path) -> None:
    """Springs watched by files; rows that are made are kept."""
    spring = generator()
    if not out.is_file():
        out.write_text(",".join(COLUMNS) + "\n", encoding="utf-8")
    with out.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    done = {int(r["spring"]) for r in rows}
    for number in range(springs):
        if number in done:
            continue
        new = [{k: str(v) for k, v in row.items()} for row in rows_of(spring, number, cycles)]
        with out.open("a", encoding="utf-8", newline="") as file:
            csv.DictWriter(file, COLUMNS, lineterminator="\n").writerows(new)
        rows += new
    told(rows)


@dataclass(frozen=True, eq=False)
class RealCycle:
    """A cycle of the wire, smoothed: temperature [degC], displacement [mm], and what the readings are off by [mm]."""

    temperature: np.ndarray
    displacement: np.ndarray
    residual: np.ndarray

    @staticmethod
    def of(time: np.ndarray, temperature: np.ndarray, displacement: np.ndarray) -> RealCycle:
        smooth = make_smoothing_spline(time, displacement)(time)
        return RealCycle(temperature, smooth, displacement - smooth)

    def again(self, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """The cycle once more, its residuals moved along it."""
        moved = np.roll(self.residual, int(rng.integers(self.residual.size))) * rng.choice((-1.0, 1.0))
        return {"temperature": self.temperature, "displacement": self.displacement + moved}


def real_cycles(folder: Path) -> list[RealCycle]:
    """The last three of seven."""
    found = []
    for line in (folder / "isobaric_7cycle.txt").read_text(encoding="utf-8").splitlines():
        with suppress(ValueError):
            found.append([float(cell) for cell in line.strip('"').split(",")])
    hours, _, _, temperature, displacement, _ = np.array([row for row in found if len(row) == 6]).T
    good = temperature != 0.0  # drop-outs of the thermometer
    cycles = []
    for low, high in pairwise(REAL_ENDS):
        own = good & (hours > low) & (hours <= high)
        cycles.append(RealCycle.of(hours[own], temperature[own], displacement[own]))
    return cycles


def written(path: Path, cycles: Sequence[Mapping[str, np.ndarray]]) -> Path:
    """Cycles as a file, a reading each half minute."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = np.concatenate([np.column_stack([c["temperature"], c["displacement"]]) for c in cycles])
    lines = [f"{30.0 * n:g},{t:.2f},{x:.3f}" for n, (t, x) in enumerate(rows)]
    path.write_text("\n".join(["time_s,temperature_C,displacement_mm", *lines]) + "\n", encoding="utf-8")
    return path


REAL_ENDS: Final = (3.286, 4.059, 4.841, 6.0)
"""Hours at which cycles of the wire begin and end, at the hot end."""
AMBIENT: Final = 22.0
REAL_FAULTS: Final[dict[str, Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]]] = {
    QUIET: lambda t, x: (t, x),
    "zero": lambda t, x: (t, x + 1.0),
    "worn": lambda t, x: (t, x.max() - 0.9 * (x.max() - x)),
    "scale": lambda t, x: (t, 0.9 * x),
    "moved": lambda t, x: (t + 3.0, x),
    "loose": lambda t, x: (t - 0.06 * (t - AMBIENT), x),
}
"""Temperature and displacement with a fault."""


def rows_of_real(cycles: Sequence[RealCycle], number: int, count: int) -> Iterator[dict[str, Any]]:
    """A fit of six, each twice, and watches of series with and without faults, each cycle a file."""
    rng = np.random.default_rng([21, number])
    with TemporaryDirectory() as place:
        folder = Path(place)
        written(folder / "bench" / "a.csv", [c.again(rng) for c in (*cycles, *cycles)])
        sma_bayes.fit_campaign(
            sma_bayes.read_campaign(folder / "bench" / "a.csv"), folder / "fit", jobs=1, figures="none"
        )
        for name, fault in REAL_FAULTS.items():
            files = []
            for n in range(1, count + 1):
                read = cycles[int(rng.integers(len(cycles)))].again(rng)
                if n > QUIET_BEFORE:
                    t, x = fault(read["temperature"], read["displacement"])
                    read = {"temperature": t, "displacement": x}
                files.append(written(folder / name / f"{n:03}.csv", [read]))
            yield row_of(number, "real", name, sma_bayes.watch(folder / "fit", files, alpha=ALPHA))


def row_of(number: int, kind: str, fault: str, found: Mapping[str, Any]) -> dict[str, Any]:
    """What a watch found, as a row."""
    return {
        "spring": number,
        "kind": kind,
        "fault": fault,
        "cycles": len(found["cycles"]),
        "p_value": f"{found['p_value']:.4g}",
        "alarm": (found["alarm"] or {}).get("cycle", ""),
        "named": "/".join(cause["id"] for cause in found["change"]["causes"]),
    }


def measure_real(folder: Path, series: int, cycles: int, out: Path) -> None:
    """Series of real cycles; written when all are made."""
    real = real_cycles(folder)
    rows = [row for number in range(series) for row in rows_of_real(real, number, cycles)]
    with out.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    told(rows)


def measure_series(springs: int, cycles: int, fitted: int, seed: int) -> None:
    """Springs whose cycles are read at once."""
    spring, rng = generator(), np.random.default_rng(seed)
    rows: list[dict[str, Any]] = []
    for number in range(springs):
        rows += rows_of_series(spring, number, cycles, fitted, rng)
        print(f"{number + 1} of {springs} springs", file=sys.stderr, flush=True)
    told(rows)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    files = commands.add_parser("files", help="each cycle a file, by the verb")
    files.add_argument("--springs", type=int, default=100)
    files.add_argument("--cycles", type=int, default=100)
    files.add_argument("--out", type=Path, default=TABLE)
    series = commands.add_parser("series", help="many cycles at once, without the verb")
    series.add_argument("--springs", type=int, default=20)
    series.add_argument("--cycles", type=int, default=500)
    series.add_argument("--fitted", type=int, default=FITTED)
    series.add_argument("--seed", type=int, default=0)
    real = commands.add_parser("real", help="series of real cycles")
    real.add_argument("folder", type=Path)
    real.add_argument("--series", type=int, default=3)
    real.add_argument("--cycles", type=int, default=20)
    real.add_argument("--out", type=Path, default=TABLE.with_name("watch_real.csv"))
    o = vars(parser.parse_args(arguments))
    measure = {"files": measure_files, "series": measure_series, "real": measure_real}[o.pop("command")]
    measure(**o)


if __name__ == "__main__":
    main()
