"""The verb `compare` on the command line."""

from __future__ import annotations

from functools import partial
from typing import Annotated

import typer

from sma_bayes.studies import command_options as opt
from sma_bayes.studies.command_execution import finish, working_on


def command(
    path: opt.SourceArgument,
    out: opt.Out,
    data: opt.Data = None,
    seed: opt.Seed = 0,
    jobs: opt.Jobs = None,
    model: opt.Model = "modified_sigmoid",
    priors: opt.Priors = None,
    noise: Annotated[
        str,
        typer.Option(help="Noise model of all models, or 'auto': chosen by evidence for each record."),
    ] = "auto",
    pool: opt.PoolChoice = "none",
    figures: opt.Figures = "report",
    no_figures: opt.NoFigures = False,
    scheduler: opt.Scheduler = None,
    resume: opt.Resume = False,
    quiet: opt.Quiet = False,
    verbose: opt.Verbose = False,
    as_json: opt.Json = False,
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
