r"""Time this package and other samplers to the same target on the same posteriors.

    run="taskset -c 1 python scripts/benchmark_samplers.py run"
    stock="--samplers emcee,lmfit --walkers 32 --start ball --log-prob package"
    $run --records all --limit 200 --samplers sma_bayes,emcee,lmfit --walkers 32 --start ball --log-prob package \
        --out docs/data/samplers.csv
    campaign="sma_bayes,blackjax,blackjax-tuned,emcee-de,nutpie,emcee-vectorised"
    $run --records all --limit 20 --samplers $campaign,numpyro --repeats 3 --out docs/data/campaign.csv
    $run --records all --limit 40 --samplers $campaign --start ball --unaided --repeats 3 --out docs/data/campaign.csv
    peers="--samplers sma_bayes,blackjax,blackjax-tuned,emcee-de,emcee-vectorised,zeus --out docs/data/peers.csv"
    others="--samplers numpyro,nutpie,pymc,dynesty,ultranest --out docs/data/others.csv"
    for channels in FX S; do for noise in independent ar1; do for points in 100 1000; do
        case="--records 1A-10mHz-heating --channels $channels --noise $noise --points $points --limit 30"
        $run $case $peers --repeats 3
        $run $case $others
        $run $case $stock --out docs/data/others.csv
    done; done; done
    case="--records 1A-10mHz-heating --points 100"
    $run $case --limit 300 --samplers dynesty,ultranest --replace --out docs/data/others.csv
    $run $case --limit 60 --cold $peers
    $run $case --limit 60 --cold --samplers numpyro,nutpie,pymc --out docs/data/others.csv
    python scripts/benchmark_tables.py docs/data

measures and prints the tables in docs/performance.md, from the first to the last. Rows are added to the file; with
`--replace` they take the place of earlier rows of the same sampler on the same record. A file holds rows of one
machine.

`table FILE` prints medians, ranges and ratios of any file of rows, by sessions.

The target: R-hat at most 1.01 across four independent ensembles, bulk and tail effective sample size at least 1000
in every parameter, by the package's own functions, from draws of the right posterior (see `benchmark.judgement`).
Every sampler runs in a process of its own, which is ended if it does not stop at the limit. Needs the extra `bench`.
What is timed and what is not stands in docs/performance.md.
"""

from __future__ import annotations

import json
import os
import platform
import time
from collections.abc import Iterable
from contextlib import ExitStack
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
os.environ.update(dict.fromkeys(THREADS, "1"))  # before numpy is loaded, here and in workers
os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"

import numpy as np  # noqa: E402
import typer  # noqa: E402
from benchmark.judgement import TARGET  # noqa: E402
from benchmark.measure import Task, measure_in, measure_in_fresh  # noqa: E402
from benchmark.problems import Case, Problem  # noqa: E402
from benchmark.progress import Settings  # noqa: E402
from benchmark.rows import OWN, Row, add_row, read_rows  # noqa: E402
from benchmark.samplers import SAMPLERS  # noqa: E402
from benchmark.summary import Line, as_json, summarise  # noqa: E402
from benchmark.workers import Worker  # noqa: E402
from rich.console import Console  # noqa: E402
from rich.table import Table  # noqa: E402

SCHEMA = "sma-bayes/benchmark/1"

app = typer.Typer(add_completion=False, help=__doc__, rich_markup_mode=None)
console = Console()


@app.command()
def run(
    out: Annotated[
        Path, typer.Option(help="CSV file for rows; machine and versions go beside it, to NAME-machine.json.")
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
    unaided: Annotated[
        bool,
        typer.Option(
            help="No oracle: other samplers stop at a look, and looks and the climb to the mode are timed."
        ),
    ] = False,
    replace: Annotated[
        bool, typer.Option(help="Drop earlier rows of the same sampler on the same record.")
    ] = False,
) -> None:
    """Measure."""
    if cold and unaided:
        raise typer.BadParameter("--cold and --unaided are not measured together; choose one")
    case = Case(channels, noise, points or None)
    settings = Settings(walkers, start, log_prob)
    session = time.strftime("%Y-%m-%dT%H:%M:%S")
    names = _installed_of(samplers.split(","))
    _describe(out)
    measured = case.records()
    with ExitStack() as open_workers:
        workers = {name: open_workers.enter_context(Worker()) for name in names}
        for index in _chosen(records, [record.key for record in measured]):
            problem = Problem.of(measured[index], noise)
            for repeat in range(repeats):
                order = names if repeat % 2 == 0 else names[::-1]
                for place, name in enumerate(order):
                    task = Task(session, case, index, name, settings, repeat, place, limit, unaided)
                    row = (
                        measure_in_fresh(task, problem) if cold else measure_in(workers[name], task, problem)
                    )
                    add_row(out, row, replace=replace)
                    _tell(row)


def _installed_of(names: list[str]) -> list[str]:
    """Samplers that are installed; the others are named."""
    unknown = set(names) - SAMPLERS.keys()
    if unknown:
        raise typer.BadParameter(f"no sampler {', '.join(sorted(unknown))}; there are {', '.join(SAMPLERS)}")
    missing = {name: [p for p in SAMPLERS[name].packages if not _installed(p)] for name in names}
    for name, packages in missing.items():
        if packages:
            console.print(f"{name}: not measured, not installed: {', '.join(packages)}", highlight=False)
    return [name for name, packages in missing.items() if not packages]


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


def _tell(row: Row) -> None:
    doubt = "" if row.reached else f" TARGET NOT REACHED ({row.ended})"
    if row.claimed_s < row.wall_s:
        doubt += f" seemed converged at {row.claimed_s:.3f} s, on another posterior"
    console.print(
        f"{row.record} {row.sampler} {row.kind} repeat {row.repeat}: {row.wall_s:.3f} s, CPU {row.cpu_s:.3f} s"
        f"{doubt} (R-hat {row.rhat:.4f}, ESS {row.ess_bulk:.0f} {row.ess_tail:.0f}, off {row.share_errors:.1f} se)",
        highlight=False,
        soft_wrap=True,
    )


def _machine_file(out: Path) -> Path:
    return out.with_name(f"{out.stem}-machine.json")


def _describe(out: Path) -> None:
    """Write down the machine, or see that it is still the same."""
    path = _machine_file(out)
    now = {"machine": machine(), "versions": versions()}
    out.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists():
        path.write_text(json.dumps(now, indent=1) + "\n", encoding="utf-8")
    elif json.loads(path.read_text(encoding="utf-8")) != now:
        raise typer.BadParameter(f"{path} tells of another machine or other versions; choose another --out")


@app.command()
def table(
    file: Annotated[Path, typer.Argument(help="CSV file that `run` wrote.")],
    write_json: Annotated[
        Path | None, typer.Option("--json", help="Where to write rows, summary, machine and versions.")
    ] = None,
    markdown: Annotated[bool, typer.Option(help="Print tables for a Markdown document.")] = False,
) -> None:
    """Print medians, ranges and ratios."""
    rows = read_rows(file)
    lines = summarise(rows)
    for case in dict.fromkeys(line.case for line in lines):
        kind, channels, noise, length = case
        title = f"{channels}, {noise} noise, {length} points, {kind}"
        (_print_markdown if markdown else _print_table)(title, [x for x in lines if x.case == case])
    if write_json is not None:
        document = {
            "schema": SCHEMA,
            "target": {"rhat": TARGET.rhat, "ess": TARGET.ess},
            **json.loads(_machine_file(file).read_text(encoding="utf-8")),
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
    own = line.sampler == OWN
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
