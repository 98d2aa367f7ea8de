"""Prior and data against each other: parameters of which the one excludes what the other says.

Two signs are looked for (Evans and Moshonov, Bayesian Anal. 1 (2006) 893-914, doi:10.1214/06-BA129). Where the data
are the stronger they pull the posterior to where the prior hardly allows it. Where the prior is, the posterior stays
with it, however wide the noise becomes for that, and only the data by themselves tell: their least-squares estimate,
with its standard error, lies outside of what the prior allows. The second sign needs no likelihood under the prior, so
that nothing underflows however far apart they are.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from sma_bayes.errors import PriorError
from sma_bayes.fitting.fit import Fit
from sma_bayes.fitting.posterior import Posterior, build_posterior
from sma_bayes.fitting.warm_start import warm_start
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.noise.effective_samples import memory_of
from sma_bayes.parameters.space import Parameter
from sma_bayes.quantities import unit_text

CONFLICT_PRIOR_PROBABILITY = 0.001
"""Prior probability, both tails together, outside of which a value contradicts the prior: by the prior's own account
one parameter in a thousand lies there."""
CONFLICT_STANDARD_ERRORS = 4.0
"""Standard errors about the least-squares estimate that must lie outside, too, where it contradicts by itself."""


def contradicted(fit: Fit, record: int = 0) -> tuple[str, ...]:
    """Parameters of the curve about which prior and data contradict each other, with what both say."""
    space = fit.posterior.space
    told: dict[str, str] = {}
    for i in fit.posterior.layout[record].model.tolist():
        parameter = space.parameters[i]
        if parameter.fixed is None:
            median = float(np.median(fit.flat[:, i]))
            if not _allows(parameter, median, median):
                told[parameter.name] = _told(parameter, f"{median:.3g}")
    for parameter, estimate, error in _estimates_of_data_alone(fit):
        if parameter.name not in told and not _allows(
            parameter,
            estimate - CONFLICT_STANDARD_ERRORS * error,
            estimate + CONFLICT_STANDARD_ERRORS * error,
        ):
            told[parameter.name] = _told(parameter, f"{estimate:.3g}", " by the data alone")
    stopped = [name for name in fit.warm_start.at_bound if name not in told] if told else []
    return (*told.values(), *(f"{name} (least squares stops at the end of its prior)" for name in stopped))


def _told(parameter: Parameter, found: str, by: str = "") -> str:
    unit = "" if parameter.unit == "1" else f" {unit_text(parameter.unit)}"
    low, high = _limits(parameter)
    name = parameter.name.partition("[")[0]
    return f"{name} ({found}{unit}{by}, the prior says {low:.3g} to {high:.3g})"


def _limits(parameter: Parameter) -> tuple[float, float]:
    low, high = parameter.prior.quantile(
        np.array([CONFLICT_PRIOR_PROBABILITY / 2.0, 1.0 - CONFLICT_PRIOR_PROBABILITY / 2.0])
    ).tolist()
    return low, high


def _allows(parameter: Parameter, low: float, high: float) -> bool:
    """Whether the prior allows something of an interval."""
    lowest, highest = _limits(parameter)
    return lowest <= high and low <= highest


def _estimates_of_data_alone(fit: Fit) -> Iterator[tuple[Parameter, float, float]]:
    """Parameters of the curve that least squares determines, with estimate and standard error.

    Where somebody gave priors the search begins at those that come with the model, which are as wide as the record:
    from a curve a million degrees away no slope leads back.
    """
    try:
        posterior, start = _with_own_priors(fit.posterior), fit.warm_start
    except PriorError:  # a model of somebody else's that comes without
        posterior, start = fit.posterior, fit.warm_start
    of_model = slice(len(posterior.model.parameter_names))
    if posterior.space.parameters[of_model] != fit.posterior.space.parameters[of_model]:
        start = warm_start(posterior, np.random.default_rng(fit.seed))
    counted = {
        channel: max(
            memory_of(residual[channel], steps)
            for residual, steps in zip(start.residual, posterior.steps, strict=True)
        )
        for channel in posterior.records[0].channels
    }
    facts = {f.name: f for f in posterior.model.facts}
    space = fit.posterior.space
    for i, name in enumerate(posterior.model.parameter_names):
        parameter = space.parameters[i]
        if parameter.fixed is None and name not in start.at_bound and np.isfinite(start.sd[i]):
            samples_per_one = counted.get(facts[name].channel, max(counted.values()))
            yield parameter, float(start.theta[i]), float(start.sd[i]) * float(np.sqrt(samples_per_one))


def _with_own_priors(posterior: Posterior) -> Posterior:
    """The curve alone under the priors that come with the model; what the user fixed stays fixed."""
    model = posterior.model
    own = build_posterior(posterior.records, NOISE_MODELS["independent"], model.default_priors(), model=model)
    fixed = {p.name: p.fixed for p in posterior.space.parameters if p.fixed is not None}
    parameters = tuple(
        replace(p, fixed=fixed[p.name]) if p.name in fixed else p for p in own.space.parameters
    )
    return replace(own, space=replace(own.space, parameters=parameters))
