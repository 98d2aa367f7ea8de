"""Fit a proposal to draws that another move made."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.sampling.adaptation import ROUND_DRAWS, Adapted, weigh
from sma_bayes.sampling.density import Density, linearised_at, shape_of
from sma_bayes.sampling.laplace import Mode
from sma_bayes.sampling.proposals import Mixture, Proposal, StudentMixture
from sma_bayes.sampling.shape import NARROW_DF, NormalShape
from sma_bayes.sampling.weighted import Weights, tempered

REFIT_ROUNDS = 3
"""Rounds in which a proposal is fitted to its own draws and those of another move together."""


def adapt_to_draws(density: Density, z: Floats, modes: Sequence[Mode], rng: np.random.Generator) -> Adapted:
    """Fit a proposal to draws that another move made, with as many components as they support.

    Parameters
    ----------
    density : Density
    z : ndarray, shape (N, D)
        Draws, roughly from the density.
    modes : sequence of Mode
        What the density knows of its shape is asked at the first.
    rng : numpy.random.Generator
    """
    chosen = z[rng.choice(len(z), size=min(len(z), 8000), replace=False)]
    covariance = np.cov(chosen.T).reshape(z.shape[1], z.shape[1])
    wide = StudentMixture.from_covariances(np.ones(1), chosen.mean(axis=0)[None], 4.0 * covariance[None], 4.0)
    fit, rest = np.array_split(chosen, 2)
    log_prob = density.log_prob(rest)

    def mixtures(shape: NormalShape) -> Iterator[Adapted]:
        u, _, back = shape.coordinates.forward(fit)
        of_rest = shape.coordinates.forward(rest)
        for components in (1, 4, 12, 32):
            proposal = Proposal(shape.coordinates, _fitted_mixture(shape, u[back], components, rng), wide)
            own = Adapted(proposal, weigh(density, proposal, rng, 4 * ROUND_DRAWS), 4 * ROUND_DRAWS)
            yield own.judged_by(log_prob - proposal.log_density(rest, of_rest))

    found = list(mixtures(shape_of(density, modes[0].covariance)))
    shape = None if any(f.carries for f in found) else _shape_over(density, fit)
    if shape is not None:
        more = list(mixtures(shape))
        best = max(more, key=lambda f: f.acceptance)
        found += [*more, _reaching_out(density, best, fit, rng).judged(rest, log_prob)]
    best = max(found, key=lambda f: (f.carries, f.acceptance))
    return replace(best, evaluations=len(rest) + sum(f.evaluations for f in found))


def _shape_over(density: Density, z: Floats) -> NormalShape | None:
    """Shape of draws (N, D) in the coordinates that a density has for them; None where it has none."""
    linearised = linearised_at(density, np.median(z, axis=0))
    coordinates = None if linearised is None else linearised.coordinates_over(z)
    if coordinates is None:
        return None
    u, _, back = coordinates.forward(z)
    return NormalShape(coordinates, np.cov(u[back].T), z.shape[1])


def _reaching_out(density: Density, first: Adapted, z: Floats, rng: np.random.Generator) -> Adapted:
    """Fit a proposal again, to draws (N, D) of another move and to weighted draws of its own.

    Walkers come to the end of a long tail too rarely for their draws to tell how far it goes. Draws of the proposal do,
    but lack what it has missed; each kind counts half.
    """
    if not isinstance(first.proposal, Proposal):
        return first
    proposal = first.proposal
    for _ in range(REFIT_ROUNDS):
        own = weigh(density, proposal, rng, 32 * ROUND_DRAWS)
        usable = np.isfinite(own.weights.log_weight)
        weight = 0.5 * tempered(Weights(own.weights.log_weight[usable]))
        u, _, back = proposal.coordinates.forward(np.concatenate([z, own.z[usable]]))
        both = np.concatenate([np.full(len(z), 0.5 / len(z)), weight])[back]
        narrow = proposal.narrow.refitted(u[back], both / both.sum(), rounds=6)
        proposal = replace(proposal, narrow=narrow)
    last = weigh(density, proposal, rng, 4 * ROUND_DRAWS)
    return Adapted(proposal, last, REFIT_ROUNDS * 32 * ROUND_DRAWS + 4 * ROUND_DRAWS)


def _fitted_mixture(shape: NormalShape, u: Floats, components: int, rng: np.random.Generator) -> Mixture:
    """Mixture fitted to draws (N, D) in the coordinates of a shape, of several components for what is bent."""
    bent = shape.blocks()[-1]
    bend = np.cov(u[:, bent].T).reshape(bent.size, bent.size)
    start = StudentMixture.about(u[:, bent], components, bend / components, NARROW_DF, rng)
    weight = np.full(len(u), 1.0 / len(u))
    return shape.mixture(u.mean(axis=0), [start]).refitted(u, weight, rounds=40)
