"""The verb `simulate` on the command line."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sma_bayes.studies.command_execution import calls


@calls("simulate", "show_simulation", without=("jobs", "scheduler"))
def command(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder that fit has written.")],
    current: Annotated[
        Path | None,
        typer.Option(
            metavar="PROFILE",
            help="File of the current, columns such as time_s and current_A; each value holds until the next row.",
        ),
    ] = None,
    reach: Annotated[
        str | None,
        typer.Option(
            help="A value to reach by a steady current, heated from cold, such as 'stiffness=500 N/m'."
        ),
    ] = None,
    condition: Annotated[str | None, typer.Option(help="Only this condition.")] = None,
    start: Annotated[
        list[str] | None,
        typer.Option(
            help="'cold', 'hot' (both by default), 'heating:60 degC' or 'cooling:60 degC'; may be repeated."
        ),
    ] = None,
    ambient: Annotated[
        str | None, typer.Option(help="Temperature of the surroundings, such as '23 degC'.")
    ] = None,
    rule: Annotated[
        str, typer.Option(help="Rule of minor loops: 'proportional' or 'play'.")
    ] = "proportional",
    pool: Annotated[
        str, typer.Option(help="'campaign': one heat balance for all conditions; 'none': one for each.")
    ] = "campaign",
    tolerance: Annotated[str, typer.Option(help="How far off --reach may be: '5 %' or '4 N/m'.")] = "5 %",
    probability: Annotated[float, typer.Option(help="Probability with which --reach is to be met.")] = 0.9,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the results: new or empty, or --resume.")
    ] = None,
    draws: Annotated[int, typer.Option(help="Posterior draws that are simulated.")] = 400,
) -> None:
    """Simulate a heating current: temperature, force, displacement and stiffness over time, with bands."""
