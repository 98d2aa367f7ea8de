"""Stiffness against temperature as a table that a controller interpolates in."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.assess.draws import RecordDraws
from sma_bayes.assess.path import path_remark
from sma_bayes.fitting.curves import quantiles
from sma_bayes.studies.card.schema import TabulatedQuantiles

LEVELS: Final = (0.05, 0.5, 0.95)
_BETWEEN: Final = 15
"""Temperatures between two rows at which interpolation is compared with the curve."""


def tabulated(draws: RecordDraws, points: int) -> TabulatedQuantiles | None:
    """Table of the stiffness of one record over the temperatures that were measured; None where it is not finite.

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
    if not (np.isfinite(values).all() and np.isfinite(error)):
        return None
    low, middle, high = (tuple(row.tolist()) for row in values)
    return TabulatedQuantiles(
        condition=draws.condition.id,
        branch=draws.branch.value,
        quantity=draws.quantities["stiffness"],
        unit=draws.units["stiffness"],
        temperature_unit=draws.units["temperature"],
        first=float(temperature[0]),
        step=float((temperature[-1] - temperature[0]) / (points - 1)),
        points=points,
        interpolation_error=error,
        relative_error=relative,
        caution=remark.message if remark.kind in ("constant_load", "constant_displacement") else "",
        temperature=tuple(temperature.tolist()),
        q05=low,
        median=middle,
        q95=high,
    )


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
