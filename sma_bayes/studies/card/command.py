"""The verb `card` on the command line."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sma_bayes.studies.command_execution import calls


@calls("card", "show_card", without=("jobs", "scheduler"))
def command(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder that fit or demo has written.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder for the files: new or empty, or --resume; none by default.")
    ] = None,
    area: Annotated[
        str | None,
        typer.Option(help="Cross-section of a wire whose force was measured, such as '0.98 mm^2'."),
    ] = None,
    length: Annotated[
        str | None, typer.Option(help="Length of a wire whose displacement was measured, such as '50 mm'.")
    ] = None,
    modulus_austenite: Annotated[
        str | None, typer.Option(help="Young's modulus of austenite where it is known, such as '70 GPa'.")
    ] = None,
    modulus_martensite: Annotated[
        str | None, typer.Option(help="The same of martensite; that of austenite by default.")
    ] = None,
    reference_stress: Annotated[
        str | None,
        typer.Option(
            help="Stress at which C_A and C_M are given, such as '150 MPa'; by default the mean of the sweeps."
        ),
    ] = None,
    points: Annotated[int, typer.Option(help="Rows of a stiffness table.")] = 65,
    draws: Annotated[int, typer.Option(help="Posterior draws of the constants.")] = 400,
) -> None:
    """Export a fit: constants for a finite-element solver, stiffness tables and a C header for a controller."""
