"""The command line: each verb is a call of one workflow function.

Exit status: 0 done, 1 done but not converged, or with --strict not adequate, 2 the input or the call is wrong, 70 a
mistake in this package; 128 and the number of the signal where one ended it, see `sma_bayes.interruption`.
"""

from __future__ import annotations

import json
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer

from sma_bayes import __version__
from sma_bayes.account import Account
from sma_bayes.errors import SmaBayesError
from sma_bayes.interruption import ending_in_order, interrupted
from sma_bayes.limits import SEED
from sma_bayes.progress import LINE_S, log_lines

T = TypeVar("T")

MISTAKE = 70
"""Exit status besides 0, 1 and 2, as sysexits.h has it; `sma_bayes.interruption` has those of signals."""

app = typer.Typer(
    name="sma-bayes",
    help="Bayesian stiffness of shape memory alloy springs: posteriors, credible bands, correlation factors.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Seed = Annotated[int, typer.Option(help="Decides every draw.", min=0, max=int(SEED.value))]
Jobs = Annotated[int | None, typer.Option(help="Processes; by default one for each core.", min=1)]
Priors = Annotated[
    str | None,
    typer.Option(help="Priors: the name of a shipped set, or a TOML file; those of the model by default."),
]
Model = Annotated[
    str,
    typer.Option(
        help="Response model: 'sma-bayes priors --list' names them; 'auto' takes the best supported of a ladder.",
        metavar="NAME",
    ),
]
Noise = Annotated[
    str, typer.Option(help="Noise model, or 'auto': chosen from the residuals of the least-squares fit.")
]
PoolChoice = Annotated[
    str,
    typer.Option(help="'none': own A and B a condition; 'campaign': one set a branch for all conditions."),
]
Sampler = Annotated[
    str,
    typer.Option(help="'independence', or to cross-check it 'de' (differential evolution) or 'stretch'."),
]
Resume = Annotated[bool, typer.Option("--resume", help="Go on with the run that --out holds.")]
Strict = Annotated[bool, typer.Option("--strict", help="Exit status 1 also where a fit is not adequate.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no summary.")]
Verbose = Annotated[
    bool,
    typer.Option("--verbose", "-v", help="Every step as a log line on standard error, in place of a bar."),
]
Json = Annotated[bool, typer.Option("--json", help="The summary as JSON on standard output.")]
Data = Annotated[
    Path | None, typer.Option(help="Folder of the data files, where it is not the campaign file's own.")
]
Extrapolate = Annotated[
    float, typer.Option(help="How far bands go beyond the observed temperatures; marked there.", min=0.0)
]
Arranged = Annotated[
    str | None,
    typer.Option(
        help="Bias spring, Eq. (8): 'published_difference', 'parallel' or 'series'; none by default."
    ),
]
Bias = Annotated[float | None, typer.Option(help="Stiffness of the bias spring [N/m]; 130 by default.")]
BiasSd = Annotated[
    float | None,
    typer.Option(help="Standard deviation of that stiffness [N/m]; 6.5 by default."),
]
Source = Annotated[
    Path, typer.Argument(metavar="PATH", help="Campaign folder, campaign.toml, or a data file.")
]
Figures = Annotated[
    str,
    typer.Option(
        help="'report': those that the report shows; 'all': diagnostics of each condition and record too; "
        "'none': no report either."
    ),
]
NoFigures = Annotated[bool, typer.Option("--no-figures", help="The same as --figures none.")]
Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Dask scheduler, such as tcp://head:8786, whose workers do the tasks instead of processes here.",
    ),
]


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"sma-bayes {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[
        bool, typer.Option("--version", "-V", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Common to all verbs."""


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("sma-bayes-demo"),
    seed: Seed = 0,
    jobs: Jobs = None,
    noise: Noise = "auto",
    figures: Figures = "report",
    no_figures: NoFigures = False,
    scheduler: Scheduler = None,
    resume: Resume = False,
    strict: Strict = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    as_json: Json = False,
) -> None:
    """Run the main job on a twin of the published campaign: 18 records, no other file, no network."""
    from sma_bayes.paper.twin import twin_campaign
    from sma_bayes.studies.fit.terminal import show_fit
    from sma_bayes.studies.fit.workflow import fit_campaign
    from sma_bayes.studies.identity import is_run_of

    read = partial(twin_campaign, seed)
    with _working_on(read, scheduler, jobs, quiet or as_json, verbose) as (campaign, shared):
        summary = fit_campaign(
            campaign,
            out,
            seed=seed,
            noise=noise,
            resume=resume or is_run_of(out, campaign),
            figures="none" if no_figures else figures,
            **shared,
        )
    _finish(summary, quiet, as_json, lambda: show_fit(summary, out), strict=strict)


@app.command()
def init(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder with data files.")],
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Write a campaign.toml for a folder of data files, with all guesses marked; nothing is overwritten."""
    from sma_bayes.records.starting_file import start_campaign
    from sma_bayes.studies.init.terminal import show_start

    found = start_campaign(folder)
    if as_json:
        typer.echo(json.dumps(found, indent=1))
    elif not quiet:
        show_start(found)


@app.command()
def inspect(
    path: Source,
    data: Data = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Show what was read: channels, units, conditions, cycles, branches, noise, findings."""
    from sma_bayes.records.campaign import read_campaign
    from sma_bayes.studies.inspect.terminal import show_inspection
    from sma_bayes.studies.inspect.workflow import inspect_campaign

    report = inspect_campaign(read_campaign(path, data_dir=data))
    if as_json:
        typer.echo(json.dumps(report, indent=1))
    elif not quiet:
        show_inspection(report)


@app.command()
def priors(
    model: Annotated[
        str, typer.Argument(help="Name of a response model, or of a shipped set.")
    ] = "modified_sigmoid",
    list_all: Annotated[bool, typer.Option("--list", help="List all of them.")] = False,
) -> None:
    """Print the priors in force as TOML, to edit and pass back with --priors FILE."""
    from sma_bayes.parameters.priors_file import shipped_priors
    from sma_bayes.response import RESPONSE_MODELS, priors_named

    if list_all:
        for name in sorted({*shipped_priors(), *RESPONSE_MODELS}):
            typer.echo(f"{name}: {priors_named(name).title}")
        return
    typer.echo(priors_named(model).whole_text, nl=False)


@app.command()
def fit(
    path: Source,
    out: Annotated[Path, typer.Option(help="Folder for the results: new or empty, or --resume.")],
    data: Data = None,
    seed: Seed = 0,
    jobs: Jobs = None,
    model: Model = "modified_sigmoid",
    priors: Priors = None,
    noise: Noise = "auto",
    pool: PoolChoice = "none",
    sampler: Sampler = "independence",
    extrapolate: Extrapolate = 0.0,
    arrangement: Arranged = None,
    bias: Bias = None,
    bias_sd: BiasSd = None,
    figures: Figures = "report",
    no_figures: NoFigures = False,
    scheduler: Scheduler = None,
    resume: Resume = False,
    strict: Strict = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    as_json: Json = False,
) -> None:
    """Warm start, ensembles, diagnostics, bands, correlation factors, report."""
    from sma_bayes.records.campaign import read_campaign
    from sma_bayes.studies.fit.terminal import show_fit
    from sma_bayes.studies.fit.workflow import fit_campaign
    from sma_bayes.studies.options import bias_spring, pool_named

    read = partial(read_campaign, path, data_dir=data)
    with _working_on(read, scheduler, jobs, quiet or as_json, verbose) as (campaign, shared):
        summary = fit_campaign(
            campaign,
            out,
            seed=seed,
            noise=noise,
            model=model,
            priors=priors,
            pool=pool_named(pool),
            sampler=sampler,
            extrapolate=extrapolate,
            bias=bias_spring(arrangement, bias, bias_sd),
            resume=resume,
            figures="none" if no_figures else figures,
            **shared,
        )
    _finish(summary, quiet, as_json, lambda: show_fit(summary, out), strict=strict)


@app.command()
def gap(
    path: Source,
    out: Annotated[Path, typer.Option(help="Folder for the results: new or empty, or --resume.")],
    data: Data = None,
    seed: Seed = 0,
    jobs: Jobs = None,
    model: Model = "modified_sigmoid",
    priors: Priors = None,
    noise: Annotated[
        str, typer.Option(help="Only 'auto': the study estimates the noise by itself.")
    ] = "auto",
    pool: PoolChoice = "none",
    figures: Figures = "report",
    no_figures: NoFigures = False,
    scheduler: Scheduler = None,
    resume: Resume = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    as_json: Json = False,
) -> None:
    """Find where model and measurement disagree, name what is missing, add it, and show the gap shrink."""
    from sma_bayes.records.campaign import read_campaign
    from sma_bayes.studies.gap.terminal import show_gap
    from sma_bayes.studies.gap.workflow import study_gap
    from sma_bayes.studies.options import pool_named

    read = partial(read_campaign, path, data_dir=data)
    with _working_on(read, scheduler, jobs, quiet or as_json, verbose, tasks=False) as (campaign, shared):
        found = study_gap(
            campaign,
            out,
            seed=seed,
            noise=noise,
            model=model,
            priors=priors,
            pool=pool_named(pool),
            resume=resume,
            figures="none" if no_figures else figures,
            **shared,
        )
    _finish(found, quiet, as_json, lambda: show_gap(found, out))


@app.command()
def compare(
    path: Source,
    out: Annotated[Path, typer.Option(help="Folder for the results: new or empty, or --resume.")],
    data: Data = None,
    seed: Seed = 0,
    jobs: Jobs = None,
    model: Model = "modified_sigmoid",
    priors: Priors = None,
    noise: Annotated[
        str,
        typer.Option(help="Noise model of all models, or 'auto': chosen by evidence for each record."),
    ] = "auto",
    pool: PoolChoice = "none",
    figures: Figures = "report",
    no_figures: NoFigures = False,
    scheduler: Scheduler = None,
    resume: Resume = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    as_json: Json = False,
) -> None:
    """Compare the modified sigmoid with the logistic and polynomial baselines, on what was held out too."""
    from sma_bayes.records.campaign import read_campaign
    from sma_bayes.report.screen import show_text
    from sma_bayes.studies.compare.terminal import comparison_text
    from sma_bayes.studies.compare.workflow import compare as compare_campaign
    from sma_bayes.studies.options import pool_named

    read = partial(read_campaign, path, data_dir=data)
    with _working_on(read, scheduler, jobs, quiet or as_json, verbose) as (campaign, shared):
        found = compare_campaign(
            campaign,
            out,
            seed=seed,
            noise=noise,
            model=model,
            priors=priors,
            pool=pool_named(pool),
            resume=resume,
            figures="none" if no_figures else figures,
            **shared,
        )
    _finish(found, quiet, as_json, lambda: show_text(comparison_text(found), found, out))


@app.command()
def ask(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder that fit or demo has written.")],
    at: Annotated[
        list[str] | None,
        typer.Option(help="A temperature, such as '60 degC', at which to tell everything; may be repeated."),
    ] = None,
    unit: Annotated[
        list[str] | None,
        typer.Option(help="Unit of the answer to --at, such as 'N/mm', for what it suits; may be repeated."),
    ] = None,
    stiffness: Annotated[
        str | None, typer.Option("--stiffness", "--modulus", help="Wanted stiffness, such as '130 N/m'.")
    ] = None,
    force: Annotated[
        str | None, typer.Option("--force", "--stress", help="Wanted force, such as '2.5 N'.")
    ] = None,
    displacement: Annotated[
        str | None, typer.Option("--displacement", "--strain", help="Wanted displacement, such as '12 mm'.")
    ] = None,
    overall_stiffness: Annotated[
        str | None,
        typer.Option(help="Wanted stiffness together with the bias spring of `fit --arrangement`."),
    ] = None,
    tolerance: Annotated[str, typer.Option(help="How far off it may be: '5 %' or '4 N/m'.")] = "5 %",
    probability: Annotated[float, typer.Option(help="With which it is to be met.")] = 0.9,
    condition: Annotated[str | None, typer.Option(help="Only this condition.")] = None,
    branch: Annotated[str | None, typer.Option(help="Only 'heating' or 'cooling'.")] = None,
    extrapolate: Annotated[
        float, typer.Option(help="How far to search beyond the measured temperatures; marked there.", min=0.0)
    ] = 0.0,
    temperature_sd: Annotated[
        float, typer.Option(help="Standard deviation of the error of the controller's temperature.", min=0.0)
    ] = 0.0,
    temperature_unit: Annotated[
        str | None,
        typer.Option(help="Unit of temperatures, asked and answered, such as degF; that of the fit."),
    ] = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Tell what a temperature gives, or which temperatures give a wanted value, and how surely."""
    from sma_bayes.studies.ask.terminal import answer_text, show_values_at
    from sma_bayes.studies.ask.workflow import ask as ask_folder

    found = ask_folder(
        folder,
        at=at,
        unit=unit,
        stiffness=stiffness,
        force=force,
        displacement=displacement,
        overall_stiffness=overall_stiffness,
        tolerance=tolerance,
        probability=probability,
        condition=condition,
        branch=branch,
        extrapolate=extrapolate,
        temperature_sd=temperature_sd,
        temperature_unit=temperature_unit,
    )
    show = partial(show_values_at, found) if at else lambda: typer.echo(answer_text(found))
    _finish(found, quiet, as_json, show)


@app.command()
def diff(
    a: Annotated[Path, typer.Argument(metavar="A", help="Folder that fit or demo has written.")],
    b: Annotated[Path, typer.Argument(metavar="B", help="Another one.")],
    tolerance: Annotated[
        float, typer.Option(help="Up to how many standard deviations medians may differ and be the same.")
    ] = 0.25,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Compare two fits: what went in differently, how far results are apart; exit status 1 if they differ."""
    from sma_bayes.studies.diff.terminal import show_diff
    from sma_bayes.studies.diff.workflow import diff as diff_folders

    found = diff_folders(a, b, tolerance=tolerance)
    if as_json:
        typer.echo(json.dumps(found, indent=1))
    elif not quiet:
        show_diff(found)
    if not found["same"]:
        raise typer.Exit(1)


@app.command()
def conditions(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder that fit or demo has written.")],
    out: Annotated[Path, typer.Option(help="Folder for the results: new or empty, or --resume.")],
    at: Annotated[
        list[str] | None,
        typer.Option(help="A condition to predict, such as current_A=2.2,load_g=150; may be repeated."),
    ] = None,
    leave_out: Annotated[
        list[str] | None,
        typer.Option(
            help="A condition to leave out and predict from the others, or 'each'; may be repeated."
        ),
    ] = None,
    scatter: Annotated[
        float,
        typer.Option(
            help="Scatter between conditions to expect, as a share of span, rate and width of a curve."
        ),
    ] = 0.1,
    model: Annotated[
        str | None,
        typer.Option(
            help="Response model that the fit must have been made with; 'auto': the one that all records together "
            "support best, fitted again where the fit has another; any by default.",
            metavar="NAME",
        ),
    ] = None,
    seed: Seed = 0,
    jobs: Jobs = None,
    figures: Figures = "report",
    no_figures: NoFigures = False,
    scheduler: Scheduler = None,
    resume: Resume = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    as_json: Json = False,
) -> None:
    """Tell what current, load, frequency and duty cycle do, and predict conditions that were not measured."""
    from sma_bayes.report.screen import show_text
    from sma_bayes.studies.conditions.terminal import conditions_text
    from sma_bayes.studies.conditions.workflow import study_conditions

    with _workers(scheduler, jobs), _progress(quiet or as_json, verbose) as progress:
        found = study_conditions(
            folder,
            out,
            at=at or (),
            leave_out=leave_out or (),
            scatter=scatter,
            model=model,
            seed=seed,
            jobs=jobs,
            resume=resume,
            figures="none" if no_figures else figures,
            progress=progress,
        )
    _finish(found, quiet, as_json, lambda: show_text(conditions_text(found), found, out))


@app.command()
def run(
    study: Annotated[Path, typer.Argument(metavar="STUDY.toml", help="Campaign, folder and steps.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder for the results, in place of the declared one.")
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(help="Processes, in place of the declared number.", min=1)
    ] = None,
    scheduler: Scheduler = None,
    resume: Resume = False,
    strict: Strict = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    as_json: Json = False,
) -> None:
    """Run all that a study file declares: fit, compare, gap, conditions, questions, each in a folder of its own."""
    from sma_bayes.studies.run.terminal import study_text
    from sma_bayes.studies.run.workflow import run_study

    with _workers(scheduler, jobs), _progress(quiet or as_json, verbose, tasks=False) as progress:
        found = run_study(study, out=out, jobs=jobs, resume=resume, strict=strict or None, progress=progress)
    _finish(found, quiet, as_json, lambda: typer.echo(study_text(found)))


@app.command()
def report(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder that fit, gap, compare or conditions has written.")
    ],
    figures: Figures = "report",
    formats: Annotated[
        str, typer.Option("--format", help="Of the figures: 'pdf', 'svg', 'png', or several: 'pdf,svg'.")
    ] = "pdf,png",
    workbook: Annotated[
        bool, typer.Option("--workbook", help="All tables as tables/results.xlsx too, a sheet a table.")
    ] = False,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Rebuild the HTML report, figures and LaTeX tables from what a folder holds."""
    from sma_bayes.studies.report.build import build_report

    with _workers(scheduler, jobs), _progress(quiet, verbose) as progress:
        build_report(
            folder,
            figures=figures,
            formats=formats.split(","),
            workbook=workbook,
            jobs=jobs,
            progress=progress,
        )
    if not quiet:
        typer.echo(f"report: {folder / 'report.html'}")


@app.command()
def paper(
    errata: Annotated[bool, typer.Option("--errata", help="The errata only, without the tables.")] = False,
    table: Annotated[
        int | None, typer.Option(help="One table and its errata; 0 is the running text.", min=0)
    ] = None,
    form: Annotated[str, typer.Option("--format", help="text, csv, json, latex or markdown.")] = "text",
    out: Annotated[Path | None, typer.Option(help="Folder for files, one a table.")] = None,
    page: Annotated[
        Path | None,
        typer.Option(help="Folder for the page that puts every table and claim to the test; takes minutes."),
    ] = None,
    seed: Annotated[
        int, typer.Option(help="Of the page: decides the twin and every draw.", min=0, max=int(SEED.value))
    ] = 0,
    jobs: Jobs = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Show the paper's printed tables and their errata, printed and corrected side by side; or reproduce it."""
    if page is not None:
        if errata or table is not None or out is not None or form != "text":
            raise SmaBayesError(
                "--page together with --errata, --table, --format or --out",
                expected="--page by itself: it writes the whole page",
                remedy="give two commands",
            )
        _reproduce(page, seed, jobs, quiet, verbose)
        return
    from sma_bayes.paper.export import render, select, write

    selection = select(table, errata_only=errata)
    if out is None:
        typer.echo(render(selection, form), nl=False)
        return
    for path in write(selection, out, form):
        typer.echo(str(path))


def _reproduce(folder: Path, seed: int, jobs: int | None, quiet: bool, verbose: bool) -> None:
    from sma_bayes.studies.paper.build import NUMBERS, PAGE, reproduce_paper

    with _progress(quiet, verbose, tasks=False) as progress:
        found = reproduce_paper(folder, seed=seed, jobs=jobs, progress=progress)
    if not quiet:
        for claim in found["claims"]:
            typer.echo(f"{claim['verdict']}: {claim['claim']}")
        typer.echo(f"page: {folder / PAGE}, numbers: {folder / NUMBERS}")
    if not found["converged"]:
        raise typer.Exit(1)


def main() -> None:
    """Run the command line, and turn the user's mistakes into one message and exit status 2."""
    try:
        app(prog_name="sma-bayes", standalone_mode=True)
    except Exception as error:
        if interrupted():  # then it follows from that
            raise
        told = error if isinstance(error, SmaBayesError) else _of_the_system(error)
        if told is not None:
            print(f"error: {told}", file=sys.stderr)
            sys.exit(2)
        traceback.print_exc()  # Python's own status for it, 1, would say that the run did not converge
        print("error: this is a mistake in sma_bayes, please report the lines above", file=sys.stderr)
        sys.exit(MISTAKE)


def _of_the_system(error: Exception) -> SmaBayesError | None:
    """What the system could not give: a file that can't be used, or memory."""
    if isinstance(error, MemoryError):
        return SmaBayesError(
            "there is not enough memory" + (f" ({error})" if str(error) else ""),
            expected="room for all data and draws",
            remedy="give less data at a time, a smaller --jobs, or a machine with more memory",
        )
    if isinstance(error, OSError) and error.filename is not None:
        name = str(error.filename)
        return SmaBayesError(
            f"can't be used: {error.strerror}",
            file=name if len(name) <= 200 else f"{name[:100]}...",
            expected="a file or folder that this user may read, or write where results go",
            remedy="check path and permissions",
        )
    return None


@contextmanager
def _working_on(
    read: Callable[[], T],
    scheduler: str | None,
    jobs: int | None,
    silent: bool,
    verbose: bool,
    *,
    tasks: bool = True,
) -> Iterator[tuple[T, dict[str, Any]]]:
    """What `read` gives, and what says to all that is done with it where, to whom to tell and on which account."""
    account = Account()
    with _workers(scheduler, jobs), _progress(silent, verbose, tasks=tasks) as progress:
        with account.timed("read"):
            campaign = read()
        yield campaign, {"jobs": jobs, "progress": progress, "account": account}


@contextmanager
def _workers(scheduler: str | None, jobs: int | None) -> Iterator[None]:
    """Where tasks are done: on processes of this machine, or on the cluster of a scheduler."""
    if scheduler is None:
        yield
        return
    if jobs is not None:
        raise SmaBayesError(
            f"--scheduler {scheduler} and --jobs {jobs}",
            expected="one of the two: a cluster has as many workers as were started",
            remedy="leave one of them out",
        )
    from sma_bayes.runs.jobs import cluster

    with cluster(scheduler):
        yield


@contextmanager
def _progress(
    silent: bool, verbose: bool, *, tasks: bool = True
) -> Iterator[Callable[[int, int, str], None] | None]:
    """A progress bar on standard error; log lines where that is not a terminal, or where every step is wanted."""
    if silent and not verbose:
        yield None
        return
    if verbose or not sys.stderr.isatty():
        with log_lines(0.0 if verbose else LINE_S, tasks=tasks) as lines:
            yield lines
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns: list[ProgressColumn] = [TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn()]
    columns += [TimeElapsedColumn(), *([TextColumn("left"), TimeRemainingColumn()] if tasks else [])]
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("reading", total=None)

        def tell(done: int, total: int, message: str) -> None:
            bar.update(task, completed=done, total=total, description=message[:60])

        yield tell


def _finish(
    summary: dict[str, Any], quiet: bool, as_json: bool, show: Callable[[], None], *, strict: bool = False
) -> None:
    """Tell what was found as JSON, for people or not at all; end with its exit status.

    It is 1 where it has not converged, and with `strict` where it is not adequate.
    """
    if as_json:
        from sma_bayes.runs.store import plain

        typer.echo(json.dumps(plain(summary), indent=1))
    elif not quiet:
        show()
    good = summary["converged"] and (summary["adequate"] if strict else True)
    status = summary.get("exit_status", 0 if good else 1)
    if status:
        raise typer.Exit(status)


if __name__ == "__main__":
    with ending_in_order():
        main()
