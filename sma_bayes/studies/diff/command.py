"""The verb `diff` on the command line."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from sma_bayes.studies.command_execution import show_found
from sma_bayes.studies.command_options import Json, Quiet


def command(
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
    from sma_bayes.studies.diff.workflow import diff

    found = diff(a, b, tolerance=tolerance, declared=not as_json)
    show_found(found, quiet, as_json, partial(show_diff, found))
    if not found["same"]:
        raise typer.Exit(1)
