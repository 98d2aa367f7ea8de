"""Stiffness against temperature as a table that a controller interpolates in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.assess.draws import RecordDraws
from sma_bayes.assess.path import path_remark
from sma_bayes.fitting.curves import quantiles

LEVELS: Final = (0.05, 0.5, 0.95)
_BETWEEN: Final = 15
"""Temperatures between two rows at which interpolation is compared with the curve."""


@dataclass(frozen=True, slots=True, eq=False)
class TabulatedStiffness:
    """Quantiles of a stiffness at even temperatures.

    Attributes
    ----------
    condition, branch, quantity, unit, temperature_unit : str
    temperature : ndarray, shape (m,)
    values : ndarray, shape (3, m)
        5 %, 50 % and 95 % [unit].
    error, relative : float
        Largest error of linear interpolation of any of the three [unit], and over the median there [1].
    caution : str
        What the slope means on the rig, where it is not that of the spring.
    """

    condition: str
    branch: str
    quantity: str
    unit: str
    temperature_unit: str
    temperature: Floats
    values: Floats
    error: float
    relative: float
    caution: str

    @property
    def step(self) -> float:
        """From one temperature to the next."""
        return float((self.temperature[-1] - self.temperature[0]) / (self.temperature.size - 1))


def tabulated(draws: RecordDraws, points: int) -> TabulatedStiffness:
    """Table of the stiffness of one record over the temperatures that were measured.

    Parameters
    ----------
    draws : RecordDraws
        Of a record that has a stiffness.
    points : int
        Rows.
    """

    def at(temperature: Floats) -> Floats:
        return quantiles(draws.curve("stiffness", temperature), LEVELS, axis=0)

    temperature = np.linspace(draws.coldest, draws.hottest, points)
    values = at(temperature)
    error, relative = interpolation_error(at, temperature, values)
    spread = {c: float(np.median(draws.theta[:, i[0]])) for c, i in draws.posterior.layout[0].noise.items()}
    remark = path_remark(draws.record, spread)
    return TabulatedStiffness(
        draws.condition.id, draws.branch.value, draws.quantities["stiffness"], draws.units["stiffness"],
        draws.units["temperature"], temperature, values, error, relative,
        remark.message if remark.kind in ("constant_load", "constant_displacement") else "",
    )  # fmt: skip


def interpolation_error(
    at: Callable[[Floats], Floats], temperature: Floats, values: Floats
) -> tuple[float, float]:
    """Largest error of linear interpolation, and over the magnitude of the middle row there.

    Parameters
    ----------
    at : callable
        Temperatures (k,) to rows (3, k).
    temperature : ndarray, shape (m,)
    values : ndarray, shape (3, m)

    Examples
    --------
    >>> t = np.array([0.0, 1.0])
    >>> [round(e, 3) for e in interpolation_error(lambda x: np.stack([x**2] * 3), t, np.stack([t**2] * 3))]
    [0.25, 15.0]
    """
    fine = np.linspace(temperature[0], temperature[-1], (temperature.size - 1) * (_BETWEEN + 1) + 1)
    exact = at(fine)
    read = np.stack([np.interp(fine, temperature, row) for row in values])
    off = np.abs(read - exact).max(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.where(off > 0.0, off / np.abs(exact[1]), 0.0)
    return float(off.max()), float(np.nanmax(relative[1:-1]))
