"""Print the tables of docs/performance.md from the raw rows in docs/data.

    python scripts/benchmark_tables.py docs/data

`samplers.csv` and `peers.csv` by benchmark_samplers.py, `stages.csv` by benchmark_stages.py, `kernels.csv` by
benchmark_kernels.py.
"""

from __future__ import annotations

import csv
import statistics
import sys
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

Rows = list[dict[str, str]]

OWN = "sma_bayes"
TITLES = {
    OWN: "this package",
    "blackjax": "NUTS by hand (blackjax: whitened, vectorised)",
    "emcee-de": "emcee, vectorised, differential evolution",
    "nutpie": "nutpie",
    "emcee-vectorised": "emcee, vectorised, stretch",
    "zeus": "zeus, vectorised",
    "dynesty": "dynesty, `rslice`",
    "ultranest": "ultranest, slices",
    "pymc": "PyMC NUTS",
    "numpyro": "NumPyro NUTS, dense mass",
    "emcee": "emcee, one vector a call",
    "lmfit": "lmfit `emcee`",
}
CASES = {
    ("FX", "independent", "100"): "FX, independent, 100",
    ("FX", "independent", "1000"): "FX, independent, 1000",
    ("FX", "ar1", "100"): "FX, AR(1), 100",
    ("FX", "ar1", "1000"): "FX, AR(1), 1000",
    ("S", "independent", "100"): "S, independent, 100",
    ("S", "independent", "1000"): "S, independent, 1000",
    ("S", "ar1", "100"): "S, AR(1), 100",
    ("S", "ar1", "1000"): "S, AR(1), 1000",
}
KERNELS = ("numpy", "numexpr", "numba")


def read(path: Path) -> Rows:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def show(header: Sequence[str], lines: Sequence[Sequence[str]]) -> None:
    print(f"\n| {' | '.join(header)} |\n|{'---|' * len(header)}")
    for line in lines:
        print(f"| {' | '.join(line)} |")


def cpu(row: dict[str, str]) -> float:
    return float(row["cpu_s"])


def campaign(rows: Rows) -> None:
    """Samplers over the records of the twin campaign: medians of repeats, ratios of sums over records that both did."""
    by: dict[str, dict[str, Rows]] = defaultdict(lambda: defaultdict(list))
    for row in rows:
        if row["length"] == "demo":
            by[row["sampler"]][row["record"]].append(row)
    own = {key: statistics.median(map(cpu, found)) for key, found in by[OWN].items()}
    lines = []
    for name, found in by.items():
        every = [row for repeats in found.values() for row in repeats]
        typical = {key: statistics.median(map(cpu, repeats)) for key, repeats in found.items()}
        both = [key for key in typical if key in own]
        each = [typical[key] / own[key] for key in both]
        ratio = sum(typical[key] for key in both) / sum(own[key] for key in both)
        rate = [min(float(r["ess_bulk"]), float(r["ess_tail"])) / cpu(r) for r in every]
        lines.append([
            TITLES[name],
            f"{sum(r['reached'] == 'True' for r in every)} of {len(every)}",
            f"{statistics.median(typical.values()):.3g} ({min(map(cpu, every)):.3g} to {max(map(cpu, every)):.3g})",
            "1" if name == OWN else f"**{ratio:.3g}**",
            "" if name == OWN else f"{statistics.median(each):.3g} ({min(each):.3g} to {max(each):.3g})",
            f"{statistics.median(int(r['evaluations']) for r in every):,.0f}",
            f"{statistics.median(rate):,.0f}",
        ])  # fmt: skip
    show(
        ["sampler", "runs that reached it", "CPU s a record: median (range)", "ratio of sums",
         "ratio by record: median (range)", "evaluations", "ESS a CPU second"],
        lines,
    )  # fmt: skip


def one_record(rows: Rows) -> None:
    """Median times of samplers in each case; what did not reach the target with the time after which it was stopped."""
    cells: dict[tuple[str, tuple[str, ...]], Rows] = defaultdict(list)
    for row in rows:
        cells[row["sampler"], (row["channels"], row["noise"], row["length"])].append(row)
    measured = [case for case in CASES if any((name, case) in cells for name in TITLES)]
    lines = []
    for name, title in TITLES.items():
        found = [cells.get((name, case), []) for case in measured]
        if any(found):
            lines.append([title, *map(cell, found)])
    show(["sampler", *(CASES[case] for case in measured)], lines)


def cell(rows: Rows) -> str:
    if not rows:
        return "not measured"
    bound = "" if all(row["reached"] == "True" for row in rows) else "> "
    return f"{bound}{statistics.median(map(cpu, rows)):.3g}"


def stages(rows: Rows) -> None:
    show(["stage", "CPU [s]"], [[row["stage"], f"{cpu(row):.2g}"] for row in rows])


def kernels(rows: Rows) -> None:
    batches = list(dict.fromkeys(row["rows"] for row in rows))
    times = {
        (r["channels"], r["noise"], r["points"], r["kernel"], r["rows"]): float(r["us_each"]) for r in rows
    }
    lines = [
        [", ".join(case), *(f"{times[(*case, k, n)]:.3g}" for k in KERNELS for n in batches)]
        for case in dict.fromkeys((r["channels"], r["noise"], r["points"]) for r in rows)
    ]
    show(["channels, noise, points", *(f"{k}, {n}" for k in KERNELS for n in batches)], lines)


if __name__ == "__main__":
    data = Path(sys.argv[1])
    peers = [row for row in read(data / "peers.csv") if row["kind"] == "warm"]
    campaign([row for row in read(data / "samplers.csv") if row["kind"] == "warm"])
    campaign(peers)
    one_record(peers)
    stages(read(data / "stages.csv"))
    kernels(read(data / "kernels.csv"))
