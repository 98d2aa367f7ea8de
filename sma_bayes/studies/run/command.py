"""The verb `run` on the command line."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sma_bayes.studies.command_execution import finish, progress_shown, workers
from sma_bayes.studies.command_options import Json, Quiet, Resume, Scheduler, Strict, Verbose


def command(
    study: Annotated[
        Path, typer.Argument(metavar="STUDY.toml", help="Study file: campaign, folder and steps.")
    ],
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
    """Run all that a study file declares, fit, compare, gap and what starts from them, each in its own folder."""
    from sma_bayes.studies.run.terminal import failures, study_text
    from sma_bayes.studies.run.workflow import run_study

    with workers(scheduler, jobs), progress_shown(quiet or as_json, verbose, tasks=False) as progress:
        found = run_study(study, out=out, jobs=jobs, resume=resume, strict=strict or None, progress=progress)
    if quiet or as_json:
        for message in failures(found):
            typer.echo(message, err=True)
    finish(found, quiet, as_json, lambda: typer.echo(study_text(found)))
