"""The verb `cycles` on the command line."""

from __future__ import annotations

from typing import Annotated

import typer

from sma_bayes.studies import command_options as opt
from sma_bayes.studies.command_execution import calls


@calls("cycles", "show_cycles")
def command(
    path: opt.SourceArgument,
    out: opt.Out,
    at: Annotated[
        list[str] | None,
        typer.Option(
            help="A temperature, such as '60 degC', at which to tell channels and stiffness; may be repeated. "
            "The middle of those that were measured by default."
        ),
    ] = None,
    share: Annotated[
        float, typer.Option(help="Greatest change per cycle of a stable curve, as a share of its stroke.")
    ] = 0.02,
    probability: Annotated[float, typer.Option(help="Probability with which it is to be stable.")] = 0.9,
    ahead: Annotated[int, typer.Option(help="Cycles to forecast.")] = 10,
    data: opt.Data = None,
    model: opt.Model = "modified_sigmoid",
) -> None:
    """Tell cycle by cycle how sweeps change, by which law, when they are stable, and what later ones will be."""
