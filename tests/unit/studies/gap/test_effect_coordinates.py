"""Coordinates that take out how the model gives way to effects: against conditional means, and as a map."""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.studies.gap.density import HypothesisDensity
from sma_bayes.studies.gap.effect_coordinates import FollowingCoordinates
from sma_bayes.studies.gap.fitting import fit_hypothesis


@pytest.fixture(scope="module")
def fitted(make_line, added):
    line = make_line(phi=0.4, seed=5)
    hypothesis = line.hypothesis.extended(added("wave", lambda v: np.sin(0.9 * v["order"]), 0.7))
    return fit_hypothesis(hypothesis, np.append(line.prior_mean, 0.0), line.noise)


def test_the_model_goes_where_its_conditional_mean_is(fitted) -> None:
    """Of a linear model the posterior is normal, so the conditional mean is a regression on the effect."""
    coordinates = FollowingCoordinates(fitted)
    assert coordinates.count == 3
    sizes = fitted.z[3] + np.array([[-0.4], [0.0], [1.3]])
    slope = fitted.covariance[:3, 3] / fitted.covariance[3, 3]
    np.testing.assert_allclose(
        coordinates.moved(sizes), (sizes - fitted.z[3]) * slope, atol=1e-4 * np.abs(slope).max()
    )
    conditional = fitted.covariance[:3, :3] - np.outer(slope, fitted.covariance[3, :3])
    np.testing.assert_allclose(coordinates.covariance[:3, :3], conditional, rtol=1e-6, atol=1e-12)
    assert not coordinates.covariance[:3, 3].any()


def test_the_map_goes_both_ways_and_keeps_volumes(fitted) -> None:
    coordinates = FollowingCoordinates(fitted)
    z = fitted.z + np.random.default_rng(0).standard_normal((50, 4))
    u, log_jacobian, back = coordinates.forward(z)
    again, _, found = coordinates.inverse(u)
    assert back.all()
    assert found.all()
    np.testing.assert_allclose(again, z, rtol=1e-12)
    step = 1e-5 * np.eye(4)
    slope = (coordinates.forward(z[:1] + step)[0] - coordinates.forward(z[:1] - step)[0]) / 2e-5
    assert np.linalg.det(slope) == pytest.approx(1.0, abs=1e-6)
    assert not log_jacobian.any()
    broken = z[:2].copy()
    broken[1, 3] = np.inf
    assert coordinates.forward(broken)[2].tolist() == [True, False]


def test_only_effects_are_taken_for_bent(fitted, make_line) -> None:
    shape = HypothesisDensity(fitted).shape()
    assert shape.bent == 1
    assert [b.tolist() for b in shape.blocks()] == [[0, 1, 2], [3]]
    line = make_line()
    plain = HypothesisDensity(fit_hypothesis(line.hypothesis, line.prior_mean, line.noise)).shape()
    assert plain.bent == 0
    assert [b.tolist() for b in plain.blocks()] == [[0, 1, 2]]
