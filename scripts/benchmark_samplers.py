r"""Time this package and other samplers to the same target on the same posteriors.

    taskset -c 1 python scripts/benchmark_samplers.py run --records all --channels FX --limit 200 \
        --samplers sma_bayes,emcee,lmfit --walkers 32 --start ball --log-prob package --out benchmark
    python scripts/benchmark_samplers.py run --records all --channels FX --limit 20 \
        --samplers sma_bayes,blackjax,emcee-de,nutpie,emcee-vectorised --repeats 3 --out peers
    python scripts/benchmark_samplers.py table benchmark

The first is how the first table in docs/performance.md was measured, the second how that of other samplers was, with
`--records 1A-10mHz-heating --points 100` for one record; the third prints medians, ranges and ratios.

The target: R-hat at most 1.01 across four independent ensembles, bulk and tail effective sample size at least 1000
in every parameter, by the package's own functions. Needs the extra `bench`. What is timed and what is not stands
in docs/performance.md.
"""

from __future__ import annotations

import csv
import json
import os
import platform
import subprocess
import sys
import time
from collections.abc import Iterable
from dataclasses import asdict, fields, replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
os.environ.update(dict.fromkeys(THREADS, "1"))  # before numpy is loaded; threadpoolctl sees to it once more
os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"

import numpy as np  # noqa: E402
import typer  # noqa: E402
from benchmark.measure import TARGET, Row, Task, measure, prepare  # noqa: E402
from benchmark.problems import Case, Problem  # noqa: E402
from benchmark.progress import Settings  # noqa: E402
from benchmark.samplers import SAMPLERS  # noqa: E402
from benchmark.summary import Line, as_json, case_of, summarise  # noqa: E402
from rich.console import Console  # noqa: E402
from rich.table import Table  # noqa: E402
from threadpoolctl import threadpool_limits  # noqa: E402

SCHEMA = "sma-bayes/benchmark/1"

app = typer.Typer(add_completion=False, help=__doc__, rich_markup_mode=None)
console = Console()


@app.command()
def run(
    out: Annotated[
        Path, typer.Option(help="Folder for raw timings (samplers.csv, machine.json); rows are added.")
    ],
    records: Annotated[
        str, typer.Option(help="all, a number of records spread evenly over the 18, or keys of records.")
    ] = "all",
    channels: Annotated[str, typer.Option(help="S, FX or FXS.")] = "FX",
    points: Annotated[int, typer.Option(help="Samples of each record; 0 for as many as the demo has.")] = 0,
    noise: Annotated[str, typer.Option(help="independent or ar1.")] = "independent",
    samplers: Annotated[str, typer.Option(help="Comma-separated list of: " + ", ".join(SAMPLERS))] = ",".join(
        SAMPLERS
    ),
    repeats: Annotated[
        int, typer.Option(help="Runs of each sampler on each record, in alternating order.")
    ] = 1,
    limit: Annotated[
        float, typer.Option(help="Seconds of processor time after which a sampler is given up on a record.")
    ] = 60.0,
    walkers: Annotated[int, typer.Option(help="Walkers of each ensemble of the other samplers.")] = 100,
    start: Annotated[
        str, typer.Option(help="laplace or ball: where walkers of other samplers start.")
    ] = "laplace",
    log_prob: Annotated[
        str, typer.Option(help="written or package: what samplers that ask for one point at a time call.")
    ] = "written",
    cold: Annotated[bool, typer.Option(help="Fresh processes, timed from their start.")] = False,
) -> None:
    """Measure."""
    case = Case(channels, noise, points or None)
    settings = Settings(walkers, start, log_prob)
    session = time.strftime("%Y-%m-%dT%H:%M:%S")
    names = samplers.split(",")
    _describe(out)
    measured = case.records()
    with threadpool_limits(limits=1):
        chosen = _chosen(records, [record.key for record in measured])
        names = _ready(names, Problem.of(measured[chosen[0]], noise), settings, cold)
        for index in chosen:
            problem = Problem.of(measured[index], noise)
            for repeat in range(repeats):
                order = names if repeat % 2 == 0 else names[::-1]
                for place, name in enumerate(order):
                    task = Task(session, case, index, name, settings, repeat, place, limit)
                    row = _fresh(task) if cold else measure(task, problem)
                    _append(out / "samplers.csv", row)
                    _tell(row)


def _ready(names: list[str], problem: Problem, settings: Settings, cold: bool) -> list[str]:
    """Samplers that are installed; what they can share is compiled, unless they are measured cold."""
    ready = []
    for name in names:
        missing = [p for p in SAMPLERS[name].packages if not _installed(p)]
        if missing:
            console.print(f"{name}: not measured, not installed: {', '.join(missing)}", highlight=False)
            continue
        if not cold:
            prepare(name, problem, settings)
        ready.append(name)
    return ready


def _installed(package: str) -> bool:
    try:
        version(package)
    except PackageNotFoundError:
        return False
    return True


def _chosen(records: str, keys: list[str]) -> list[int]:
    if records == "all" or records.isdecimal():
        count = len(keys) if records == "all" else int(records)
        return list(dict.fromkeys(np.linspace(0, len(keys) - 1, count).round().astype(int).tolist()))
    unknown = set(records.split(",")) - set(keys)
    if unknown:
        raise typer.BadParameter(f"no record {', '.join(sorted(unknown))}; there are {', '.join(keys)}")
    return [keys.index(key) for key in records.split(",")]


@app.command(hidden=True)
def one(task: str, began: float) -> None:
    """One run in a fresh process, started at `began`; prints its row."""
    asked = Task.read(task)
    with threadpool_limits(limits=1):
        problem = asked.problem()
        ready, ready_cpu = time.time() - began, time.process_time()
        row = measure(asked, problem)
    row = replace(
        row,
        kind="cold",
        claimed_s=ready + row.claimed_s,
        wall_s=ready + row.wall_s,
        cpu_s=ready_cpu + row.cpu_s,
    )
    print(json.dumps(asdict(row)))


def _fresh(task: Task) -> Row:
    command = [sys.executable, str(Path(__file__).resolve()), "one", task.write(), str(time.time())]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return Row(**json.loads(done.stdout.splitlines()[-1]))


def _tell(row: Row) -> None:
    doubt = "" if row.reached else " TARGET NOT REACHED"
    if row.claimed_s < row.wall_s:
        doubt += f" seemed converged at {row.claimed_s:.3f} s, on another posterior"
    console.print(
        f"{row.record} {row.sampler} {row.kind} repeat {row.repeat}: {row.wall_s:.3f} s, CPU {row.cpu_s:.3f} s"
        f"{doubt} (R-hat {row.rhat:.4f}, ESS {row.ess_bulk:.0f} {row.ess_tail:.0f})",
        highlight=False,
        soft_wrap=True,
    )


def _describe(out: Path) -> None:
    """Write down the machine, or see that it is still the same."""
    path = out / "machine.json"
    now = {"machine": machine(), "versions": versions()}
    out.mkdir(parents=True, exist_ok=True)
    if not path.exists():
        path.write_text(json.dumps(now, indent=1) + "\n", encoding="utf-8")
    elif json.loads(path.read_text(encoding="utf-8")) != now:
        raise typer.BadParameter(f"{path} tells of another machine or other versions; choose another --out")


def _append(path: Path, row: Row) -> None:
    new = not path.exists()
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [f.name for f in fields(Row)])
        if new:
            writer.writeheader()
        writer.writerow({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in asdict(row).items()})


@app.command()
def table(
    folder: Annotated[Path, typer.Argument(help="Folder that `run` wrote to.")],
    write_json: Annotated[
        Path | None, typer.Option("--json", help="Where to write rows, summary, machine and versions.")
    ] = None,
    markdown: Annotated[bool, typer.Option(help="Print tables for a Markdown document.")] = False,
) -> None:
    """Print medians, ranges and ratios."""
    with (folder / "samplers.csv").open(newline="", encoding="utf-8") as file:
        rows = [Row.parse(row) for row in csv.DictReader(file)]
    lines = summarise(rows)
    for case in dict.fromkeys(map(case_of, lines)):
        kind, channels, noise, length = case
        title = f"{channels}, {noise} noise, {length} points, {kind}"
        (_print_markdown if markdown else _print_table)(title, [x for x in lines if case_of(x) == case])
    if write_json is not None:
        document = {
            "schema": SCHEMA,
            "target": {"rhat": TARGET.rhat, "ess": TARGET.ess},
            **json.loads((folder / "machine.json").read_text(encoding="utf-8")),
            "summary": [as_json(line) for line in lines],
            "rows": [as_json(row) for row in rows],
        }
        write_json.write_text(json.dumps(document, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def machine() -> dict[str, object]:
    """Cores, memory and kind of this machine."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return {
        "system": platform.platform(),
        "processor": platform.machine(),
        "cores": os.cpu_count(),
        "memory_GiB": round(memory / 2**30, 1),
        "blas_threads": 1,
        "processes": 1,
    }


def versions() -> dict[str, str]:
    """Versions of Python and of every package whose speed is measured."""
    packages = {"numpy", "scipy"}.union(*(s.packages for s in SAMPLERS.values()))
    return {
        "python": platform.python_version(),
        **{name: version(name) for name in sorted(packages) if _installed(name)},
    }


HEADER = (
    "sampler",
    "walkers, start, density",
    "reached",
    "CPU s a record",
    "sum [s]",
    "ratio",
    "by the clock",
    "evaluations",
    "ESS/CPU s",
    "too early",
    "greatest error",
)


def _cells(line: Line) -> tuple[str, ...]:
    spread = f" ({line.ratio_low:.3g}-{line.ratio_high:.3g})" if line.ratio_high > line.ratio_low else ""
    own = line.sampler == "sma_bayes"
    return (
        SAMPLERS[line.sampler].title,
        "own" if own else ", ".join([str(line.walkers), line.start, line.log_prob]),
        f"{line.reached} of {line.runs}",
        f"{line.median_s:.3g} ({line.low_s:.3g}-{line.high_s:.3g})",
        f"{line.bound}{line.total_s:.3g} / {line.records} records",
        "1" if own else f"{line.bound}{line.ratio:.3g}{spread}",
        "1" if own else f"{line.bound}{line.wall_ratio:.3g}",
        f"{line.evaluations:.0f}",
        f"{line.ess_per_s:.3g}",
        f"{line.early}",
        f"{line.mean_shift:.2f} sd, {100 * line.sd_off:.1f} %" if line.reached else "-",
    )


def _print_table(title: str, lines: Iterable[Line]) -> None:
    printed = Table(title=title)
    for name in HEADER:
        printed.add_column(name)
    for line in lines:
        printed.add_row(*_cells(line))
    console.print(printed)


def _print_markdown(title: str, lines: Iterable[Line]) -> None:
    print(f"\n**{title}**\n\n| {' | '.join(HEADER)} |\n|{'---|' * len(HEADER)}")
    for line in lines:
        print(f"| {' | '.join(_cells(line))} |")


if __name__ == "__main__":
    app()
