"""The verb `compare` on the command line."""

from __future__ import annotations

from typing import Annotated

import typer

from sma_bayes.studies import command_options as opt
from sma_bayes.studies.command_execution import calls


@calls("compare", "show_comparison")
def command(
    path: opt.SourceArgument,
    out: opt.Out,
    data: opt.Data = None,
    model: opt.Model = "modified_sigmoid",
    priors: opt.Priors = None,
    noise: Annotated[
        str,
        typer.Option(help="Noise model of all models, or 'auto': chosen by evidence for each record."),
    ] = "auto",
    pool: opt.PoolChoice = "none",
) -> None:
    """Compare the modified sigmoid with the logistic and polynomial baselines, on what was held out too."""
