"""The simulated rig keeps the laws that it states, checked in ways of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, least_squares
from scipy.special import expit

from sma_bayes.records.types import Branch
from sma_bayes.simulated.rig import DEFAULT_ALLOY, DEFAULT_RIG, Setup, logged, ramp

SETUP = Setup(1.5)


def test_spring_and_bias_spring_pull_alike() -> None:
    alloy, rig = SETUP.alloy, SETUP.rig
    for share in (0.0, 0.3, 1.0):
        k = alloy.austenite + share * (alloy.martensite - alloy.austenite)
        cold = SETUP.preload / alloy.martensite + alloy.stroke

        def apart(x: float, k: float = k, cold: float = cold, share: float = share) -> float:
            spring = k * (cold - alloy.stroke * share - x)
            return spring - SETUP.preload - rig.bias * x - rig.bias_growth * x**2

        found = float(SETUP.displacement(np.array([share]))[0])
        assert found == pytest.approx(brentq(apart, -1e-9, 0.1), abs=1e-9)


@pytest.mark.parametrize("branch", list(Branch))
def test_the_share_is_what_its_own_force_makes_of_it(branch: Branch) -> None:
    alloy, t = SETUP.alloy, np.linspace(25.0, 95.0, 60)
    left = 0.0 if branch is Branch.HEATING else 0.02
    share = SETUP.share(t, branch, left)
    mean = alloy.heating if branch is Branch.HEATING else alloy.cooling
    force = SETUP.curves(t, branch, left)["force"]
    expected = left + (1 - left) * expit((mean + alloy.shift * force - t) / alloy.spread)
    np.testing.assert_allclose(share, expected, atol=1e-12)


def test_the_stiffness_is_the_slope_of_force_over_displacement() -> None:
    t = np.linspace(45.0, 75.0, 20_001)
    found = SETUP.curves(t, Branch.HEATING)
    slope = np.gradient(found["force"]) / np.gradient(found["displacement"])
    np.testing.assert_allclose(found["stiffness"][1:-1], slope[1:-1], rtol=1e-5)


def test_the_temperature_obeys_the_heat_balance() -> None:
    rig = DEFAULT_RIG
    grid = np.linspace(rig.ambient - 1, 110, 4001)
    slope = np.gradient(SETUP.share(grid, Branch.HEATING), grid)

    def rate(t: float, y: np.ndarray) -> list[float]:
        power = rig.resistance * rig.current**2 * max(0.0, 1.0 - abs(2.0 * t / rig.period - 1.0))
        capacity = rig.capacity - rig.latent * float(np.interp(y[0], grid, slope))
        return [(power - rig.loss * (y[0] - rig.ambient)) / capacity]

    course = ramp(SETUP)
    up = course.time[: course.hottest]
    exact = solve_ivp(rate, (0.0, float(up[-1])), [rig.ambient], t_eval=up, rtol=1e-8, max_step=1.0).y[0]
    assert np.abs(course.temperature[: course.hottest] - exact).max() < 0.15
    assert 90.0 < course.temperature.max() < 100.0
    assert course.temperature[-1] < course.temperature.min() + 10.0


def test_no_curve_is_the_published_sigmoid() -> None:
    """The best sigmoid misses force and displacement by far more than rounding, by less than their noise."""
    t = np.linspace(25.0, 95.0, 200)
    for channel, sd in (("force", DEFAULT_RIG.force_sd), ("displacement", DEFAULT_RIG.displacement_sd)):
        y = SETUP.curves(t, Branch.HEATING)[channel]

        def missed(p: np.ndarray, y: np.ndarray = y) -> np.ndarray:
            return p[0] + p[1] * expit(p[2] * (t - p[3])) - y

        start = [y.min(), np.ptp(y), 0.4, t[np.argmin(np.abs(y - 0.5 * (y.min() + y.max())))]]
        rms = float(np.sqrt(np.mean(least_squares(missed, start, x_scale=np.abs(start) + 1e-6).fun ** 2)))
        assert 1e-3 * np.ptp(y) < rms < sd


def test_instruments_err_as_they_are_said_to() -> None:
    """Sample moments of a long record, at five standard errors."""
    rig = replace(DEFAULT_RIG, period=80_000.0, rest=0.0)
    course = ramp(Setup(1.5, DEFAULT_ALLOY, rig))
    log = logged(course, np.random.default_rng(3))
    n = course.time.size
    noise = log.force - course.channels()["force"]
    rho = np.exp(-rig.interval / rig.memory)
    independent = n * (1 - rho**2) / (1 + rho**2)
    assert np.std(noise) == pytest.approx(rig.force_sd, rel=5 / np.sqrt(2 * independent))
    assert np.corrcoef(noise[1:], noise[:-1])[0, 1] == pytest.approx(rho, abs=5 * np.sqrt((1 - rho**2) / n))
    apart = log.temperature - course.temperature
    assert np.mean(apart) == pytest.approx(log.offset, abs=5 * rig.temperature_sd / np.sqrt(n) + 0.01)
    assert np.std(apart) == pytest.approx(rig.temperature_sd, rel=0.05)
