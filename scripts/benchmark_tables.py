"""Print the tables of docs/performance.md from the raw rows in docs/data.

    python scripts/benchmark_tables.py docs/data

`peers.csv` by benchmark_samplers.py, `stages.csv` by benchmark_stages.py, `kernels.csv` by benchmark_kernels.py.
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
    ("FX", "independent", "100"): "force with displacement, 100 points",
    ("FX", "independent", "1000"): "the same, 1000 points",
    ("FX", "ar1", "100"): "100 points, AR(1) noise",
    ("S", "independent", "100"): "stiffness only, 100 points",
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
    """Samplers over the records of the twin campaign: ratios of sums over the records that both did."""
    by: dict[str, dict[str, dict[str, str]]] = defaultdict(dict)
    for row in rows:
        if row["length"] == "demo":
            by[row["sampler"]][row["record"]] = row
    own = by[OWN]
    lines = []
    for name, found in by.items():
        times = [cpu(row) for row in found.values()]
        both = [key for key in found if key in own]
        each = [cpu(found[key]) / cpu(own[key]) for key in both]
        ratio = sum(cpu(found[key]) for key in both) / sum(cpu(own[key]) for key in both)
        rate = [min(float(r["ess_bulk"]), float(r["ess_tail"])) / cpu(r) for r in found.values()]
        lines.append([
            TITLES[name],
            f"{sum(r['reached'] == 'True' for r in found.values())} of {len(found)}",
            f"{statistics.median(times):.3f} ({min(times):.3f} to {max(times):.3f})",
            "1" if name == OWN else f"**{ratio:.3g}**",
            "" if name == OWN else f"{min(each):.3g} to {max(each):.3g}",
            f"{statistics.median(int(r['evaluations']) for r in found.values()):,.0f}",
            f"{statistics.median(rate):,.0f}",
        ])  # fmt: skip
    show(
        ["sampler", "reached", "CPU s a record: median (range)", "ratio of sums", "ratio by record (range)",
         "evaluations", "ESS a CPU second"],
        lines,
    )  # fmt: skip


def one_record(rows: Rows) -> None:
    """Median times of samplers in each case; what did not reach the target with the time after which it was stopped."""
    cells: dict[tuple[str, tuple[str, ...]], Rows] = defaultdict(list)
    for row in rows:
        cells[row["sampler"], (row["channels"], row["noise"], row["length"])].append(row)
    lines = []
    for name, title in TITLES.items():
        found = [cells.get((name, case), []) for case in CASES]
        if any(found):
            lines.append([title, *map(cell, found)])
    show(["sampler", *CASES.values()], lines)


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
    campaign(peers)
    one_record(peers)
    stages(read(data / "stages.csv"))
    kernels(read(data / "kernels.csv"))
