"""The map between A, B and the coordinates in which conditions are compared."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from sma_bayes.assess.draws import RecordDraws
from sma_bayes.errors import MeasurementError
from sma_bayes.records.types import Condition
from sma_bayes.studies.conditions.coordinates import coordinates_for

X = ("displacement",)
A, B = Condition("a", load=1.0), Condition("b", load=2.0)


@pytest.mark.parametrize("channels", [("displacement",), ("force", "displacement"), ("stiffness",)])
@pytest.mark.parametrize("span", [0.02, -0.02])
def test_round_trip_and_jacobian(
    make_draws: Callable[..., RecordDraws], channels: tuple[str, ...], span: float
) -> None:
    records = [make_draws(c, channels=channels, A1=span, A4=level) for c, level in ((A, 0.01), (B, 0.012))]
    c = coordinates_for(records)
    theta = records[0].curve_theta[:50]
    phi = c.to_coordinates(theta)
    np.testing.assert_allclose(c.to_parameters(phi), theta, rtol=1e-10, atol=1e-12)
    step = 1e-6
    columns = [
        (c.to_parameters(phi[0] + step * e) - c.to_parameters(phi[0] - step * e)) / (2 * step)
        for e in np.eye(phi.shape[1])
    ]
    _, log_volume = np.linalg.slogdet(np.stack(columns))
    logs = np.log(np.abs(theta[0][c.signs != 0.0])).sum()
    assert log_volume == pytest.approx(logs, abs=1e-5), "volumes change by the logarithms only"


def test_log_prior_is_that_of_the_sampled_coordinates(make_draws: Callable[..., RecordDraws]) -> None:
    record = make_draws(A)
    space = record.posterior.space
    own = np.array(record.theta)
    noise = sum(
        space.parameters[i].prior.log_density(own[:, i]) + np.log(own[:, i]) for i in (8, 9)
    )  # the coordinates are logarithms and shears of unit determinant, as those that were sampled
    found = coordinates_for([record]).log_prior(record.priors, record.curve_theta)
    np.testing.assert_allclose(found + noise, space.log_prior(space.unconstrain(own)), rtol=1e-10)


def test_the_level_is_taken_at_the_end_that_differs_less(make_draws: Callable[..., RecordDraws]) -> None:
    zeroed_hot = [make_draws(c, channels=X, A1=a, A4=-a) for c, a in ((A, 0.02), (B, 0.03))]
    assert coordinates_for(zeroed_hot).hot == ("A4",)
    assert "A4 + A1" in coordinates_for(zeroed_hot).labels
    zeroed_cold = [make_draws(c, channels=X, A1=a, A4=0.0) for c, a in ((A, 0.02), (B, 0.03))]
    assert coordinates_for(zeroed_cold).hot == ()


def test_prior_moments_agree_with_closed_form(make_draws: Callable[..., RecordDraws]) -> None:
    record = make_draws(A)
    c = coordinates_for([record])
    mean, covariance = c.prior_moments(record.priors)
    at = c.labels.index("ln B2 - ln A2")
    assert mean[at] == pytest.approx(np.log(0.35 / 0.30), abs=0.01)
    assert covariance[at, at] == pytest.approx(2.0, rel=0.03)
    at = c.labels.index("(A3 + B3)/2")
    assert covariance[at, at] == pytest.approx(15.0**2 / 2, rel=0.03)


def test_characteristic_scales(make_draws: Callable[..., RecordDraws]) -> None:
    record = make_draws(A, error=0.0)
    c = coordinates_for([record])
    found = dict(zip(c.labels, c.characteristic_scales([record]), strict=True))
    assert found["ln B1 - ln A1"] == 1.0
    assert found["A4"] == pytest.approx(0.02)
    ten_to_ninety = np.sqrt(4.394 / 0.30 * 4.394 / 0.35)
    assert found["B3 - A3"] == found["(A3 + B3)/2"] == pytest.approx(ten_to_ninety, rel=1e-3)


def test_curves_that_rise_and_fall_are_refused(make_draws: Callable[..., RecordDraws]) -> None:
    with pytest.raises(
        MeasurementError, match="A1 is positive in some and negative in others of a-heating, b-heating"
    ):
        coordinates_for([make_draws(A), make_draws(B, A1=-0.02)])
