"""The verb `sensitivity` on the command line."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sma_bayes.studies.command_execution import calls


@calls("sensitivity", "show_sensitivity")
def command(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder that fit or demo has written.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder for the results: new or empty, or --resume; none by default.")
    ] = None,
    at: Annotated[
        list[str] | None,
        typer.Option(help="A temperature, such as '60 degC', at which stiffness is told; may be repeated."),
    ] = None,
) -> None:
    """Tell what the numbers of a fit rest on: prior, data, single sweeps and readings."""
