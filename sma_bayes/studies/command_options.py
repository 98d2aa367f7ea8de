"""Options that several verbs have, each with its help."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sma_bayes.limits import SEED

Seed = Annotated[int, typer.Option(help="Seed of all random draws.", min=0, max=int(SEED.value))]
Jobs = Annotated[int | None, typer.Option(help="Processes; by default one for each core.", min=1)]
Priors = Annotated[
    str | None,
    typer.Option(help="Priors: the name of a shipped set, or a TOML file; those of the model by default."),
]
Model = Annotated[
    str,
    typer.Option(
        help="Response model: 'sma-bayes priors --list' names them; 'auto' chooses the best supported by evidence.",
        metavar="NAME",
    ),
]
Noise = Annotated[
    str, typer.Option(help="Noise model, or 'auto': chosen from the residuals of the least-squares fit.")
]
PoolChoice = Annotated[
    str,
    typer.Option(
        help="'none': each condition has parameters of its own; 'campaign': shared by all of a branch."
    ),
]
Sampler = Annotated[
    str,
    typer.Option(
        help="'independence', or to cross-check it emcee's 'de' (differential evolution) or 'stretch'."
    ),
]
Resume = Annotated[bool, typer.Option("--resume", help="Go on with the run that --out holds.")]
SelfCheck = Annotated[
    bool,
    typer.Option(
        "--self-check",
        help="Simulate measurements from each posterior (250 to 1000), fit them again: do intervals hold the truths?",
    ),
]
Strict = Annotated[bool, typer.Option("--strict", help="Exit status 1 also where a fit is not adequate.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no summary.")]
Verbose = Annotated[
    bool,
    typer.Option("--verbose", "-v", help="Every step as a log line on standard error, in place of a bar."),
]
Json = Annotated[bool, typer.Option("--json", help="The summary as JSON on standard output.")]
Data = Annotated[
    Path | None, typer.Option(help="Folder of the data files, where it is not the campaign file's own.")
]
Extrapolate = Annotated[
    float,
    typer.Option(help="How far bands extend beyond the observed temperatures [their unit].", min=0.0),
]
Arranged = Annotated[
    str | None,
    typer.Option(
        help="Bias spring, Eq. (8): 'published_difference', 'parallel' or 'series'; none by default."
    ),
]
Bias = Annotated[float | None, typer.Option(help="Stiffness of the bias spring [N/m]; 130 by default.")]
BiasSd = Annotated[
    float | None,
    typer.Option(help="Standard deviation of that stiffness [N/m]; 6.5 by default."),
]
SourceArgument = Annotated[
    Path, typer.Argument(metavar="PATH", help="Campaign folder, campaign.toml, or a data file.")
]
Out = Annotated[Path, typer.Option(help="Folder for the results: new or empty, or --resume.")]
Figures = Annotated[
    str,
    typer.Option(
        help="'report': those that the report shows; 'all': diagnostics of each condition and record too; "
        "'none': no report either."
    ),
]
NoFigures = Annotated[bool, typer.Option("--no-figures", help="The same as --figures none.")]
Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Dask scheduler, such as tcp://head:8786, whose workers do the tasks instead of processes here.",
    ),
]
