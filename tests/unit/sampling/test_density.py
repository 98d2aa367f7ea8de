"""A density that nobody knows, and what is gained where it says something of itself."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from sma_bayes.sampling.density import Linearisable, Linearised, Shaped, linearised_at, shape_of
from sma_bayes.sampling.ensembles import sample
from sma_bayes.sampling.importance import importance_draws
from sma_bayes.sampling.proposals import PlainCoordinates, StudentMixture
from sma_bayes.sampling.shape import NormalShape

ACROSS = 0.3
"""Standard deviation of a banana across its bend."""
WIDTH = np.array([4.0, 4.0])
MOMENTS = {"mean": (0.0, 1.0), "sd": (1.0, np.sqrt(2.0 + ACROSS**2))}
LN_EVIDENCE = np.log(2.0 * np.pi * ACROSS)


class Banana:
    """``x ~ N(0, 1)``, ``y ~ N(x**2, ACROSS**2)``: names, values and where to begin, no more."""

    names = ("x", "y")

    def log_prob(self, z: np.ndarray) -> np.ndarray:
        u, *_ = Straight().forward(z)
        return -0.5 * np.einsum("wi,wi->w", u, u)

    def draw_prior(self, rng: np.random.Generator, size: int) -> np.ndarray:
        return rng.normal(0.0, WIDTH, (size, 2))


class Straight:
    """Coordinates in which it is a unit normal."""

    def forward(self, z):
        z = np.atleast_2d(z)
        u = np.stack([z[:, 0], (z[:, 1] - z[:, 0] ** 2) / ACROSS], axis=1)
        return u, np.full(len(z), -np.log(ACROSS)), np.ones(len(z), dtype=bool)

    def inverse(self, u):
        z = np.stack([u[:, 0], ACROSS * u[:, 1] + u[:, 0] ** 2], axis=1)
        return z, np.full(len(u), -np.log(ACROSS)), np.ones(len(u), dtype=bool)


class ShapedBanana(Banana):
    def shape(self) -> NormalShape:
        return NormalShape(Straight(), np.eye(2), 0)


class StraightAt(Linearised):
    """All that must be said of a linearised density."""

    def __init__(self, z: np.ndarray) -> None:
        self.z = z

    def information(self) -> np.ndarray:
        slope = np.array([[1.0, 0.0], [-2.0 * self.z[0] / ACROSS, 1.0 / ACROSS]])
        return slope.T @ slope

    def proposals(self, covariance: np.ndarray, rng: np.random.Generator) -> Iterator:
        unit = StudentMixture(np.ones(1), np.zeros((1, 2)), np.eye(2)[None], 30.0)
        yield (
            PlainCoordinates(),
            StudentMixture.from_covariances(np.ones(1), self.z[None], covariance[None], 30.0),
        )
        yield Straight(), unit


class LinearisableBanana(Banana):
    def linearised(self, z: np.ndarray) -> StraightAt:
        return StraightAt(z)


EACH = pytest.mark.parametrize("density", [Banana(), ShapedBanana(), LinearisableBanana()])


def test_an_ability_is_known_by_its_methods() -> None:
    z = np.zeros(2)
    assert [isinstance(d, Shaped) for d in (Banana(), ShapedBanana(), LinearisableBanana())] == [0, 1, 0]
    assert [isinstance(d, Linearisable) for d in (Banana(), ShapedBanana(), LinearisableBanana())] == [
        0,
        0,
        1,
    ]
    assert linearised_at(Banana(), z) is None
    assert isinstance(linearised_at(LinearisableBanana(), z), StraightAt)
    assert shape_of(ShapedBanana(), 4.0 * np.eye(2)).bent == 0
    assert shape_of(Banana(), 4.0 * np.eye(2)).bent == 2


@EACH
def test_its_moments_and_evidence_are_found_whatever_it_says(density: Banana) -> None:
    """Five numbers, each within 4.5 standard errors: one false alarm in 30,000 tests of one density."""
    draws = sample(density, [np.array([0.0, 0.0])], WIDTH, np.random.SeedSequence(2))
    assert draws.convergence.converged
    z = draws.z.reshape(-1, 2)
    ess = np.minimum(draws.convergence.ess_bulk, draws.convergence.ess_tail)
    sd = np.array(MOMENTS["sd"])
    assert np.abs((z.mean(axis=0) - MOMENTS["mean"]) / sd * np.sqrt(ess)).max() < 4.5
    # of the variance: kurtosis 3 of x, of y that of x**2 with a little that is normal
    fourth = np.array([3.0, (60.0 + 6.0 * 2.0 * ACROSS**2 + 3.0 * ACROSS**4) / sd[1] ** 4])
    assert np.abs((z.var(axis=0) / sd**2 - 1.0) / np.sqrt((fourth - 1.0) / ess)).max() < 4.5
    assert abs(draws.ln_evidence - LN_EVIDENCE) < 4.5 * draws.ln_evidence_sd


def test_what_it_says_saves_evaluations_and_stages() -> None:
    plain, *others = (
        sample(d, [np.zeros(2)], WIDTH, np.random.SeedSequence(2))
        for d in (Banana(), ShapedBanana(), LinearisableBanana())
    )
    assert plain.method != "independence"
    assert [d.method for d in others] == ["independence"] * 2
    assert max(d.evaluations for d in others) < 0.5 * plain.evaluations


@EACH
def test_importance_draws_take_it_too(density: Banana) -> None:
    """Evidence within 4.5 standard errors: one false alarm in 150,000."""
    found = importance_draws(density, [np.array([0.5, 0.5])], WIDTH, np.random.SeedSequence(3))
    assert found.converged
    assert abs(found.evidence.value - LN_EVIDENCE) < 4.5 * found.evidence.sd
