"""The verb `watch` on the command line."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from sma_bayes.studies.command_execution import finish, progress_shown
from sma_bayes.studies.command_options import Figures, Json, NoFigures, Quiet, Seed, Verbose


def command(
    results: Annotated[Path, typer.Argument(metavar="RESULTS", help="Folder that fit has written.")],
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="FILE...", help="Files of new cycles, in the order in which they were measured."
        ),
    ] = None,
    folder: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Take the files of a folder, and wait for more until there is an alarm."
        ),
    ] = None,
    idle: Annotated[
        float | None,
        typer.Option(help="With --folder: end after so many seconds without a new file.", min=0.0),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for the results; a watch that it holds goes on. Needed with --folder."),
    ] = None,
    condition: Annotated[
        str | None, typer.Option(help="Condition of the new cycles, where the fit has several.")
    ] = None,
    limit: Annotated[
        list[str] | None,
        typer.Option(
            help="Tell the cycles that remain until 'stroke=-20%' or 'stiffness@60 degC=500 N/m'; may be repeated."
        ),
    ] = None,
    alpha: Annotated[
        float, typer.Option(help="Greatest probability that a false alarm is ever given.")
    ] = 0.01,
    campaign: Annotated[
        Path | None,
        typer.Option(help="Campaign file by which new files are read; that of the fit by default."),
    ] = None,
    seed: Seed = 0,
    figures: Figures = "report",
    no_figures: NoFigures = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    as_json: Json = False,
) -> None:
    """Tell whether a spring is still the one that was fitted, from cycles measured since; exit status 1 if not."""
    from sma_bayes.errors import SmaBayesError
    from sma_bayes.report.screen import screen
    from sma_bayes.studies.watch.folder import watch_folder
    from sma_bayes.studies.watch.terminal import show_watch
    from sma_bayes.studies.watch.workflow import watching

    if idle is not None and folder is None:
        raise SmaBayesError(
            "--idle without --folder",
            expected="--folder DIR, whose new files are waited for",
            remedy="leave --idle out: named files are read and not waited for",
        )
    with progress_shown(quiet or as_json or folder is not None, verbose) as progress:
        asked = partial(
            watching, results, out, condition=condition, limit=limit or (), alpha=alpha, campaign=campaign, seed=seed,
            figures="none" if no_figures else figures, progress=progress,
        )  # fmt: skip
        if folder is not None:
            tell = None if quiet or as_json else screen().tell
            found = watch_folder(asked, folder, files or (), out, idle, tell)
        else:
            with asked() as opened:
                found = opened.take(files or ())
    finish(found, quiet, as_json, lambda: show_watch(found, out))
