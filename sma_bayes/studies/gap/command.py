"""The verb `gap` on the command line."""

from __future__ import annotations

from typing import Annotated

import typer

from sma_bayes.studies import command_options as opt
from sma_bayes.studies.command_execution import calls


@calls("study_gap", "show_gap", without=("seed", "jobs"), tasks=False)
def command(
    path: opt.SourceArgument,
    out: opt.Out,
    data: opt.Data = None,
    seed: opt.Seed = 0,
    jobs: opt.Jobs = None,
    model: opt.Model = "modified_sigmoid",
    priors: opt.Priors = None,
    noise: Annotated[
        str, typer.Option(help="Only 'auto': the study estimates the noise by itself.")
    ] = "auto",
    pool: opt.PoolChoice = "none",
) -> None:
    """Find where model and measurement disagree, name what is missing, add it, and show the gap shrink."""
