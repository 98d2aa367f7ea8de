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

from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from sma_bayes.inference.adaptation import DF, adapt_to_draws
from sma_bayes.inference.laplace import Density
from sma_bayes.inference.proposals import AnyProposal, PlainCoordinates, Proposal, StudentMixture
from sma_bayes.quantities import Floats

GOOD_ERROR = 0.03
"""Standard error above which a proposal of several components is fitted instead of one."""
ITERATIONS = 200


@dataclass(frozen=True, slots=True)
class Evidence:
    """Log of the integral of a density.

    Attributes
    ----------
    value, sd : float
        And its standard error.
    """

    value: float
    sd: float


def bridge_evidence(density: Density, z: Floats, rng: np.random.Generator) -> Evidence:
    """Log evidence from draws of ensembles.

    Parameters
    ----------
    density : Density
    z : ndarray, shape (G, S, W, D)
        Draws of G ensembles, as `sma_bayes.inference.ensembles.Draws` holds them.
    rng : numpy.random.Generator
    """
    fit, rest = z[:, : z.shape[1] // 2], z[:, z.shape[1] // 2 :]
    flat = fit.reshape(-1, z.shape[-1])
    found = bridged(density, rest, one_component(flat), rng)
    if found.sd <= GOOD_ERROR:
        return found
    other = bridged(density, rest, adapt_to_draws(density, flat, (), rng).proposal, rng)
    return min(found, other, key=lambda e: e.sd)


def one_component(draws: Floats) -> Proposal:
    """Student t of the mean and covariance of draws (N, D), and a little of a wider one."""
    covariance = np.cov(draws.T).reshape(draws.shape[1], draws.shape[1])
    mean = draws.mean(axis=0)[None]
    narrow, wide = (
        StudentMixture.from_covariances(np.ones(1), mean, scale * covariance[None], df)
        for scale, df in ((1.0, DF), (4.0, 4.0))
    )
    return Proposal(PlainCoordinates(), narrow, wide)


def bridged(density: Density, draws: Floats, proposal: AnyProposal, rng: np.random.Generator) -> Evidence:
    """The optimal bridge between draws (G, S, W, D), which had no part in the proposal, and the proposal."""
    groups, steps, walkers, d = draws.shape
    flat = draws.reshape(-1, d)
    count = len(flat)
    new, log_q_new = proposal.draw(rng, count)
    found = np.isfinite(log_q_new)
    log_new = np.full(count, -np.inf)
    log_new[found] = density.log_prob(new[found]) - log_q_new[found]
    log_old = density.log_prob(flat) - proposal.log_density(flat)
    centre = float(np.median(log_old))
    own, other = 0.5, 0.5  # shares; unequal ones would gain little
    value = 0.0
    for _ in range(ITERATIONS):
        above = logsumexp(_ratio(log_new - centre, own, other, value))
        below = logsumexp(_inverse(log_old - centre, own, other, value))
        step = float(above - below) - value
        value += step
        if abs(step) < 1e-8:
            break
    f_new = np.exp(_ratio(log_new - centre, own, other, value))
    f_old = np.exp(_inverse(log_old - centre, own, other, value))
    by_walker = (
        f_old.reshape(groups, steps, walkers).mean(axis=1).ravel()
    )  # walkers hardly know of each other
    relative = np.var(f_new, ddof=1) / f_new.mean() ** 2 / count
    relative += np.var(by_walker, ddof=1) / by_walker.mean() ** 2 / by_walker.size
    return Evidence(value + centre, float(np.sqrt(relative)))


def _ratio(log_l: Floats, own: float, other: float, value: float) -> Floats:
    """Log of ``l/(own l + other r)``."""
    return np.asarray(log_l - np.logaddexp(np.log(own) + log_l, np.log(other) + value))


def _inverse(log_l: Floats, own: float, other: float, value: float) -> Floats:
    """Log of ``1/(own l + other r)``."""
    return np.asarray(-np.logaddexp(np.log(own) + log_l, np.log(other) + value))
