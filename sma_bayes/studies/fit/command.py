"""The verb `fit` on the command line."""

from __future__ import annotations

from functools import partial

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
    noise: opt.Noise = "auto",
    pool: opt.PoolChoice = "none",
    sampler: opt.Sampler = "independence",
    extrapolate: opt.Extrapolate = 0.0,
    arrangement: opt.Arranged = None,
    bias: opt.Bias = None,
    bias_sd: opt.BiasSd = None,
    figures: opt.Figures = "report",
    no_figures: opt.NoFigures = False,
    scheduler: opt.Scheduler = None,
    resume: opt.Resume = False,
    self_check: opt.SelfCheck = False,
    strict: opt.Strict = False,
    quiet: opt.Quiet = False,
    verbose: opt.Verbose = False,
    as_json: opt.Json = False,
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
