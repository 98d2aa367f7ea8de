"""Print the tables of docs/performance.md from the raw rows in docs/data.

    python scripts/benchmark_tables.py docs/data

`samplers.csv`, `campaign.csv`, `peers.csv` and `others.csv` by benchmark_samplers.py, `stages.csv` by
benchmark_stages.py, `kernels.csv` by benchmark_kernels.py.
"""

from __future__ import annotations

import csv
import statistics
import sys
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

from benchmark.rows import OWN
from benchmark.samplers import SAMPLERS

Rows = list[dict[str, str]]

CASES = {
    ("independent", "100"): "independent, 100",
    ("independent", "1000"): "independent, 1000",
    ("ar1", "100"): "AR(1), 100",
    ("ar1", "1000"): "AR(1), 1000",
}
CHANNELS = ("FX", "S")
KERNELS = ("numpy", "numexpr", "numba")


def read(path: Path) -> Rows:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def show(header: Sequence[str], lines: Sequence[Sequence[str]]) -> None:
    print(f"\n| {' | '.join(header)} |\n|{'---|' * len(header)}")
    for line in lines:
        print(f"| {' | '.join(line)} |")


def three(value: float) -> str:
    """Three digits, those before the point in full: 0.0128, 16.9, 1,310."""
    return f"{value:.3g}" if value < 1000.0 else f"{float(f'{value:.3g}'):,.0f}"


def spread(middle: float, values: Sequence[float]) -> str:
    return f"{three(middle)} ({three(min(values))} to {three(max(values))})"


def cpu(row: dict[str, str]) -> float:
    return float(row["cpu_s"])


def campaign(rows: Rows) -> None:
    """Samplers over the records of the twin campaign: medians of repeats, ratios of sums over records that both did."""
    by: dict[str, dict[str, Rows]] = defaultdict(lambda: defaultdict(list))
    for row in rows:
        by[row["sampler"]][row["record"]].append(row)
    own = {key: statistics.median(map(cpu, found)) for key, found in by[OWN].items()}
    lines = []
    for name in (name for name in SAMPLERS if name in by):
        found = by[name]
        every = [row for repeats in found.values() for row in repeats]
        typical = {key: statistics.median(map(cpu, repeats)) for key, repeats in found.items()}
        both = [key for key in typical if key in own]
        each = [typical[key] / own[key] for key in both]
        ratio = sum(typical[key] for key in both) / sum(own[key] for key in both)
        rate = [min(float(r["ess_bulk"]), float(r["ess_tail"])) / cpu(r) for r in every]
        lines.append([
            SAMPLERS[name].title,
            f"{sum(r['reached'] == 'True' for r in every)} of {len(every)}",
            spread(statistics.median(typical.values()), [cpu(r) for r in every]),
            "1" if name == OWN else f"**{three(ratio)}**",
            "" if name == OWN else spread(statistics.median(each), each),
            f"{statistics.median(int(r['evaluations']) for r in every):,.0f}",
            f"{statistics.median(rate):,.0f}",
        ])  # fmt: skip
    show(
        ["sampler", "runs that reached it", "CPU s a record: median (range)", "ratio of sums",
         "ratio by record: median (range)", "evaluations", "ESS a CPU second"],
        lines,
    )  # fmt: skip


def one_record(rows: Rows) -> None:
    """Median times of samplers on one record, a table for each set of channels and a column for each kind of data."""
    cells: dict[tuple[str, ...], Rows] = defaultdict(list)
    for row in rows:
        cells[row["sampler"], row["channels"], row["noise"], row["length"]].append(row)
    for channels in CHANNELS:
        lines = []
        for name, sampler in SAMPLERS.items():
            found = [cells.get((name, channels, *case), []) for case in CASES]
            if any(found):
                lines.append([sampler.title, *map(cell, found)])
        show([f"{channels}: sampler", *CASES.values()], lines)


def cold(rows: Rows) -> None:
    """Median times from the start of a fresh process, beside those of one in which all is imported and compiled."""
    by: dict[tuple[str, str], Rows] = defaultdict(list)
    for row in rows:
        if (row["channels"], row["noise"], row["length"]) == ("FX", "independent", "100"):
            by[row["sampler"], row["kind"]].append(row)
    found = [
        (by.get((name, "cold"), []), by.get((name, "warm"), []), sampler.title)
        for name, sampler in SAMPLERS.items()
    ]
    show(["sampler", "cold", "warm"], [[title, cell(c), cell(w)] for c, w, title in found if c])


def cell(rows: Rows) -> str:
    """Median time; where not all runs reached the target a lower bound, and how many did or why they did not."""
    if not rows:
        return "not measured"
    failed = [row for row in rows if row["reached"] != "True"]
    time = three(statistics.median(map(cpu, rows)))
    if not failed:
        return time
    note = f" ({len(rows) - len(failed)} of {len(rows)})" if len(failed) < len(rows) else ""
    claimed = " †" if any(row["claimed_s"] != "nan" for row in failed) else ""
    killed = " ‡" if any(row["ended"] == "killed" for row in failed) else ""
    return f"> {time}{note}{claimed}{killed}"


def stages(rows: Rows) -> None:
    show(["stage", "CPU [s]"], [[row["stage"], f"{cpu(row):.2g}"] for row in rows])


def kernels(rows: Rows) -> None:
    batches = list(dict.fromkeys(row["rows"] for row in rows))
    times = {
        (r["channels"], r["noise"], r["points"], r["kernel"], r["rows"]): float(r["us_each"]) for r in rows
    }
    lines = [
        [", ".join(case), *(three(times[(*case, k, n)]) for k in KERNELS for n in batches)]
        for case in dict.fromkeys((r["channels"], r["noise"], r["points"]) for r in rows)
    ]
    show(["channels, noise, points", *(f"{k}, {n}" for k in KERNELS for n in batches)], lines)


def main(data: Path) -> None:
    """Print all tables."""
    peers, records = read(data / "peers.csv") + read(data / "others.csv"), read(data / "campaign.csv")
    campaign(read(data / "samplers.csv"))
    campaign([row for row in records if row["kind"] == "warm"])
    campaign([row for row in records if row["kind"] == "unaided"])
    one_record([row for row in peers if row["kind"] == "warm"])
    cold(peers)
    stages(read(data / "stages.csv"))
    kernels(read(data / "kernels.csv"))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
