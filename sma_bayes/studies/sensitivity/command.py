"""The verb `sensitivity` on the command line."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sma_bayes.studies.command_execution import finish, progress_shown, workers
from sma_bayes.studies.command_options import (
    Figures,
    Jobs,
    Json,
    NoFigures,
    Quiet,
    Resume,
    Scheduler,
    Seed,
    Verbose,
)


def command(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder that fit or demo has written.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder for the results: new or empty, or --resume; none by default.")
    ] = None,
    at: Annotated[
        list[str] | None,
        typer.Option(help="A temperature, such as '60 degC', at which stiffness is told; may be repeated."),
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
    """Tell what the numbers of a fit rest on: prior, data, single sweeps and readings."""
    from sma_bayes.studies.sensitivity.terminal import show_sensitivity
    from sma_bayes.studies.sensitivity.workflow import sensitivity

    with workers(scheduler, jobs), progress_shown(quiet or as_json, verbose) as progress:
        found = sensitivity(
            folder,
            out,
            at=at or (),
            seed=seed,
            jobs=jobs,
            resume=resume,
            figures="none" if no_figures else figures,
            progress=progress,
        )
    finish(found, quiet, as_json, lambda: show_sensitivity(found, out))
