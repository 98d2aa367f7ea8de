"""Draws of a posterior by importance sampling alone.

For a comparison many similar posteriors are fitted, also of models that describe the data badly. Importance draws
from a fitted proposal cost a small part of what ensembles do, give the evidence on the way, and tell by the Pareto
exponent of their weights when they can't be relied on. Then a mixture is fitted to them, joined with the prior of the
curve, and drawn from again, a few times (population Monte Carlo).

References
----------
O. Cappé, R. Douc, A. Guillin, J.-M. Marin, C. P. Robert, "Adaptive importance sampling in general mixture classes",
Statistics and Computing 18 (2008) 447.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import logsumexp

from sma_bayes.arrays import Floats
from sma_bayes.sampling.adaptation import adapt, first_proposal
from sma_bayes.sampling.bridge import Evidence, fitted_proposal
from sma_bayes.sampling.density import Density, linearised_at
from sma_bayes.sampling.laplace import Mode, distinct_modes, find_mode
from sma_bayes.sampling.pareto import MAX_RELIABLE_K, smoothed_weights
from sma_bayes.sampling.proposals import DrawSource
from sma_bayes.sampling.weighted import ImportanceSample, Weights, tempered

DRAWS: Final = 4000
"""Importance draws of a proposal."""
ENOUGH_EFFECTIVE_DRAWS: Final = 200.0
"""Effective draws that a posterior needs."""
EXTRA_DRAWS_FACTOR: Final = 4
"""Times as many draws where the first few do not do: still far fewer than a proposal of its own takes."""
COMPONENTS, ROUNDS, POPULATION, RESAMPLED = 12, 5, 8000, 2000
"""Of the mixtures that are fitted to draws: components, how often they are fitted, draws each time, and how many of
them they are fitted to."""
MAX_MODES: Final = 3
"""Modes that a proposal is fitted to."""


@dataclass(frozen=True, slots=True, eq=False)
class WeightedDraws:
    """Draws with weights.

    Attributes
    ----------
    z : ndarray, shape (S, D)
        Sampled coordinates.
    log_weight : ndarray, shape (S,)
        Logarithms of weights that sum to one.
    evidence : Evidence
    k : float
        Pareto exponent of the weights.
    method : str
        ``importance`` or ``population Monte Carlo``.
    converged : bool
    proposal : DrawSource
        From which they were drawn.
    modes : tuple of Mode
    """

    z: Floats
    log_weight: Floats
    evidence: Evidence
    k: float
    method: str
    converged: bool
    proposal: DrawSource
    modes: tuple[Mode, ...]

    @property
    def effective(self) -> float:
        """Effective number of draws."""
        return float(np.exp(-logsumexp(2.0 * self.log_weight)))


def importance_draws(
    density: Density,
    starts: Sequence[Floats],
    width: Floats,
    seed: np.random.SeedSequence,
    *,
    others: Sequence[DrawSource] = (),
) -> WeightedDraws:
    """Sample a density.

    Parameters
    ----------
    density : Density
    starts : sequence of ndarray, shape (D,)
        Points from which modes are climbed to.
    width : ndarray, shape (D,)
        Greatest plausible standard deviation of each coordinate: that of the prior.
    seed : numpy.random.SeedSequence
    others : sequence of DrawSource
        Those of similar densities, to be tried before one is fitted.
    """
    adapt_seed, draw_seed = seed.spawn(2)
    rng = np.random.default_rng(draw_seed)
    modes: tuple[Mode, ...] = ()
    for source in others:
        found = drawn(density, source, modes, rng, DRAWS)
        if found.converged:
            return found
    found_modes = (find_mode(density, start, width) for start in starts)
    modes = distinct_modes([m for m in found_modes if m is not None])[:MAX_MODES]
    own = adapt(density, modes, np.random.default_rng(adapt_seed)).proposal
    found = drawn(density, own, modes, rng, DRAWS)
    return found if found.converged else _population(density, own, modes, rng, found)


def few_draws(
    density: Density,
    starts: Sequence[Floats],
    width: Floats,
    seed: np.random.SeedSequence,
    size: int,
    *,
    others: Sequence[DrawSource] = (),
) -> WeightedDraws:
    """Sample one of very many similar densities: `size` draws of the first proposal, where these do.

    Parameters
    ----------
    density : Density
    starts : sequence of ndarray, shape (D,)
        As those of `importance_draws`, whose draws are given where those of the first proposal can't be relied on.
        That proposal is about one mode, so that it is tried only where there is one start.
    width : ndarray, shape (D,)
    seed : numpy.random.SeedSequence
    size : int
        At least twice `ENOUGH_EFFECTIVE_DRAWS`.
    others : sequence of DrawSource
        Those of similar densities, to be tried before.
    """
    first_seed, thorough_seed = seed.spawn(2)
    rng = np.random.default_rng(first_seed)
    for source in others:
        found = drawn_if_enough(density, source, (), rng, size)
        if found is not None:
            return found
    mode = find_mode(density, starts[0], width) if len(starts) == 1 else None
    linearised = None if mode is None else linearised_at(density, mode.z)
    if mode is not None and linearised is not None:
        with np.errstate(all="ignore"):  # what is not a number has no weight
            proposal = first_proposal(linearised, mode, rng)
            if proposal is not None:
                found = drawn_if_enough(density, proposal, [mode], rng, size)
                if found is not None:
                    return found
    return importance_draws(density, starts, width, thorough_seed)


def drawn_if_enough(
    density: Density, proposal: DrawSource, modes: Sequence[Mode], rng: np.random.Generator, size: int
) -> WeightedDraws | None:
    """Importance draws from a proposal, `size` or, where that promises to do, `EXTRA_DRAWS_FACTOR` times as many.

    None where neither do.
    """
    found = drawn(density, proposal, modes, rng, size)
    if not found.converged and EXTRA_DRAWS_FACTOR * found.effective >= ENOUGH_EFFECTIVE_DRAWS:
        found = drawn(density, proposal, modes, rng, EXTRA_DRAWS_FACTOR * size)
    return found if found.converged else None


def _population(
    density: Density, own: DrawSource, modes: tuple[Mode, ...], rng: np.random.Generator, first: WeightedDraws
) -> WeightedDraws:
    """Fit mixtures to draws until they are good; the best of all rounds where they never are."""
    linearised = linearised_at(density, modes[0].z)
    prior = None if linearised is None else linearised.prior_proposal(modes[0].covariance)
    wide = own if prior is None else prior
    best, found = first, drawn(density, EqualMixture(own, wide), modes, rng, POPULATION)
    for _ in range(ROUNDS):
        if found.effective > best.effective:
            best = found
        if found.converged:
            break
        weight = tempered(Weights(found.log_weight))
        if np.sum(weight > 0.0) < COMPONENTS:
            break
        chosen = found.z[rng.choice(len(found.z), RESAMPLED, p=weight / weight.sum())]
        fitted = fitted_proposal(chosen, np.full(RESAMPLED, 1.0 / RESAMPLED), COMPONENTS, rng)
        found = drawn(density, EqualMixture(fitted, wide), modes, rng, POPULATION)
    best = found if found.converged or found.effective > best.effective else best
    return replace(best, method="population Monte Carlo")


def drawn(
    density: Density, proposal: DrawSource, modes: Sequence[Mode], rng: np.random.Generator, size: int
) -> WeightedDraws:
    """Importance draws from a proposal."""
    found = ImportanceSample.of(density.log_prob, *proposal.draw(rng, size))
    z, weights, log_weight = found.z, found.weights, found.weights.log_weight
    evidence = Evidence(*weights.log_evidence())
    kept = np.isfinite(log_weight)
    if not kept.any():
        return WeightedDraws(
            z[:1], np.zeros(1), evidence, np.inf, "importance", False, proposal, tuple(modes)
        )
    smooth, k = smoothed_weights(log_weight[kept, None])
    reliable = bool(k[0] <= MAX_RELIABLE_K and weights.efficiency * size >= ENOUGH_EFFECTIVE_DRAWS)
    return WeightedDraws(
        z[kept], smooth[:, 0], evidence, float(k[0]), "importance", reliable, proposal, tuple(modes)
    )


@dataclass(frozen=True, slots=True, eq=False)
class EqualMixture:
    """Two sources in equal parts."""

    one: DrawSource
    other: DrawSource

    def draw(self, rng: np.random.Generator, size: int) -> tuple[Floats, Floats]:
        """Points (size, D) and their log density (size,); see `Source.draw`."""
        z = np.concatenate([self.one.draw(rng, size // 2)[0], self.other.draw(rng, size - size // 2)[0]])
        found = np.isfinite(z).all(axis=1)
        log_q = np.full(size, -np.inf)
        log_q[found] = self.log_density(z[found])
        return z, log_q

    def log_density(self, z: Floats) -> Floats:
        """Log density at any points, shape (W,)."""
        return np.asarray(np.logaddexp(self.one.log_density(z), self.other.log_density(z)) - np.log(2.0))
