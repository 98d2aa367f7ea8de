"""Straight lines through points with errors: against quadrature and scipy's weighted least squares, and coverage."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.optimize import curve_fit
from scipy.stats import halfnorm, norm

from sma_bayes.studies.modulus.shift import (
    GAS_CONSTANT,
    SCATTER_K,
    ZERO_CELSIUS,
    arrhenius,
    fit_line,
)

FREQUENCY = np.array([0.1, 0.5, 2.0, 10.0])
ENERGY = 350e3


def peaks(energy: float, at_one_hertz: float = 60.0, frequency: np.ndarray = FREQUENCY) -> np.ndarray:
    """Temperatures of an Arrhenius law [degC]."""
    slope = -GAS_CONSTANT / energy
    return np.asarray(1.0 / (1.0 / (at_one_hertz + ZERO_CELSIUS) + slope * np.log(frequency)) - ZERO_CELSIUS)


def test_the_slope_is_that_of_quadrature_over_slope_and_scatter() -> None:
    """With the level integrated out by hand: given scatter and slope it is normal under its flat prior."""
    x, y, sd = np.array([0.0, 1.0, 2.5]), np.array([0.1, 1.4, 2.2]), np.array([0.2, 0.1, 0.3])
    scatter = 0.4

    def density(slope: float, tau: float) -> float:
        v = sd**2 + tau**2
        left = y - slope * x
        w = 1.0 / v
        level = np.sum(w * left) / np.sum(w)
        logs = -0.5 * np.sum((left - level) ** 2 / v) - 0.5 * np.sum(np.log(v)) - 0.5 * np.log(np.sum(w))
        return float(np.exp(logs) * halfnorm.pdf(tau, scale=scatter))

    def moment(of: int) -> float:
        return float(dblquad(lambda b, t: b**of * density(b, t), 0.0, 2.0, -4.0, 6.0, epsabs=1e-9)[0])

    total, first, second = (moment(k) for k in range(3))
    line = fit_line(x, y, sd, scatter)
    mean = line.weight @ line.slope
    assert mean == pytest.approx(first / total, abs=2e-3)
    variance = line.weight @ (line.slope_sd**2 + line.slope**2) - mean**2
    assert variance == pytest.approx(second / total - (first / total) ** 2, rel=0.01)


def test_quantiles_are_those_of_one_normal_where_the_scatter_is_known_to_be_small() -> None:
    x, y, sd = np.log(FREQUENCY), 3.0 + 0.5 * np.log(FREQUENCY), np.full(4, 1e-2)
    line = fit_line(x, y, sd, 1e-9)
    by_hand = 1e-2 / np.sqrt(np.sum((x - x.mean()) ** 2))
    low, middle, high = line.slope_quantiles((0.05, 0.5, 0.95))
    assert middle == pytest.approx(0.5, abs=1e-12)
    assert high - low == pytest.approx(2.0 * norm.ppf(0.95) * by_hand, rel=1e-6)
    assert line.at(float(x.mean()), (0.5,))[0] == pytest.approx(y.mean(), abs=1e-12)


def test_the_energy_is_that_of_weighted_least_squares() -> None:
    """Where the errors of the temperatures are far above the scatter that is expected, scipy's weights are ours."""
    rng = np.random.default_rng(4)
    sd = np.array([6.0, 9.0, 7.0, 5.0])
    temperature = peaks(ENERGY) + 0.3 * sd * rng.standard_normal(4)
    found = arrhenius(FREQUENCY, temperature, sd)
    kelvin = temperature + ZERO_CELSIUS

    def law(x: np.ndarray, level: float, energy: float) -> np.ndarray:
        return np.asarray(level - GAS_CONSTANT * x / energy)

    (_, energy), covariance = curve_fit(
        law, np.log(FREQUENCY), 1.0 / kelvin, p0=[3e-3, ENERGY], x_scale=[1e-3, ENERGY], sigma=sd / kelvin**2,
        absolute_sigma=True, method="trf",
    )  # fmt: skip
    per_decade = kelvin.mean() ** 2 * np.log(10.0) * GAS_CONSTANT
    assert found.shift[1] == pytest.approx(per_decade / energy, rel=0.02)
    wanted = per_decade * np.sqrt(covariance[1, 1]) / energy**2
    assert found.shift[2] - found.shift[0] == pytest.approx(2.0 * norm.ppf(0.95) * wanted, rel=0.05)


def test_an_exact_shift_gives_its_energy_and_none_gives_no_energy() -> None:
    sd = np.full(4, 0.05)
    found = arrhenius(FREQUENCY, peaks(ENERGY), sd)
    assert found.energy is not None
    assert found.energy[1] == pytest.approx(ENERGY, rel=1e-3)
    assert found.probability_rises > 0.999
    falls = arrhenius(FREQUENCY, peaks(-ENERGY), sd)
    assert falls.energy is not None
    assert falls.energy[2] < 0.0
    level = arrhenius(FREQUENCY, np.array([60.0, 60.1, 59.9, 60.0]), sd)
    assert level.energy is None
    assert level.shift[0] < 0.0 < level.shift[2]
    assert level.least > ENERGY


def test_two_frequencies_tell_a_shift_as_far_as_the_scatter_is_believed() -> None:
    two = np.array([1.0, 10.0])
    found = arrhenius(two, np.array([60.0, 60.0]), np.full(2, 1e-3))
    assert found.shift[2] == pytest.approx(-found.shift[0], rel=1e-9)
    assert 0.5 * SCATTER_K < found.shift[2] < 4.0 * SCATTER_K


def test_intervals_of_the_shift_hold_the_truth_as_often_as_they_say() -> None:
    """Of 400 lines with scatter from its prior, 90 % intervals: 90 +- 5 %, a false alarm once in 1,000 runs."""
    rng = np.random.default_rng(12)
    truth = -GAS_CONSTANT / ENERGY
    held = 0
    for _ in range(400):
        sd = rng.uniform(0.1, 1.0, 4)
        scatter = abs(rng.normal(0.0, SCATTER_K))
        temperature = peaks(ENERGY) + np.hypot(sd, scatter) * rng.standard_normal(4)
        low, _, high = arrhenius(FREQUENCY, temperature, sd).shift
        middle = np.mean(temperature) + ZERO_CELSIUS
        held += bool(low <= -(middle**2) * np.log(10.0) * truth <= high)
    assert 0.85 <= held / 400 <= 0.95
