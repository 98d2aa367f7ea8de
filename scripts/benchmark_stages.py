"""Where the time of the demo campaign goes, and how far sampling is from its physical limit.

    python scripts/benchmark_stages.py docs/data/stages.csv

Runs `sma-bayes demo --jobs 1` in a fresh process, takes processor times from its own account, and adds the imports of
a fresh process. The limit: as many evaluations of the density as effective draws are asked for, at the throughput of
the fastest kernel at hand (see benchmark_kernels.py); sampling is measured in turn. Prints the table of
docs/performance.md.
"""

from __future__ import annotations

import csv
import itertools
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))

import numpy as np
from benchmark.judgement import TARGET
from benchmark.kernels import KERNELS
from benchmark.problems import Case, Problem

from sma_bayes.sampling.ensembles import sample

REPEATS = 7
ROWS = 2048


def children_cpu() -> float:
    """Processor time of finished child processes."""
    spent = os.times()
    return spent.children_user + spent.children_system


def fresh(code: str) -> float:
    """Least processor time of a fresh process that runs a line of Python."""
    found = []
    for _ in range(REPEATS):
        before = children_cpu()
        subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)
        found.append(children_cpu() - before)
    return min(found)


def demo() -> dict[str, float]:
    """Processor time of each stage of the demo."""
    command = [
        "from sma_bayes.cli import main; main()",
        "demo",
        "--paper",
        "--jobs",
        "1",
        "--quiet",
        "--json",
        "--out",
    ]
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, "-c", *command, str(Path(folder) / "demo")], check=False, capture_output=True
        )
        if done.returncode not in (0, 1):
            raise RuntimeError(done.stderr.decode())
    stages: dict[str, float] = json.loads(done.stdout)["stages_cpu_s"]
    return stages


def least(do: Callable[[], object]) -> float:
    """Least processor time of something that is done several times."""
    do()
    times = []
    for _ in range(REPEATS):
        began = time.process_time()
        do()
        times.append(time.process_time() - began)
    return min(times)


def sampling(problem: Problem) -> Callable[[], object]:
    """Sample a problem, each time with another seed."""
    width, seeds = problem.posterior.space.prior_sd(), map(np.random.SeedSequence, itertools.count())
    return lambda: sample(problem.posterior, [problem.start], width, next(seeds))


def limits() -> dict[str, float]:
    """Processor time of the evaluations for the target over the 18 records, by kernel, and of sampling in turn."""
    total: dict[str, float] = {}
    for record in Case("FX", "independent").records():
        problem = Problem.of(record, "independent")
        z = problem.starts(np.random.default_rng(0), ROWS, "laplace")
        spent = {
            f"limit of sampling, {name}": least(partial(make(problem.posterior), z)) * TARGET.ess / ROWS
            for name, make in KERNELS.items()
        }
        spent["sampling, force with displacement"] = least(sampling(problem))
        for name, seconds in spent.items():
            total[name] = total.get(name, 0.0) + seconds
    return total


def main(out: Path) -> None:
    """Measure, write the rows, print the table."""
    rows = {
        "Python alone": fresh("pass"),
        "import sma_bayes": fresh("import sma_bayes"),
        "sma-bayes --help": fresh(
            "import sys; sys.argv[1:] = ['--help']; from sma_bayes.cli import main; main()"
        ),
        "imports of fit": fresh("import sma_bayes.studies.fit.workflow, sma_bayes.runs.store"),
        "imports of figures": fresh("import sma_bayes.studies.fit.workflow, sma_bayes.report.figures"),
        **{f"demo: {stage}": spent for stage, spent in demo().items()},
        **limits(),
    }
    with out.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["stage", "cpu_s"])
        writer.writerows((name, f"{spent:.4g}") for name, spent in rows.items())
    print("| stage | CPU [s] |\n|---|---|")
    for name, spent in rows.items():
        print(f"| {name} | {spent:.3g} |")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
