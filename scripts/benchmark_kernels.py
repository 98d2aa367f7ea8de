"""Time the batched log-posterior by numpy, numexpr and numba.

    python scripts/benchmark_kernels.py docs/data/kernels.csv

Prints the table of docs/performance.md: microseconds of processor time for one parameter vector, the least of many
repeats, in turn. Each kernel is compared with numpy's, which is the package's own. Needs the extra `bench`.
"""

from __future__ import annotations

import csv
import os
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMEXPR_NUM_THREADS"), "1"))

import numpy as np
from benchmark.kernels import KERNELS
from benchmark.problems import Case, Problem

CASES = (("FX", "independent"), ("FX", "ar1"), ("S", "independent"), ("S", "ar1"))
POINTS = (100, 1000)
ROWS = (1, 32, 256, 2048)
REPEATS = 15
LEAST_S = 0.002
"""Seconds of calls that are timed together."""


def timed(call: Callable[[], object], calls: int) -> float:
    """Processor time of one call."""
    began = time.process_time()
    for _ in range(calls):
        call()
    return (time.process_time() - began) / calls


def rows_of(channels: str, noise: str, points: int) -> list[dict[str, object]]:
    """Times of one case."""
    problem = Problem.of(Case(channels, noise, points).records()[0], noise)
    kernels = {name: make(problem.posterior) for name, make in KERNELS.items()}
    found: list[dict[str, object]] = []
    for count in ROWS:
        z = problem.starts(np.random.default_rng(0), count, "laplace")
        reference = problem.posterior.log_prob(z)
        for name, kernel in kernels.items():
            np.testing.assert_allclose(kernel(z), reference, rtol=1e-9, atol=1e-7, err_msg=name)
        calls = {
            name: max(1, round(LEAST_S / max(timed(partial(kernel, z), 3), 1e-7)))
            for name, kernel in kernels.items()
        }
        least = dict.fromkeys(kernels, float("inf"))
        for _ in range(REPEATS):
            for name, kernel in kernels.items():
                least[name] = min(least[name], timed(partial(kernel, z), calls[name]))
        for name, seconds in least.items():
            found.append({
                "channels": channels, "noise": noise, "points": points, "rows": count, "kernel": name,
                "us_each": f"{1e6 * seconds / count:.4g}",
            })  # fmt: skip
    return found


def main(out: Path) -> None:
    """Measure, write the rows, print the table."""
    found = [row for case in CASES for points in POINTS for row in rows_of(*case, points)]
    with out.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(found[0]))
        writer.writeheader()
        writer.writerows(found)
    print("| channels, noise, points | " + " | ".join(f"{k}, {n} rows" for k in KERNELS for n in ROWS) + " |")
    print("|---|" + "---|" * (len(KERNELS) * len(ROWS)))
    for channels, noise in CASES:
        for points in POINTS:
            cell = {
                (r["kernel"], r["rows"]): r["us_each"]
                for r in found
                if (r["channels"], r["noise"], r["points"]) == (channels, noise, points)
            }
            values = " | ".join(f"{cell[k, n]}" for k in KERNELS for n in ROWS)
            print(f"| {channels}, {noise}, {points} | {values} |")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
