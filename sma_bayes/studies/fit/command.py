"""The verb `fit` on the command line."""

from __future__ import annotations

from functools import partial

from sma_bayes.studies.command_execution import finish, working_on
from sma_bayes.studies.command_options import (
    Arranged,
    Bias,
    BiasSd,
    Data,
    Extrapolate,
    Figures,
    Jobs,
    Json,
    Model,
    NoFigures,
    Noise,
    Out,
    PoolChoice,
    Priors,
    Quiet,
    Resume,
    Sampler,
    Scheduler,
    Seed,
    SelfCheck,
    SourceArgument,
    Strict,
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
    noise: Noise = "auto",
    pool: PoolChoice = "none",
    sampler: Sampler = "independence",
    extrapolate: Extrapolate = 0.0,
    arrangement: Arranged = None,
    bias: Bias = None,
    bias_sd: BiasSd = None,
    figures: Figures = "report",
    no_figures: NoFigures = False,
    scheduler: Scheduler = None,
    resume: Resume = False,
    self_check: SelfCheck = False,
    strict: Strict = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    as_json: Json = False,
) -> None:
    """Fit a response curve to each record: posterior, credible bands, diagnostics, correlation factors, report."""
    from sma_bayes.records.campaign import read_campaign
    from sma_bayes.studies.fit.terminal import show_fit
    from sma_bayes.studies.fit.workflow import fit_campaign
    from sma_bayes.studies.options import bias_spring, pool_named

    read = partial(read_campaign, path, data_dir=data)
    with working_on(read, scheduler, jobs, quiet or as_json, verbose) as (campaign, shared):
        summary = fit_campaign(
            campaign,
            out,
            seed=seed,
            noise=noise,
            model=model,
            priors=priors,
            pool=pool_named(pool),
            sampler=sampler,
            extrapolate=extrapolate,
            bias=bias_spring(arrangement, bias, bias_sd),
            resume=resume,
            self_check=self_check,
            figures="none" if no_figures else figures,
            **shared,
        )
    finish(summary, quiet, as_json, lambda: show_fit(summary, out), strict=strict)
