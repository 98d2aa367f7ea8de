"""True curves of the calibration: their derivatives, their limits, and the published curve nearest to them."""

from __future__ import annotations

import numpy as np
import pytest
from calibration.curves import (
    Curve,
    hardening,
    logistic,
    nearest_published,
    phase_slopes,
    ratio,
    richards,
    tabulated,
    two_steps,
)
from scipy.optimize import minimize

T = np.linspace(20.0, 80.0, 121)
CURVES = {
    "logistic": logistic(2.0, 0.3, 50.0, 1.0),
    "richards": richards(2.0, 0.3, 50.0, 1.0, 0.4),
    "hardening": hardening(2.0, 38.0, 61.0, 1.0, 0.3, 0.5),
    "phase slopes": phase_slopes(2.0, 0.3, 50.0, 1.0, 0.004, -0.007),
    "two steps": two_steps(2.0, 0.3, 50.0, 1.0, 0.15, 14.0, 1.5),
    "tabulated": tabulated(T, np.tanh((T - 50.0) / 6.0)),
    "ratio": ratio(logistic(2.0, 0.3, 50.0, 1.0), logistic(0.02, 0.28, 49.0, 0.0)),
}


@pytest.mark.parametrize("name", CURVES)
def test_the_slope_is_the_derivative(name: str) -> None:
    curve, step = CURVES[name], 1e-5
    t = T + 0.013  # not at a knot or at an end of the hardening
    numerical = (curve.value(t + step) - curve.value(t - step)) / (2.0 * step)
    # where the hardening begins and ends its second derivative is large, where the ratio flattens it is noisy
    assert curve.slope(t) == pytest.approx(numerical, rel=2e-3, abs=1e-5 * np.abs(numerical).max())


def test_richards_is_the_logistic_at_one() -> None:
    assert richards(2.0, 0.3, 50.0, 1.0, 1.0).value(T) == pytest.approx(
        logistic(2.0, 0.3, 50.0, 1.0).value(T)
    )


def test_richards_has_no_symmetry() -> None:
    curve = richards(1.0, 0.3, 50.0, 0.0, 0.4)
    middle = T[np.argmin(np.abs(curve.value(T) - 0.5))]
    d = np.linspace(1.0, 10.0, 10)
    assert np.abs(curve.value(middle + d) + curve.value(middle - d) - 1.0).max() > 0.03


def test_hardening_inverts_its_equation_and_is_flat_outside() -> None:
    start, finish, n1, n2 = 38.0, 61.0, 0.3, 0.5
    s = np.linspace(0.02, 0.98, 25)
    at = start + 0.5 * (finish - start) * (1.0 + s**n1 - (1.0 - s) ** n2)
    assert hardening(1.0, start, finish, 0.0, n1, n2).value(at) == pytest.approx(s, abs=1e-12)
    outside = hardening(1.0, start, finish, 0.0, n1, n2)
    assert outside.value(np.array([10.0, start, finish, 90.0])) == pytest.approx([0.0, 0.0, 1.0, 1.0])
    assert outside.slope(np.array([10.0, 90.0])).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("end", [38.0, 61.0])
def test_hardening_is_continuous_with_its_slope(end: float) -> None:
    curve = hardening(1.0, 38.0, 61.0, 0.0, 0.3, 0.5)
    near = end + np.array([-1e-6, 1e-6])
    assert np.ptp(curve.value(near)) < 1e-5
    assert np.ptp(curve.slope(near)) < 1e-3


def test_phase_slopes_are_those_far_from_the_transformation() -> None:
    curve = phase_slopes(2.0, 0.3, 50.0, 1.0, 0.004, -0.007)
    assert curve.slope(np.array([-200.0, 300.0])) == pytest.approx([0.004, -0.007])
    plain = phase_slopes(2.0, 0.3, 50.0, 1.0, 0.0, 0.0)
    assert plain.value(T) == pytest.approx(logistic(2.0, 0.3, 50.0, 1.0).value(T))


def test_a_second_step_keeps_the_whole_span() -> None:
    curve = two_steps(2.0, 0.3, 50.0, 1.0, 0.15, 14.0, 1.5)
    assert curve.value(np.array([-200.0, 57.0, 300.0])) == pytest.approx([1.0, 2.7, 3.0], abs=0.35)
    assert curve.value(np.array([-200.0, 300.0])) == pytest.approx([1.0, 3.0])


def test_a_table_is_met_and_goes_on_straight() -> None:
    y = np.tanh((T - 50.0) / 6.0) + 0.01 * T
    curve = tabulated(T, y)
    assert curve.value(T) == pytest.approx(y)
    beyond = curve.value(np.array([90.0, 100.0, 110.0]))
    assert np.diff(beyond, 2) == pytest.approx(0.0, abs=1e-12)


def test_the_ratio_is_the_published_stiffness() -> None:
    """Eq. (7) by hand at a temperature: F' = B1 B2 s (1 - s), X' likewise."""
    k = ratio(logistic(2.0, 0.3, 50.0, 1.0), logistic(0.02, 0.25, 50.0, 0.0)).value(np.array([50.0]))
    assert k == pytest.approx([2.0 * 0.3 / (0.02 * 0.25)])


def test_the_nearest_curve_of_a_published_curve_is_itself() -> None:
    found = nearest_published(logistic(-0.02, 0.31, 47.0, 0.005), T[::-1])
    assert list(found.values()) == pytest.approx([-0.02, 0.31, 47.0, 0.005], rel=1e-6)


def test_the_nearest_curve_is_nearest() -> None:
    """Of a two-step curve, against a search that knows nothing of it."""
    curve = CURVES["two steps"]
    found = nearest_published(curve, T)

    def distance(p: np.ndarray) -> float:
        return float(np.sum((logistic(*p).value(T) - curve.value(T)) ** 2))

    best = distance(np.array(list(found.values())))
    rng = np.random.default_rng(0)
    for _ in range(3):
        start = np.array([2.0, 0.25, 51.0, 1.0]) * (1.0 + 0.1 * rng.standard_normal(4))
        assert best <= minimize(distance, start, method="Nelder-Mead", options={"maxiter": 4000}).fun * (
            1 + 1e-6
        )


def test_a_flat_curve_has_finite_parameters() -> None:
    flat = Curve(np.ones_like, np.zeros_like)
    assert np.isfinite(list(nearest_published(flat, T).values())).all()
