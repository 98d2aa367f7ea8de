"""Maps between parameters and sampled coordinates: round trips, and the Jacobian that goes with them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st

from sma_bayes.parameters.distributions import Beta, Gamma, LogNormal, Normal, StudentT, Uniform
from sma_bayes.parameters.space import Parameter, ParameterSpace
from sma_bayes.parameters.transforms import Identity, Log, Probit, Transform

bounds = st.floats(-1e3, 1e3).flatmap(
    lambda low: st.floats(1e-3, 1e3).map(lambda width: Probit(low, low + width))
)
transforms = st.one_of(st.just(Identity()), st.sampled_from([Log(1.0), Log(-1.0), Log(1.0, 2.0)]), bounds)
coordinates = st.lists(st.floats(-12.0, 12.0), min_size=1, max_size=5).map(np.array)


@given(transform=transforms, z=coordinates)
def test_there_and_back(transform: Transform, z: np.ndarray) -> None:
    x = transform.constrain(z)
    if isinstance(transform, Probit):  # next to a bound far from zero a double has few digits left
        spare = np.minimum(x - transform.low, transform.high - x)
        z = z[spare > 1e-9 * max(abs(transform.low), abs(transform.high))]
        x = transform.constrain(z)
    np.testing.assert_allclose(transform.unconstrain(x), z, rtol=1e-6, atol=1e-6)


@given(transform=transforms, z=coordinates)
def test_the_jacobian_is_the_derivative(transform: Transform, z: np.ndarray) -> None:
    h = 1e-4
    scale = 1.0
    if isinstance(
        transform, Probit
    ):  # measured from the nearer bound, so that digits of the bound do not matter
        scale = transform.high - transform.low
        transform = Probit(0.0, scale)
        z = -np.abs(z)
    slope = (transform.constrain(z + h) - transform.constrain(z - h)) / (2.0 * h)
    np.testing.assert_allclose(np.log(np.abs(slope)), transform.log_jacobian(z), rtol=1e-7, atol=1e-6)


@given(z=coordinates, sign=st.sampled_from([-1.0, 1.0]))
def test_a_logarithm_keeps_the_sign(z: np.ndarray, sign: float) -> None:
    assert np.all(np.sign(Log(sign).constrain(z)) == sign)


@given(transform=bounds, z=coordinates)
def test_an_interval_is_never_left(transform: Probit, z: np.ndarray) -> None:
    x = transform.constrain(100.0 * z)
    assert np.all((x >= transform.low) & (x <= transform.high))


@pytest.mark.parametrize(
    ("transform", "outside"),
    [(Log(1.0), -1.0), (Log(-1.0), 1.0), (Log(1.0, 2.0), 1.9), (Probit(2.0, 3.0), 1.0), (Probit(2.0, 3.0), 4.0)],
)  # fmt: skip
def test_outside_the_support_there_is_no_coordinate(transform: Transform, outside: float) -> None:
    assert not np.isfinite(transform.unconstrain(np.array(outside)))


def space() -> ParameterSpace:
    priors = (
        Normal(45.0, 5.0), LogNormal(0.02, 1.0), LogNormal(2.0, 0.5, -1.0), Uniform(-1.0, 1.0),
        Gamma(2.0, 10.0), StudentT(4.0, 1.0, 2.0), Beta(2.0, 2.0, 20.0, 80.0),
    )  # fmt: skip
    free = [Parameter(f"p{i}", "1", "", prior) for i, prior in enumerate(priors)]
    return ParameterSpace((*free[:3], Parameter("held", "1", "", Normal(7.0, 1.0), fixed=7.0), *free[3:]))


vectors = st.lists(st.floats(-4.0, 4.0), min_size=7, max_size=7).map(np.array)


@given(z=vectors)
def test_a_space_goes_there_and_back(z: np.ndarray) -> None:
    s = space()
    theta = s.constrain(z)
    assert theta[3] == 7.0
    np.testing.assert_allclose(s.unconstrain(theta), z, rtol=1e-9, atol=1e-9)


@given(z=vectors)
def test_the_prior_of_a_space_is_the_sum_of_its_priors_with_their_jacobians(z: np.ndarray) -> None:
    s = space()
    expected = 0.0
    for p, value in zip(s.free, z, strict=True):
        x = p.prior.transform.constrain(value)
        expected += float(p.prior.log_density(x) + p.prior.transform.log_jacobian(value))
    assert float(s.log_prior(z)) == pytest.approx(expected, rel=1e-10, abs=1e-10)


@given(z=vectors)
def test_the_derivative_of_a_space_is_that_of_its_map(z: np.ndarray) -> None:
    s = space()
    h = 1e-5
    for i in range(7):
        step = np.zeros(7)
        step[i] = h
        up, down = (s.constrain(z + side * step)[s.free_index[i]] for side in (1, -1))
        assert s.derivative(z)[i] == pytest.approx((up - down) / (2 * h), rel=1e-4)
