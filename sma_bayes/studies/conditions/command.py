"""The verb `conditions` on the command line."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sma_bayes.studies import command_options as opt
from sma_bayes.studies.command_execution import calls


@calls("study_conditions", "show_conditions")
def command(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder that fit or demo has written.")],
    out: opt.Out,
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
) -> None:
    """Tell what current, load, frequency and duty cycle do, and predict conditions that were not measured."""
