"""The verb `fit` on the command line."""

from __future__ import annotations

from typing import Any

from sma_bayes.studies import command_options as opt
from sma_bayes.studies.command_execution import calls


@calls("fit_campaign", "show_fit")
def command(
    path: opt.SourceArgument,
    out: opt.Out,
    data: opt.Data = None,
    model: opt.Model = "modified_sigmoid",
    priors: opt.Priors = None,
    noise: opt.Noise = "auto",
    pool: opt.PoolChoice = "none",
    sampler: opt.Sampler = "independence",
    extrapolate: opt.Extrapolate = 0.0,
    arrangement: opt.Arranged = None,
    bias: opt.Bias = None,
    bias_sd: opt.BiasSd = None,
    self_check: opt.SelfCheck = False,
    strict: opt.Strict = False,
) -> dict[str, Any]:
    """Fit a response curve to each record: posterior, credible bands, diagnostics, correlation factors, report."""
    from sma_bayes.studies.options import bias_spring

    return {"bias": bias_spring(arrangement, bias, bias_sd), "arrangement": None, "bias_sd": None}
