"""Start and finish of the transformation of each sweep, by tangents to its own curve.

The rule of ASTM E3097 (`sma_bayes.assess.transformation`) is applied to the curve of the sweep in each draw: the common
one with what the sweep has of its own. The steepest place is that of the expected curve, carried along by the four
numbers, since draws wiggle. Tangents to the plateaus are those at the ends of what was measured of the sweep, where its
curve goes on straight, as a phase does, or levels out, as a transformation does that is not over: each draw one way or
the other, by its slope at that end (`sma_bayes.assess.unfinished.probability_unfinished`).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.assess.unfinished import probability_unfinished
from sma_bayes.studies.cycles.sweep_draws import SweepDraws

GRID_POINTS: Final = 801
"""Temperatures at which the steepest slope of the expected curve is looked for."""
CHORD: Final = 2e-3
"""Length of the chord that tells a slope [widths of the sweep]."""


def start_and_finish(sweep: SweepDraws) -> Floats:
    """Lower and upper crossing of tangents in each draw of a sweep.

    Parameters
    ----------
    sweep : SweepDraws

    Returns
    -------
    ndarray, shape (S, 2)
        [unit of temperature]; NaN where there is none: where the curve is steepest at an end of the sweep, or a line
        crosses the steepest tangent on the wrong side.
    """
    low, high = sweep.ends
    chord = CHORD * (high - low)
    steepest, expected_slope, span = _steepest(sweep, low, high)
    middle = sweep.carried(steepest)
    ends = np.broadcast_to(np.array([low, low + chord, high - chord, high]), (len(middle), 4))
    y = sweep.curve(np.column_stack([ends, middle - 0.5 * chord, middle + 0.5 * chord]))
    value, tangent = y[:, 4:].mean(axis=1), (y[:, 5] - y[:, 4]) / chord
    found = np.empty((len(middle), 2))
    for i, (end, outwards, at, inside) in enumerate(((low, -1.0, 0, 1), (high, 1.0, 3, 2))):
        slope = outwards * (y[:, at] - y[:, inside]) / chord
        length = span / (4.0 * abs(expected_slope))
        with np.errstate(divide="ignore", invalid="ignore"):
            levelled = (y[:, at] + outwards * slope * length - value) / tangent
            straight = (y[:, at] + slope * (middle - end) - value) / (tangent - slope)
        in_direction = np.sign(expected_slope) * slope * (high - low) / span
        goes_on = sweep.rng.random(slope.size) >= probability_unfinished(in_direction)
        away = np.where(goes_on, straight, levelled)
        found[:, i] = np.where(outwards * away > 0.0, middle + away, np.nan)
    return found


def _steepest(sweep: SweepDraws, low: float, high: float) -> tuple[float, float, float]:
    """Where the expected curve of a sweep is steepest, its slope there, and its span; NaN where that is at an end."""
    t = np.linspace(low, high, GRID_POINTS)
    curve = sweep.expected().curve(t)[0]
    slopes = np.diff(curve) / np.diff(t)
    i = int(np.argmax(np.abs(slopes)))
    span = float(np.ptp(curve))
    if i in (0, slopes.size - 1) or span == 0.0:
        return float("nan"), float("nan"), float("nan")
    return float(0.5 * (t[i] + t[i + 1])), float(slopes[i]), span
