"""The space of parameters: what is fixed, what is sampled, what is drawn."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from sma_bayes.errors import PriorError
from sma_bayes.parameters.distributions import Gamma, LogNormal, Normal, Uniform
from sma_bayes.parameters.space import Parameter, ParameterSpace


@pytest.fixture
def space() -> ParameterSpace:
    return ParameterSpace(
        (
            Parameter("A1", "m", "", LogNormal(0.02, 0.5)),
            Parameter("A4", "m", "", Normal(0.0, 1.0), fixed=0.003),
            Parameter("A3", "degC", "", Normal(45.0, 5.0)),
            Parameter("B1", "N", "", LogNormal(2.0, 0.3, -1.0)),
            Parameter("phi", "1", "", Uniform(-1.0, 1.0)),
            Parameter("nu", "1", "", Gamma(2.0, 10.0)),
        )
    )


def test_fixed_parameters_stand_in_theta_but_not_in_z(space: ParameterSpace) -> None:
    assert space.dimension == 5
    assert space.names == ("A1", "A4", "A3", "B1", "phi", "nu")
    np.testing.assert_array_equal(space.free_index, [0, 2, 3, 4, 5])
    theta = space.constrain(np.zeros((4, 5)))
    np.testing.assert_array_equal(theta, np.tile([1.0, 0.003, 0.0, -1.0, 0.0, 1.0], (4, 1)))


def test_all_fixed_leaves_nothing_to_sample() -> None:
    space = ParameterSpace((Parameter("B4", "N", "", Normal(0.0, 1.0), fixed=0.0),))
    z = space.draw(np.random.default_rng(0), 3)
    assert z.shape == (3, 0)
    np.testing.assert_array_equal(space.log_prior(z), np.zeros(3))
    np.testing.assert_array_equal(space.constrain(z), np.zeros((3, 1)))


def test_draws_have_the_centre_and_the_spread_that_are_claimed(space: ParameterSpace) -> None:
    """Four standard errors in ten numbers: a false alarm in 1600 runs, and the seed is fixed."""
    n = 40_000
    z = space.draw(np.random.default_rng(2), n)
    assert z.shape == (n, 5)
    sd = space.prior_sd()
    median_error = 4.0 * 1.2533 * sd / np.sqrt(n)
    # the logarithm of a gamma is skew: its median is blunter
    assert np.all(np.abs(np.median(z, axis=0) - space.prior_centre()) < 1.3 * median_error)
    np.testing.assert_allclose(z.std(axis=0), sd, rtol=0.03)
    np.testing.assert_allclose(sd[:3], [0.5, 5.0, 0.3])
    np.testing.assert_allclose(sd[3], 1.0, rtol=0.01)  # the probit of a uniform is standard normal


def test_draws_are_decided_by_the_generator(space: ParameterSpace) -> None:
    first, second = (space.draw(np.random.default_rng(5), 10) for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_any_leading_shape_will_do(space: ParameterSpace) -> None:
    z = space.draw(np.random.default_rng(1), 12).reshape(3, 4, 5)
    assert space.log_prior(z).shape == (3, 4)
    assert space.derivative(z).shape == (3, 4, 5)
    assert space.constrain(z).shape == (3, 4, 6)
    assert float(space.log_prior(z)[1, 2]) == pytest.approx(float(space.log_prior(z[1, 2])), rel=1e-15)


def test_a_name_is_given_once(space: ParameterSpace) -> None:
    with pytest.raises(PriorError, match="twice"):
        ParameterSpace((*space.parameters, space.parameters[0]))


def test_an_unknown_name_lists_near_ones(space: ParameterSpace) -> None:
    assert space.index("B1") == 3
    with pytest.raises(PriorError, match="no parameter 'B11'") as caught:
        space.index("B11")
    assert "'B1'" in str(caught.value)


def test_a_space_pickles(space: ParameterSpace) -> None:
    z = space.draw(np.random.default_rng(1), 6)
    again = pickle.loads(pickle.dumps(space))
    np.testing.assert_array_equal(again.log_prior(z), space.log_prior(z))
    np.testing.assert_array_equal(again.constrain(z), space.constrain(z))
