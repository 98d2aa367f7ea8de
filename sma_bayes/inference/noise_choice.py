"""Choose the noise model from the residuals of the warm start, and say why."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sma_bayes.inference.warm_start import WarmStart
from sma_bayes.noise import NOISE_MODELS, Steps
from sma_bayes.posterior import Posterior
from sma_bayes.quantities import Floats
from sma_bayes.records.types import Record

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


def choose_noise(posterior: Posterior, start: WarmStart) -> NoiseChoice:
    """Compare the noise models on the least-squares residuals by the Bayesian information criterion.

    Models that need time are left out where time was not recorded or its steps are even (the AR(1) in sample
    index then says the same).
    """
    bic = {}
    for name, noise in NOISE_MODELS.items():
        if noise.needs_time and not all(_uneven(s) for s in posterior.steps):
            continue
        total = 0.0
        for record, steps, residual in zip(posterior.records, posterior.steps, start.residual, strict=True):
            for channel in record.channels:
                r = _solid(residual[channel], record.observed[channel])
                estimate = noise.estimate(r, steps)
                likelihood = noise.total_log_density(r[None] / estimate[0], estimate[None, 1:], steps)[0]
                total += -2.0 * (float(likelihood) - record.n * np.log(estimate[0]))
                total += len(estimate) * np.log(record.n)
        bic[name] = total
    best = min(bic, key=lambda name: bic[name])
    lag1 = {
        channel: float(
            np.median([_lag1(r[channel], s) for r, s in zip(start.residual, posterior.steps, strict=True)])
        )
        for channel in posterior.records[0].channels
    }
    correlations = ", ".join(f"{value:.2f} ({channel})" for channel, value in lag1.items())
    rivals = {name: value - bic[best] for name, value in bic.items()}
    second = min((v, k) for k, v in rivals.items() if k != best)
    reason = (
        f"{NOISE_MODELS[best].title}: neighbouring residuals of the least-squares fit are correlated by "
        f"{correlations}; the criterion BIC prefers it to {NOISE_MODELS[second[1]].title} by {second[0]:.1f}"
    )
    return NoiseChoice(best, reason, lag1, rivals)


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


def observed_lag1(record: Record, residual: Floats) -> float:
    """Correlation of neighbouring residuals within sweeps."""
    return _lag1(residual, Steps.of(record))


def _lag1(residual: Floats, steps: Steps) -> float:
    after = np.flatnonzero(~steps.first)
    total = float(residual @ residual)
    return float(residual[after] @ residual[after - 1]) / total if total > 0 else 0.0


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
