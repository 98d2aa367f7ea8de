"""Coordinates that take out how the model gives way to effects: against conditional means, and as a map."""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.studies.gap.density import HypothesisDensity
from sma_bayes.studies.gap.effect_coordinates import FollowingCoordinates, few_samples, scales_only
from sma_bayes.studies.gap.fitting import fit_hypothesis


@pytest.fixture(scope="module")
def line_and_wave(make_line, added):
    """A linear model with one effect about noise of some memory, at its mode."""

    def make(phi: float):
        line = make_line(phi=phi, seed=5)
        hypothesis = line.hypothesis.extended(added("wave", lambda v: np.sin(0.9 * v["order"]), 0.7))
        return fit_hypothesis(hypothesis, np.append(line.prior_mean, 0.0), line.noise)

    return make


@pytest.fixture(scope="module")
def fitted(line_and_wave):
    return line_and_wave(0.4)


@pytest.fixture(scope="module")
def forgetful(line_and_wave):
    """About noise without a memory, so that a few samples can stand for all."""
    return line_and_wave(0.0)


def test_the_model_goes_where_its_conditional_mean_is(fitted) -> None:
    """Of a linear model the posterior is normal, so the conditional mean is a regression on the effect."""
    coordinates = FollowingCoordinates(fitted)
    assert coordinates.count == 3
    sizes = fitted.z[3] + np.array([[-0.4], [0.0], [1.3]])
    slope = fitted.covariance[:3, 3] / fitted.covariance[3, 3]
    here = np.concatenate([np.tile(fitted.z[:3], (3, 1)), sizes], axis=1)
    moved = coordinates.inverse(here)[0][:, :3] - fitted.z[:3]
    np.testing.assert_allclose(moved, (sizes - fitted.z[3]) * slope, atol=1e-4 * np.abs(slope).max())
    conditional = fitted.covariance[:3, :3] - np.outer(slope, fitted.covariance[3, :3])
    np.testing.assert_allclose(coordinates.covariance[:3, :3], conditional, rtol=1e-6, atol=1e-12)
    assert not coordinates.covariance[:3, 3].any()


@pytest.mark.parametrize("one_by_one", [False, True])
def test_the_map_goes_both_ways_and_keeps_volumes(fitted, forgetful, one_by_one: bool) -> None:
    fitted = forgetful if one_by_one else fitted
    coordinates = FollowingCoordinates(fitted, one_by_one)
    assert coordinates.one_by_one == one_by_one
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


def test_one_by_one_nothing_is_left_between_parameters(forgetful) -> None:
    """Of a linear model the coordinates are independent, with the variances that `covariance` states."""
    coordinates = FollowingCoordinates(forgetful, one_by_one=True)
    rng = np.random.default_rng(1)
    z = rng.multivariate_normal(forgetful.z, forgetful.covariance, 4000)
    u = coordinates.forward(z)[0]
    apart = np.corrcoef(u.T) - np.eye(4)
    together = np.corrcoef(z.T) - np.eye(4)
    assert np.abs(together).max() > 0.5
    assert np.abs(apart).max() < 0.3  # few samples tell of the slopes, and not all
    np.testing.assert_allclose(coordinates.covariance, np.diag(np.diag(coordinates.covariance)))
    np.testing.assert_allclose(u.var(axis=0), np.diag(coordinates.covariance), rtol=0.15)


def test_of_noise_with_a_memory_no_samples_can_be_left_out(fitted) -> None:
    assert few_samples(fitted) is None
    coordinates = FollowingCoordinates(fitted, one_by_one=True)
    assert not coordinates.one_by_one


def test_few_samples_count_for_those_between(forgetful) -> None:
    few = few_samples(forgetful)
    assert few is not None
    assert few.whitened.size < forgetful.whitened.size
    np.testing.assert_allclose(few.z, forgetful.z)
    np.testing.assert_allclose(np.diag(few.precision), np.diag(forgetful.precision), rtol=0.5)


def test_what_a_straight_line_is_made_of_only_scales(forgetful) -> None:
    assert scales_only(forgetful).tolist() == [True] * 4


def test_where_readings_count_as_one_all_parameters_may_be_bent(forgetful, fitted) -> None:
    assert HypothesisDensity(forgetful, readings_as_one=3.0).shape().bent == 4
    assert HypothesisDensity(fitted, readings_as_one=3.0).shape().bent == 1


def test_only_effects_are_taken_for_bent(fitted, make_line) -> None:
    shape = HypothesisDensity(fitted).shape()
    assert shape.bent == 1
    assert [b.tolist() for b in shape.blocks()] == [[0, 1, 2], [3]]
    line = make_line()
    plain = HypothesisDensity(fit_hypothesis(line.hypothesis, line.prior_mean, line.noise)).shape()
    assert plain.bent == 0
    assert [b.tolist() for b in plain.blocks()] == [[0, 1, 2]]
