"""Measure what `watch` is good for: false alarms in quiet cycles, and how soon faults are found and named.

python scripts/measure_watch.py [--springs 20] [--cycles 500] [--fitted 4] [--seed 0]

Springs and faults are those of `tests/watched_spring.py`: grains with skewed temperatures, noise with a memory, a
thermometer that errs, sweeps that scatter. Each spring is fitted by its first cycles; quiet ones follow. Then each
fault begins after five more quiet cycles.
"""

from __future__ import annotations

import argparse
import importlib.util
import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType

import numpy as np

from sma_bayes.records.campaign import read_campaign
from sma_bayes.records.types import Record
from sma_bayes.studies.cycles.sweeps import sweeps_of
from sma_bayes.studies.watch.evidence import log_evidence, onset
from sma_bayes.studies.watch.naming import causes_of, change_of, named
from sma_bayes.studies.watch.reference import Reference, reference_of
from sma_bayes.studies.watch.state import StrandNumbers

QUIET_BEFORE, FAULTY, ALPHA = 5, 15, 0.01


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


def records_of(spring: ModuleType, rig, cycles: list, folder: Path) -> tuple[Record, ...]:
    """Cycles written and read as a campaign."""
    spring.write(folder / "fitted.csv", cycles)
    text = spring.TOML.replace("{force}", spring.FORCE if "force" in rig.channels else "")
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    return read_campaign(folder).records


def numbers_of(reference: Reference, records: tuple[Record, ...]) -> list[list[StrandNumbers]]:
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


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--springs", type=int, default=20)
    parser.add_argument("--cycles", type=int, default=500)
    parser.add_argument("--fitted", type=int, default=4)
    parser.add_argument("--seed", type=int, default=0)
    o = parser.parse_args()
    spring, rng = generator(), np.random.default_rng(o.seed)
    faults = {f.__name__: f for f in (spring.offset_drift, spring.loose_thermocouple)}
    mechanisms = {"worn": lambda n: {"worn": 0.03 * np.log1p(n)}, "moved": lambda n: {"moved": 0.6}}
    rig = replace(spring.GRAINS, channels=("displacement",), samples=40)
    greatest: list[float] = []
    delays: dict[str, list[int]] = {name: [] for name in (*faults, *mechanisms)}
    names: dict[str, list[str]] = {name: [] for name in delays}
    with TemporaryDirectory() as place:
        for n in range(o.springs):
            fitted = records_of(spring, rig, [rig.cycle(rng) for _ in range(o.fitted)], Path(place))
            reference = reference_of(fitted, {r.key: "sinh_arcsinh" for r in fitted}, 0)
            quiet = [rig.cycle(rng) for _ in range(o.cycles)]
            later = numbers_of(reference, records_of(spring, rig, quiet, Path(place)))
            evidence = log_evidence(reference.watched(later))
            greatest.append(float(evidence.max() - np.log(evidence.shape[1])))
            for name in delays:
                read = [rig.cycle(rng) for _ in range(QUIET_BEFORE)]
                for k in range(1, FAULTY + 1):
                    read.append(
                        faults[name](k, rig.cycle(rng))
                        if name in faults
                        else rig.cycle(rng, **mechanisms[name](k))
                    )
                watched = reference.watched(numbers_of(reference, records_of(spring, rig, read, Path(place))))
                evidence = log_evidence(watched)
                over = np.flatnonzero(evidence.max(axis=1) >= np.log(evidence.shape[1] / ALPHA))
                delays[name].append(int(over[0]) + 1 - QUIET_BEFORE if over.size else 99)
                change = change_of(watched, onset(watched, int(evidence[-1].argmax()))) if over.size else None
                causes = [] if change is None else named(change, causes_of(reference.strands))
                names[name].append("/".join("+".join(c.id for c in x.causes) for x in causes) or "unnamed")
            alarms = {a: int(np.sum(np.array(greatest) >= np.log(1.0 / a))) for a in (0.2, 0.1, 0.05, 0.01)}
            cycles = (n + 1) * o.cycles
            print(
                f"{n + 1} springs, {cycles} quiet cycles; springs with an alarm by alpha: {alarms}",
                flush=True,
            )
    for name, found in delays.items():
        low, middle, high = np.quantile(found, [0.1, 0.5, 0.9])
        early = sum(d <= 0 for d in found)
        print(f"{name}: cycles until the alarm: {middle:g} ({low:g} to {high:g}); before the fault: {early}")
        for text in sorted(set(names[name]), key=names[name].count, reverse=True):
            print(f"    {names[name].count(text)} of {len(found)}: {text}")


if __name__ == "__main__":
    main()
