"""Measure `watch` as users call it: files of quiet cycles after a fit, then one of four faults, and what is said.

python scripts/measure_watch_alarms.py [--springs 100] [--cycles 100] [--out docs/data/watch.csv]

Springs are those of `tests/watched_spring.py`: in turn one with the published curve, and one of grains with skewed
temperatures, noise with a memory and a thermometer that errs. Four cycles are fitted, each further one is a file of
its own, and all are given to `watch`. `p_value` of the quiet ones is the least alpha with an alarm at any look. A
fault then begins after five more quiet cycles. Rows that the table holds are not made again; what is said of all is
printed.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
from measure_watch import FAULTY, QUIET_BEFORE, generator

import sma_bayes

FITTED: Final = 4
ALPHA: Final = 0.01
COLUMNS: Final = ("spring", "kind", "fault", "cycles", "p_value", "alarm", "named")
QUIET: Final = "none"


def kinds(spring: Any) -> dict[str, Any]:
    """Rigs by name."""
    return {
        "published curve": spring.PLAIN,
        "grains": replace(spring.GRAINS, channels=("displacement",), samples=40),
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
    """A fit, a watch of its quiet cycles, and one of a fault."""
    rng = np.random.default_rng([20, number])
    names = list(kinds(spring))
    kind = names[number % len(names)]
    rig = kinds(spring)[kind]
    fault = ("offset_drift", "loose_thermocouple", "worn", "moved")[number // len(names) % 4]
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
            yield {
                "spring": number,
                "kind": kind,
                "fault": name,
                "cycles": len(found["cycles"]),
                "p_value": f"{found['p_value']:.4g}",
                "alarm": (found["alarm"] or {}).get("cycle", ""),
                "named": "/".join(cause["id"] for cause in found["change"]["causes"]),
            }


def told(rows: list[dict[str, str]]) -> None:
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


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--springs", type=int, default=100)
    parser.add_argument("--cycles", type=int, default=100)
    parser.add_argument("--out", type=Path, default=Path(__file__).parents[1] / "docs" / "data" / "watch.csv")
    o = parser.parse_args()
    spring = generator()
    if not o.out.is_file():
        o.out.write_text(",".join(COLUMNS) + "\n", encoding="utf-8")
    with o.out.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    done = {int(r["spring"]) for r in rows}
    for number in range(o.springs):
        if number in done:
            continue
        new = [{k: str(v) for k, v in row.items()} for row in rows_of(spring, number, o.cycles)]
        with o.out.open("a", encoding="utf-8", newline="") as file:
            csv.DictWriter(file, COLUMNS, lineterminator="\n").writerows(new)
        rows += new
    told(rows)


if __name__ == "__main__":
    main()
