"""Choose the noise model from the residuals of the warm start, and say why."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from sma_bayes.inference.laplace import climb
from sma_bayes.inference.warm_start import WarmStart
from sma_bayes.noise import NOISE_MODELS, NoiseModel, Steps
from sma_bayes.noise.effective_samples import EffectiveSamples, memory_of
from sma_bayes.noise.types import lag1
from sma_bayes.parameters.priors_file import PriorSet
from sma_bayes.posterior import Posterior, build_posterior
from sma_bayes.quantities import Floats

TAKEOVER = 1.25
"""Ratio of residuals from which a memory is taken for misfit; see `choose_noise`. On synthetic records whose noise was
AR(1) with correlations up to 0.97 the ratio was at most 1.07 at the mode (320 records) and 1.12 for the median
curve (48 records)."""
EVEN = 0.05
"""Relative spread of the time steps below which samples count as evenly spaced."""


@dataclass(frozen=True, slots=True)
class NoiseChoice:
    """A noise model and the reason for it.

    Attributes
    ----------
    name : str
    reason : str
        One sentence for people.
    lag1 : mapping of str to float
        Correlation of neighbouring residuals of the warm start, by channel.
    bic : mapping of str to float
        Bayesian information criterion of each noise model on those residuals, less that of the best.
    """

    name: str
    reason: str
    lag1: Mapping[str, float]
    bic: Mapping[str, float]


def choose_noise(posterior: Posterior, start: WarmStart, priors: PriorSet) -> NoiseChoice:
    """Choose a noise model.

    First the noise models are compared on the least-squares residuals by the Bayesian information criterion;
    those that need time are left out where time was not recorded or its steps are even. Where one with a memory
    wins, its posterior mode is looked up: if the curve there leaves residuals more than `TAKEOVER` times those of
    least squares, the memory has taken the place of the curve, what it describes is misfit rather than noise, and
    `EffectiveSamples` is chosen instead. After sampling the same is asked of the median curve (`taken_over`).

    Parameters
    ----------
    posterior : Posterior
        With any noise model; its records count.
    start : WarmStart
    priors : PriorSet
    """
    bic = {
        name: _criterion(noise, posterior, start)
        for name, noise in NOISE_MODELS.items()
        if noise.is_density and (not noise.needs_time or all(_uneven(s) for s in posterior.steps))
    }
    best = min(bic, key=lambda name: bic[name])
    neighbours = neighbour_correlation(posterior, start)
    correlations = ", ".join(f"{value:.2f} ({channel})" for channel, value in neighbours.items())
    rivals = {name: value - bic[best] for name, value in bic.items()}
    second = min((v, k) for k, v in rivals.items() if k != best)
    reason = (
        f"neighbouring residuals of the least-squares fit are correlated by {correlations}; "
        f"the criterion BIC prefers {NOISE_MODELS[best].title} to {NOISE_MODELS[second[1]].title} by {second[0]:.1f}"
    )
    choice = NoiseChoice(best, f"{NOISE_MODELS[best].title}: {reason}", neighbours, rivals)
    if NOISE_MODELS[best].remembers:
        trial = posterior_with(best, posterior, start, priors)
        mode = climb(trial, noise_start(trial, start), trial.space.prior_sd())
        if mode is None:
            return taken_over(choice, np.inf)
        return taken_over(choice, residual_growth(trial, start, trial.space.to_physical(mode.z)[None]))
    return choice


def taken_over(choice: NoiseChoice, left: float) -> NoiseChoice:
    """The choice, or `EffectiveSamples` where a memory takes the place of the curve.

    Parameters
    ----------
    choice : NoiseChoice
    left : float
        `residual_growth` under the chosen model: at its mode before, over its posterior after sampling.
    """
    if not NOISE_MODELS[choice.name].remembers or left <= TAKEOVER or choice.name == EffectiveSamples.name:
        return choice
    reason = (
        f"{NOISE_MODELS[EffectiveSamples.name].title}: {choice.reason.partition(': ')[2]}, but with it the curve "
        f"would leave residuals {left:.1f} times those of least squares: the memory would take the place of the "
        "curve, so it is misfit rather than noise; only as many samples are counted as are independent"
    )
    return replace(choice, name=EffectiveSamples.name, reason=reason)


def posterior_with(name: str, posterior: Posterior, start: WarmStart, priors: PriorSet) -> Posterior:
    """The posterior of the same records with another noise model, its priors scaled to the residuals."""
    left = [{channel: g.rmse for channel, g in fit.items()} for fit in start.fit]
    memory = [
        {c: memory_of(r[c], s) for c in r} for r, s in zip(start.residual, posterior.steps, strict=True)
    ]
    return build_posterior(
        posterior.records, NOISE_MODELS[name], priors, model=posterior.model, residual=left, memory=memory
    )


def neighbour_correlation(posterior: Posterior, start: WarmStart) -> dict[str, float]:
    """Correlation of neighbouring residuals of the warm start, by channel; the median over records."""
    pairs = list(zip(start.residual, posterior.steps, strict=True))
    return {c: float(np.median([lag1(r[c], s) for r, s in pairs])) for c in posterior.records[0].channels}


def _criterion(noise: NoiseModel, posterior: Posterior, start: WarmStart) -> float:
    total = 0.0
    for record, steps, residual in zip(posterior.records, posterior.steps, start.residual, strict=True):
        for channel in record.channels:
            r = _solid(residual[channel], record.observed[channel])
            estimate = noise.estimate(r, steps)
            likelihood = noise.total_log_density(r[None] / estimate[0], estimate[None, 1:], steps)[0]
            total += -2.0 * (float(likelihood) - record.n * np.log(estimate[0]))
            total += len(estimate) * np.log(record.n)
    return total


def residual_growth(posterior: Posterior, start: WarmStart, theta: Floats) -> float:
    """Greatest ratio, over channels, of the residuals of the median curve of `theta` (N, P) to least squares'."""
    after: dict[str, float] = dict.fromkeys(posterior.records[0].channels, 0.0)
    before = dict(after)
    for i, record in enumerate(posterior.records):
        curve = posterior.predict(theta, record.inputs, record=i)
        for channel in record.channels:
            after[channel] += float(
                np.sum((record.observed[channel] - np.median(curve[channel], axis=0)) ** 2)
            )
            before[channel] += float(np.sum(start.residual[i][channel] ** 2))
    return max(float(np.sqrt(after[c] / before[c])) if before[c] > 0 else 1.0 for c in after)


def noise_start(posterior: Posterior, start: WarmStart) -> Floats:
    """Sampled coordinates (D,) of the warm start, with the noise parameters estimated from its residuals."""
    space = posterior.space
    theta = space.to_physical(space.prior_centre())
    theta[: start.theta.size] = start.theta
    for record, place, steps, residual in zip(
        posterior.records, posterior.layout, posterior.steps, start.residual, strict=True
    ):
        for channel, at in place.noise.items():
            theta[at] = posterior.noise.estimate(_solid(residual[channel], record.observed[channel]), steps)
    z = space.to_sampled(theta)
    return np.where(np.isfinite(z), z, space.prior_centre())


def _solid(residual: Floats, observed: Floats) -> Floats:
    """Residuals, or where the fit is exact, of a size that rounding would leave."""
    if float(np.max(np.abs(residual))) > 0.0:
        return residual
    return np.full_like(residual, 1e-12 * max(float(np.max(np.abs(observed))), 1e-300))


def _uneven(steps: Steps) -> bool:
    if not steps.timed:
        return False
    dt = steps.dt[~steps.first]
    return dt.size > 2 and float(np.std(dt)) > EVEN * float(np.mean(dt))
