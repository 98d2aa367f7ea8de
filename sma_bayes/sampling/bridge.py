"""Log evidence by bridge sampling: draws of the posterior and of a proposal meet half-way.

The proposal is fitted to one half of the draws, the other half is bridged. The estimate shares nothing with importance
sampling from the proposal of the run but the density itself: where both agree, each has checked the other.

References
----------
X.-L. Meng, W. H. Wong, "Simulating ratios of normalizing constants via a simple identity", Statistica Sinica 6 (1996)
831; S. Frühwirth-Schnatter, "Estimating marginal likelihoods for mixture and Markov switching models using bridge
sampling techniques", Econometrics Journal 7 (2004) 143, for the error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from sma_bayes.arrays import Floats
from sma_bayes.sampling.density import Density
from sma_bayes.sampling.proposals import AnyProposal, PlainCoordinates, Proposal, StudentMixture
from sma_bayes.sampling.shape import NARROW_DF

SINGLE_COMPONENT_ERROR = 0.03
"""Standard error above which a proposal of several components is fitted instead of one."""
COMPONENTS, ROUNDS = 6, 10
"""Of that proposal, and rounds of fitting it."""
MAX_ITERATIONS = 200
"""Of the fixed point that is the evidence, at most."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """Log of the integral of a density.

    Attributes
    ----------
    value, sd : float
        And its standard error; not a number and infinity where draws and proposal have nothing in common.
    """

    value: float
    sd: float


def bridge_evidence(density: Density, z: Floats, log_weight: Floats, rng: np.random.Generator) -> Evidence:
    """Log evidence from weighted draws.

    Parameters
    ----------
    density : Density
    z : ndarray, shape (S, D)
        Draws, in any order.
    log_weight : ndarray, shape (S,)
        Logarithms of their weights, up to a constant; equal ones for draws of the density itself.
    rng : numpy.random.Generator
    """
    order = rng.permutation(len(z))
    fit, rest = order[: len(z) // 2], order[len(z) // 2 :]
    weight = _normalised(log_weight[fit])
    one = fitted_proposal(z[fit], weight, 1, rng)
    found = bridged(density, z[rest], _normalised(log_weight[rest]), one, rng)
    if found.sd <= SINGLE_COMPONENT_ERROR:
        return found
    several = fitted_proposal(z[fit], weight, COMPONENTS, rng)
    other = bridged(density, z[rest], _normalised(log_weight[rest]), several, rng)
    return min(found, other, key=lambda e: e.sd)


def fitted_proposal(z: Floats, weight: Floats, components: int, rng: np.random.Generator) -> Proposal:
    """Mixture of Student t fitted to weighted draws (S, D), and a little of a wider one."""
    mean = weight @ z
    covariance = (z - mean).T @ ((z - mean) * weight[:, None])
    wide = StudentMixture.from_covariances(np.ones(1), mean[None], 4.0 * covariance[None], 4.0)
    narrow = StudentMixture.from_covariances(np.ones(1), mean[None], covariance[None], NARROW_DF)
    if components > 1:
        start = z[rng.choice(len(z), components, p=weight)]
        each = np.repeat(covariance[None] / components, components, axis=0)
        narrow = StudentMixture.from_covariances(np.ones(components), start, each, NARROW_DF)
        narrow = narrow.refitted(z, weight, rounds=ROUNDS)
    return Proposal(PlainCoordinates(), narrow, wide)


def bridged(
    density: Density, z: Floats, weight: Floats, proposal: AnyProposal, rng: np.random.Generator
) -> Evidence:
    """The optimal bridge between weighted draws (S, D), which had no part in the proposal, and the proposal."""
    count = len(z)
    effective = 1.0 / float(np.sum(weight**2))
    new, log_q_new = proposal.draw(rng, count)
    usable = np.isfinite(log_q_new)
    log_new = np.full(count, -np.inf)
    log_new[usable] = density.log_prob(new[usable]) - log_q_new[usable]
    if not np.isfinite(log_new).any():  # the proposal never meets the density
        return Evidence(math.nan, math.inf)
    log_old = density.log_prob(z) - proposal.log_density(z)
    centre = float(np.median(log_old))
    own, other = effective / (effective + count), count / (effective + count)
    value = 0.0
    for _ in range(MAX_ITERATIONS):
        above = logsumexp(_ratio(log_new - centre, own, other, value)) - np.log(count)
        below = logsumexp(_inverse(log_old - centre, own, other, value), b=weight)
        step = float(above - below) - value
        value += step
        if abs(step) < 1e-8:
            break
    f_new = _over_greatest(_ratio(log_new - centre, own, other, value))
    f_old = _over_greatest(_inverse(log_old - centre, own, other, value))
    relative = float(np.var(f_new, ddof=1) / f_new.mean() ** 2 / count)
    mean = float(weight @ f_old)
    relative += float(np.sum(weight**2 * (f_old - mean) ** 2)) / mean**2
    return Evidence(value + centre, float(np.sqrt(relative)))


def _over_greatest(log_f: Floats) -> Floats:
    """Values over the greatest of them: what a relative error needs, whatever their size."""
    return np.asarray(np.exp(log_f - log_f.max()))


def _normalised(log_weight: Floats) -> Floats:
    return np.asarray(np.exp(log_weight - logsumexp(log_weight)))


def _ratio(log_l: Floats, own: float, other: float, value: float) -> Floats:
    """Log of ``l/(own l + other r)``."""
    return np.asarray(log_l - np.logaddexp(np.log(own) + log_l, np.log(other) + value))


def _inverse(log_l: Floats, own: float, other: float, value: float) -> Floats:
    """Log of ``1/(own l + other r)``."""
    return np.asarray(-np.logaddexp(np.log(own) + log_l, np.log(other) + value))
