"""How far a published curve is from the nearest logistic curve and straight line, and what follows for measurements.

The measurements are not published, but each lies near its published curve: their distance is the printed RMSE. So by
the triangle inequality, whatever the residuals look like,

    d - RMSE  <=  distance of the measurements from the rival  <=  d + RMSE

with d the least distance of the published curve from any curve of the rival's kind, all as root mean squares over the
same temperatures. Where ``d > 2 RMSE`` the rival fits worse than Eq. (7) on any such measurements; where d is far
below the RMSE the two fit alike.

Which temperatures were measured is not known in the unit of the tables. They are taken to be those at which the
published curve rises from the least to the greatest stiffness that Tables 9 and 10 print, in equal steps.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from pydantic import Field
from scipy.optimize import least_squares
from scipy.special import expit

from sma_bayes.arrays import Floats
from sma_bayes.paper.extremes import TABLE_9, TABLE_10, extremes
from sma_bayes.paper.tables import CellStatus
from sma_bayes.paper.twin import Recipe, curves, recipes
from sma_bayes.quantities import convert
from sma_bayes.runs.schema import DocumentPart, Number, NumberOrNull

GRID: Final = 4001
BEYOND: Final = 3.0
"""How far beyond the twin's temperatures the curve is searched for the printed extremes, in their range."""
WIDTHS, CENTRES = (3.0, 6.0, 12.0), (0.3, 0.5, 0.7, 1.0)
"""Where the search for the nearest logistic begins: its rate times the range, its centre in shares of the range."""


class PublishedDistance(DocumentPart):
    """How far a published curve is from its rivals over the printed range of stiffness [N/cm]."""

    condition: str = Field(description="id of the condition")
    branch: str = Field(description="`heating` or `cooling`")
    least: Number = Field(description="stiffness at the lower end of what was used")
    greatest: Number = Field(description="at the upper end")
    printed_least: Number = Field(description="least stiffness of Tables 9 and 10")
    printed_greatest: Number = Field(description="greatest stiffness there")
    rmse: NumberOrNull = Field(description="printed RMSE; null where it is lost")
    logistic: Number = Field(description="root mean square distance from the nearest logistic curve")
    line: Number = Field(description="the same from the nearest straight line")
    reaches_greatest: bool = Field(description="whether the curve reaches the printed greatest stiffness")


def distances() -> tuple[PublishedDistance, ...]:
    """Distances of the published curves of Tables 3 and 4, whose range of stiffness Tables 9 and 10 print."""
    printed = {**extremes(TABLE_9), **extremes(TABLE_10)}
    return tuple(_distance(r, printed[r.condition.id]) for r in recipes() if r.condition.id in printed)


def _distance(recipe: Recipe, row: dict[str, float]) -> PublishedDistance:
    low, high = (
        float(convert(row[f"stiffness_{end}"], "N/m", "N/cm", what="stiffness")) for end in ("min", "max")
    )
    temperature, stiffness = rising_part(recipe, low, high)
    least, greatest = float(stiffness.min()), float(stiffness.max())
    return PublishedDistance(
        condition=recipe.condition.id,
        branch=recipe.branch.value,
        least=least,
        greatest=greatest,
        printed_least=low,
        printed_greatest=high,
        rmse=None if recipe.rmse.status is CellStatus.DAMAGED else recipe.rmse.value,
        logistic=_rms(stiffness - nearest_logistic(temperature, stiffness)),
        line=_rms(stiffness - nearest_line(temperature, stiffness)),
        reaches_greatest=greatest > 0.99 * high,
    )


def rising_part(recipe: Recipe, low: float, high: float) -> tuple[Floats, Floats]:
    """Where the published curve rises from one stiffness to another, or as far as it does.

    A hump rises before its top, a curve that is unbounded on both sides after its bottom.

    Parameters
    ----------
    recipe : Recipe
    low, high : float
        [N/cm].

    Returns
    -------
    temperature, stiffness : ndarray, shape (m,)
        [arbitrary], [N/cm]; the temperature in equal steps.
    """
    value = {name: cell.value for name, cell in recipe.parameters.items()}
    ends = recipe.temperature.min(), recipe.temperature.max()
    t = np.linspace(ends[0] - BEYOND, ends[1] + BEYOND, GRID)
    k = curves(t, value)["stiffness"]
    place = np.arange(t.size)
    rising = place <= np.argmax(k) if value["A2"] < value["B2"] else place >= np.argmin(k)
    inside = np.flatnonzero(rising & (k >= low) & (k <= high))
    t = np.linspace(t[inside[0]], t[inside[-1]], 401)
    return t, curves(t, value)["stiffness"]


def nearest_line(x: Floats, y: Floats) -> Floats:
    """The straight line that is nearest to y in the least-squares sense, at x, shape (n,) [unit of y].

    Examples
    --------
    >>> nearest_line(np.array([0.0, 1.0, 2.0]), np.array([0.0, 3.0, 0.0])).round(9).tolist()
    [1.0, 1.0, 1.0]
    """
    design = np.column_stack([np.ones_like(x), x])
    return np.asarray(design @ np.linalg.lstsq(design, y, rcond=None)[0])


def nearest_logistic(x: Floats, y: Floats) -> Floats:
    """The logistic curve of four parameters that is nearest to y, at x, shape (n,) [unit of y]."""
    span, middle = float(np.ptp(x)), float(x.min())
    scaled = (x - middle) / span

    def residual(p: Floats) -> Floats:
        shape = expit(p[0] * (scaled - p[1]))
        design = np.column_stack([np.ones_like(scaled), shape])
        return np.asarray(y - design @ np.linalg.lstsq(design, y, rcond=None)[0])

    found = [
        least_squares(residual, [width, centre], max_nfev=200)
        for width in WIDTHS
        for centre in CENTRES
    ]  # fmt: skip
    return np.asarray(y - min(found, key=lambda f: f.cost).fun)


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
