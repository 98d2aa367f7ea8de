"""Posteriors that are alike: their common shape moved and stretched, its density, and where it is used."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import sma_bayes
from sma_bayes.arrays import Floats
from sma_bayes.assess.draws import record_draws
from sma_bayes.records.types import Campaign, Record
from sma_bayes.sampling.importance import drawn, few_draws
from sma_bayes.sampling.laplace import Mode, find_mode
from sma_bayes.studies.fit import common_shape
from sma_bayes.studies.fit.common_shape import AboutMode, CommonShape, refitted, stretched
from sma_bayes.studies.fit.self_check import PILOT_REPLICATES, checked

START, WIDTH, SIZE = np.zeros(2), np.full(2, 20.0), 500


class Skewed:
    """Two skewed coordinates that go together: logarithms of gamma variables of these shapes, moved and stretched."""

    names = ("a", "b")
    shapes = np.array([3.0, 6.0])

    def __init__(self, mean: Floats, scale: float) -> None:
        self.mean, self.root = mean, scale * np.array([[1.0, 0.0], [0.7, 0.5]])

    def log_prob(self, z: Floats) -> Floats:
        x = np.linalg.solve(self.root, (z - self.mean).T).T
        return np.asarray(np.sum(self.shapes * x - np.exp(x), axis=-1))

    def draw_prior(self, rng: np.random.Generator, size: int) -> Floats:
        return WIDTH * rng.standard_normal((size, 2))

    @property
    def log_evidence(self) -> float:
        """``ln Gamma(3) + ln Gamma(6)`` and the volume."""
        return float(np.log(2.0 * 120.0) + np.linalg.slogdet(self.root)[1])


@pytest.fixture(scope="module")
def common() -> CommonShape:
    found = []
    for n in range(8):
        density = Skewed(np.array([0.1 * n, -0.2 * n]), 0.5 + 0.1 * n)
        found.append(few_draws(density, [START], WIDTH, np.random.SeedSequence(n), SIZE))
    shape = CommonShape.of(found, np.random.default_rng(0))
    assert shape is not None
    return shape


def test_a_covariance_is_stretched_about_the_common_one() -> None:
    root = np.array([[2.0, 0.0], [0.4, 0.1]])
    covariance = np.array([[1.0, -0.3], [-0.3, 0.5]])
    found = stretched(root, Mode(START, 0.0, covariance, 0))
    np.testing.assert_allclose(found @ found.T, covariance, rtol=1e-12)
    np.testing.assert_allclose(stretched(root, Mode(START, 0.0, root @ root.T, 0)), root, rtol=1e-10)


def test_draws_of_the_shape_carry_another_posterior(common: CommonShape) -> None:
    """Evidence within four of its standard errors, a false alarm once in 15,000 seeds; densities are told alike."""
    density = Skewed(np.array([-3.0, 2.0]), 2.0)
    mode = find_mode(density, START, WIDTH)
    assert mode is not None
    proposal = AboutMode(common.shape, mode.z, stretched(common.root, mode))
    z, log_q = proposal.draw(np.random.default_rng(1), 50)
    np.testing.assert_allclose(proposal.log_density(z), log_q, rtol=1e-9)
    found = drawn(density, proposal, [mode], np.random.default_rng(2), SIZE)
    assert found.converged
    assert found.effective > 0.7 * SIZE
    assert abs(found.evidence.value - density.log_evidence) < 4.0 * found.evidence.sd


def test_too_few_give_no_shape_and_one_that_fails_is_left(common: CommonShape) -> None:
    density = Skewed(np.zeros(2), 1.0)
    one = few_draws(density, [START], WIDTH, np.random.SeedSequence(0), SIZE)
    assert CommonShape.of([one] * 3, np.random.default_rng(0)) is None
    far = CommonShape(common.root, AboutMode(common.shape, np.full(2, 40.0), np.eye(2)))
    found = refitted(density, START, WIDTH, np.random.SeedSequence(0), SIZE, far)
    assert found.converged
    assert not isinstance(found.proposal, AboutMode)


def test_a_self_check_samples_few_posteriors_thoroughly(
    make_record: Callable[..., Record], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of 40 replicates those that tell the common shape, and at most one in ten of the others."""
    record = make_record(n=40, channels=("force",))
    campaign = Campaign("spring", "spring", "0" * 64, (record,))
    (fit,) = sma_bayes.fit(campaign, noise="independent", jobs=1).values()
    thorough = []

    def counted(*call: object) -> object:
        thorough.append(call)
        return few_draws(*call)  # type: ignore[arg-type]

    monkeypatch.setattr(common_shape, "few_draws", counted)
    (found,) = checked([(record_draws(fit), False)], 40, 0, jobs=1)
    assert found.failed == 0
    assert PILOT_REPLICATES <= len(thorough) <= PILOT_REPLICATES + 4
