"""The verb `compare` on the command line."""

from __future__ import annotations

from functools import partial
from typing import Annotated

import typer

from sma_bayes.studies.command_execution import finish, working_on
from sma_bayes.studies.command_options import (
    Data,
    Figures,
    Jobs,
    Json,
    Model,
    NoFigures,
    Out,
    PoolChoice,
    Priors,
    Quiet,
    Resume,
    Scheduler,
    Seed,
    SourceArgument,
    Verbose,
)


def command(
    path: SourceArgument,
    out: Out,
    data: Data = None,
    seed: Seed = 0,
    jobs: Jobs = None,
    model: Model = "modified_sigmoid",
    priors: Priors = None,
    noise: Annotated[
        str,
        typer.Option(help="Noise model of all models, or 'auto': chosen by evidence for each record."),
    ] = "auto",
    pool: PoolChoice = "none",
    figures: Figures = "report",
    no_figures: NoFigures = False,
    scheduler: Scheduler = None,
    resume: Resume = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    as_json: Json = False,
) -> None:
    """Compare the modified sigmoid with the logistic and polynomial baselines, on what was held out too."""
    from sma_bayes.records.campaign import read_campaign
    from sma_bayes.report.screen import show_text
    from sma_bayes.studies.compare.terminal import comparison_text
    from sma_bayes.studies.compare.workflow import compare
    from sma_bayes.studies.options import pool_named

    read = partial(read_campaign, path, data_dir=data)
    with working_on(read, scheduler, jobs, quiet or as_json, verbose) as (campaign, shared):
        found = compare(
            campaign,
            out,
            seed=seed,
            noise=noise,
            model=model,
            priors=priors,
            pool=pool_named(pool),
            resume=resume,
            figures="none" if no_figures else figures,
            **shared,
        )
    finish(found, quiet, as_json, lambda: show_text(comparison_text(found), found, out))
