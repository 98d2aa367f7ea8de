"""The verb `plan` on the command line."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sma_bayes.studies import command_options as opt
from sma_bayes.studies.command_execution import calls


@calls("plan", "show_plan", without=("scheduler",))
def command(
    folder: Annotated[
        Path,
        typer.Argument(metavar="DIR", help="Folder that fit or demo has written, or gap for tell-apart."),
    ],
    asked: Annotated[
        str,
        typer.Option(
            "--for",
            metavar="WHAT",
            help="'stiffness@60degC' (or force, displacement; modulus, stress, strain), 'parameters' or 'tell-apart'.",
        ),
    ],
    out: Annotated[
        Path | None, typer.Option(help="Folder for the results: new or empty, or --resume; none by default.")
    ] = None,
    hours: Annotated[
        float | None, typer.Option(help="Time on the rig in hours, for which a design is made.")
    ] = None,
    candidates: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="TOML file of candidate experiments; a grid by default."),
    ] = None,
    condition: Annotated[str | None, typer.Option(help="Only this condition.")] = None,
    branch: Annotated[str | None, typer.Option(help="Only 'heating' or 'cooling'.")] = None,
    rate: Annotated[
        str | None, typer.Option(help="Rate of temperature, such as '2 K/min'; as measured by default.")
    ] = None,
    setup: Annotated[
        str, typer.Option(help="Time before the first cycle of an experiment, such as '20 min'.")
    ] = "0 min",
    scatter: Annotated[
        str,
        typer.Option(
            help="Scatter between sweeps, where a record has one only: 'none', or 'usual' of one specimen in one rig."
        ),
    ] = "none",
    data: opt.Data = None,
) -> None:
    """Tell what to measure next: experiments by the information expected per hour on the rig."""
