"""How a temperature or a modulus changes with frequency: a straight line whose points have errors of their own.

    y_i = a + b x_i + scatter_i + error_i

``x`` is ln f, which is known; ``error_i`` has the standard deviation of the posterior of ``y_i``; ``scatter_i`` has the
same unknown standard deviation for all. Level and slope have flat priors, so that given the scatter they are normal
(A. Gelman et al., Bayesian Data Analysis, 3rd ed., section 14.7); the scatter, with a half-normal prior, is integrated
out on a grid. Of a peak at T_p, y is 1/T_p: the Arrhenius law ln f = const - E/(R T_p) makes b = -R/E.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtr

from sma_bayes.arrays import Floats

GAS_CONSTANT: Final = 8.314462618
"""[J/(mol K)], CODATA 2018, exact."""
ZERO_CELSIUS: Final = 273.15
SCATTER_K: Final = 1.0
"""Standard deviation of the prior of the scatter of temperatures between frequencies [K]: what ASTM E1640 asks of the
measurement of a temperature."""
SCATTER_OF_MODULUS: Final = 0.05
"""The same of the logarithm of a modulus [1]."""
GRID: Final = 400
FARTHEST: Final = 5.0
"""End of the grid of the scatter, in standard deviations of its prior."""


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """Posterior of a straight line: a mixture over the scatter.

    Attributes
    ----------
    weight : ndarray, shape (G,)
        Of each scatter.
    scatter : ndarray, shape (G,)
        [unit of y]
    level, slope : ndarray, shape (G,)
        Means given the scatter; the level is that at `centre`.
    level_sd, slope_sd : ndarray, shape (G,)
    covariance : ndarray, shape (G,)
    centre : float
    """

    weight: Floats
    scatter: Floats
    level: Floats
    slope: Floats
    level_sd: Floats
    slope_sd: Floats
    covariance: Floats
    centre: float

    def probability_above(self, value: float) -> float:
        """That the slope is greater."""
        return float(self.weight @ ndtr((self.slope - value) / self.slope_sd))

    def slope_quantiles(self, levels: Sequence[float]) -> tuple[float, ...]:
        """Quantiles of the slope [unit of y / unit of x]."""
        return tuple(_quantile(self.weight, self.slope, self.slope_sd, p) for p in levels)

    def at(self, x: float, levels: Sequence[float]) -> tuple[float, ...]:
        """Quantiles of the line at one place [unit of y]."""
        away = x - self.centre
        mean = self.level + self.slope * away
        variance = self.level_sd**2 + away**2 * self.slope_sd**2 + 2.0 * away * self.covariance
        return tuple(_quantile(self.weight, mean, np.sqrt(variance), p) for p in levels)

    def scatter_quantiles(self, levels: Sequence[float]) -> tuple[float, ...]:
        """Quantiles of the standard deviation of the scatter [unit of y]."""
        reached = np.cumsum(self.weight) - 0.5 * self.weight
        return tuple(float(np.interp(p, reached, self.scatter)) for p in levels)


def fit_line(x: Floats, y: Floats, sd: Floats, scatter: float) -> Line:
    """Posterior of a straight line through points with errors.

    Parameters
    ----------
    x, y, sd : ndarray, shape (n,)
        At least two different x.
    scatter : float
        Standard deviation of the half-normal prior of the scatter [unit of y].
    """
    tau = (np.arange(GRID) + 0.5) / GRID * FARTHEST * scatter
    centre = float(np.mean(x))
    away = x - centre
    w = 1.0 / (sd**2 + tau[:, None] ** 2)
    s0, s1, s2 = w.sum(axis=1), w @ away, w @ away**2
    determinant = s0 * s2 - s1**2
    t0, t1 = w @ y, w @ (away * y)
    level = (s2 * t0 - s1 * t1) / determinant
    slope = (s0 * t1 - s1 * t0) / determinant
    left = y - level[:, None] - slope[:, None] * away
    log_weight = (
        0.5 * np.log(w).sum(axis=1)
        - 0.5 * (w * left**2).sum(axis=1)
        - 0.5 * np.log(determinant)
        - 0.5 * (tau / scatter) ** 2
    )
    weight = np.exp(log_weight - log_weight.max())
    return Line(
        weight / weight.sum(), tau, level, slope, np.sqrt(s2 / determinant), np.sqrt(s0 / determinant),
        -s1 / determinant, centre,
    )  # fmt: skip


def _quantile(weight: Floats, mean: Floats, sd: Floats, level: float) -> float:
    low, high = float(np.min(mean - 12.0 * sd)), float(np.max(mean + 12.0 * sd))
    return float(
        brentq(lambda v: float(weight @ ndtr((v - mean) / sd)) - level, low, high, xtol=1e-300, rtol=1e-12)
    )


@dataclass(frozen=True, slots=True)
class Activation:
    """Shift of a temperature with frequency, and the apparent activation energy that would give it.

    Attributes
    ----------
    shift : tuple of float
        Quantiles at 5, 50 and 95 % of the shift per decade of frequency [K].
    energy : tuple of float or None
        The same of the apparent activation energy [J/mol]; None where zero shift, and so infinity, is among them.
    least : float
        Energy of which a positive one is greater with a probability of 95 %, given that it is positive [J/mol].
    probability_rises : float
        That the temperature rises with frequency [1].
    scatter : tuple of float
        Quantiles of the standard deviation of the scatter between frequencies [K].
    """

    shift: tuple[float, float, float]
    energy: tuple[float, float, float] | None
    least: float
    probability_rises: float
    scatter: tuple[float, float, float]


LEVELS: Final = (0.05, 0.5, 0.95)


def arrhenius(frequency: Floats, temperature: Floats, sd: Floats) -> Activation:
    """Apparent activation energy from temperatures at several frequencies.

    Parameters
    ----------
    frequency : ndarray, shape (n,)
        [Hz], of at least two different values.
    temperature, sd : ndarray, shape (n,)
        Of a peak or midpoint [degC], and the standard deviation of its posterior [K].

    Notes
    -----
    An energy is positive where the temperature rises with frequency. Its interval is that of the slope ``b = -R/E``,
    turned over; where that holds zero, the energies form no interval.
    """
    kelvin = temperature + ZERO_CELSIUS
    middle = float(np.mean(kelvin))
    line = fit_line(np.log(frequency), 1.0 / kelvin, sd / kelvin**2, SCATTER_K / middle**2)
    slopes = line.slope_quantiles(LEVELS)
    per_decade = -(middle**2) * float(np.log(10.0))
    shift = tuple(per_decade * s for s in reversed(slopes))
    energy = None
    if slopes[0] > 0.0 or slopes[2] < 0.0:
        energy = tuple(sorted(-GAS_CONSTANT / s for s in slopes))
    below = 1.0 - line.probability_above(0.0)
    steepest = line.slope_quantiles((0.05 * below,))[0]
    scatter = tuple(middle**2 * s for s in line.scatter_quantiles(LEVELS))
    return Activation(
        (shift[0], shift[1], shift[2]),
        None if energy is None else (energy[0], energy[1], energy[2]),
        -GAS_CONSTANT / steepest,
        below,
        (scatter[0], scatter[1], scatter[2]),
    )
