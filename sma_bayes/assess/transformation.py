"""Transformation temperatures As, Af, Ms and Mf by the tangent rule, with their intervals.

Start and finish of a transformation are where the tangent at the steepest point of the curve crosses the tangents to
the straight parts before and after it. ASTM E3097 (sections 5.4 and 5.8) takes them from strain against temperature
under constant force, or from displacement where a spring was tested. Here the rule is applied to each curve of the
posterior instead of to the measurements, so that no line is laid by eye and each temperature has an interval.

For the sigmoid of Eqs. (2) and (4) the crossings have a closed form, ``A3 - 2/A2`` and ``A3 + 2/A2``: the plateaus
are level, and the tangent at the midpoint has the slope ``A1 A2/4`` and half the span to climb on either side. At
them 11.9 % and 88.1 % of the span have passed. A slope that is common to both plateaus changes nothing in that.

Beside the curve of a model may stand what it misses. Its slope at an end of the sweep may be that of a phase or of a
transformation that is not over; each draw goes on one way or the other (`sma_bayes.assess.unfinished`).

Where the model has two stages, each has a start and a finish: the rule is applied to the curve of one alone, between
the line of its phase and the plateau that the stages have in common. The other stage than that of As and Af, or Mf and
Ms, is called that of the R-phase, as in NiTi; the curve by itself doesn't tell what phase it is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from sma_bayes.arrays import Floats
from sma_bayes.assess.unfinished import Unfinished, unfinished
from sma_bayes.fitting.curves import CurveDraws, interval_where_defined
from sma_bayes.fitting.fit import Fit
from sma_bayes.records.types import Branch, Record

Curve = Callable[[Floats], Floats]
"""Curves of N draws: temperatures of shape (m,) or (N, m) to values of shape (N, m)."""
CurveOfStage = Callable[..., Floats]
"""The same, with `stage` for the curve of one stage alone."""

NAMES = {Branch.HEATING: ("As", "Af"), Branch.COOLING: ("Mf", "Ms")}
"""What the lower and the upper crossing are called."""
R_PHASE = {Branch.HEATING: ("Rs", "Rf"), Branch.COOLING: ("Rf", "Rs")}
"""And those of the stage between martensite and R-phase on heating, austenite and R-phase on cooling."""
STAGES = {
    Branch.HEATING: (R_PHASE[Branch.HEATING], NAMES[Branch.HEATING]),
    Branch.COOLING: (NAMES[Branch.COOLING], R_PHASE[Branch.COOLING]),
}
"""Both stages of a transformation in two, the one at lower temperature first."""
MEANING = {
    "As": "austenite start", "Af": "austenite finish", "Ms": "martensite start", "Mf": "martensite finish",
    "Rs": "R-phase start", "Rf": "R-phase finish",
}  # fmt: skip

MAX_OUTSTANDING_SHARE = 0.05
"""A plateau counts as measured where at most this share of the transformation is outstanding at that end."""
LEAST_SHARE_OF_DRAWS = 0.95
"""Share of the draws in which that must hold."""
MOST_LEFT_AT_CROSSING = 0.5
"""Share of the transformation that may be left, or be over, where tangents cross: 12 % on a sigmoid, up to 40 % on
measured curves of one step. Where more is, the tangent of the plateau is that of another part of the curve."""
LEAST_SAMPLES_OF_TRANSITION = 3
"""Samples between start and finish from which the steepest part counts as measured."""

_COARSE, _FINE, _PASSES = 193, 33, 3
_HALF_WAY_POINTS = 801
_SEARCH_MARGIN = 0.5
"""How far beyond the measured range the steepest point is looked for [widths of that range]."""
_DOUBLINGS = 12
_STEP = 1e-3
"""Half the length of the chord that tells the slope at a given place [widths of the measured range]."""
_CROSSING_TOLERANCE = 1e-4
"""A crossing has settled where a tangent laid twice as far out moves it by less than this [widths of the range]."""

_FLAT_TOLERANCE = 1e-9
"""A curve that at its steepest would rise by less than this share of its values over the whole search is flat."""
_PARALLEL_TOLERANCE = 1e-6
"""Lines whose slopes differ by less than this share are parallel: a straight curve has no transformation."""


@dataclass(frozen=True, slots=True, eq=False)
class Tangents:
    """What the tangent rule gives for each of N curves; NaN where a curve has no such tangent.

    Attributes
    ----------
    lower, upper : ndarray, shape (N,)
        Temperatures at which the steepest tangent crosses those of the plateaus below and above it.
    middle : ndarray, shape (N,)
        Temperature of the steepest point.
    missing_below, missing_above : ndarray, shape (N,)
        Share of the transformation that is outstanding at either end of the measured range [1]: distance of the curve
        from the tangent of the plateau, over the distance of the two plateaus' tangents at the steepest point.
    below, above : Plateau
        Tangents of the plateaus.
    """

    lower: Floats
    upper: Floats
    middle: Floats
    missing_below: Floats
    missing_above: Floats
    below: Plateau
    above: Plateau


@dataclass(frozen=True, slots=True, eq=False)
class Temperature:
    """One transformation temperature of one record.

    Attributes
    ----------
    name, meaning, unit, channel : str
        `channel` is the one whose curve was used.
    draws : ndarray, shape (N,)
        A value for each draw of the posterior [unit]; NaN where the rule gives none.
    outstanding : float
        Share of the transformation that the sweep leaves out at that end, median [1].
    samples : int
        Measurements between start and finish.
    within_data : bool
        Whether the measurements support both tangents, see `MAX_OUTSTANDING_SHARE` and `LEAST_SAMPLES_OF_TRANSITION`;
        otherwise the temperature is an extrapolation of the model.
    """

    name: str
    meaning: str
    unit: str
    channel: str
    draws: Floats
    outstanding: float
    samples: int
    within_data: bool

    @property
    def defined(self) -> float:
        """Share of the draws for which the rule gives a temperature [1]."""
        return float(np.mean(np.isfinite(self.draws)))

    @property
    def interval(self) -> dict[str, float]:
        """``q05``, ``median`` and ``q95`` of the draws that have one; NaN where none has."""
        return interval_where_defined(self.draws)


def transformation_channel(record: Record) -> str | None:
    """Channel that the rule is applied to: displacement as in the standard, else force; None where there is neither."""
    return next((c for c in ("displacement", "force") if c in record.channels), None)


def transformation_temperatures(fit: Fit, record: int = 0) -> tuple[Temperature, ...]:
    """Start and finish of the transformation of one record, lower temperature first.

    Parameters
    ----------
    fit : Fit
    record : int
        Which of the records that share the posterior.

    Returns
    -------
    tuple of Temperature
        As and Af of a heating branch, Mf and Ms of a cooling branch; of a model with two stages Rs and Rf as well, and
        As to Ms of the other stage alone. Empty where neither displacement nor force was measured.
    """
    r = fit.records[record]
    channel = transformation_channel(r)
    if channel is None:
        return ()
    return temperatures_of_draws(fit.curves(record), channel)


def temperatures_of_draws(curves: CurveDraws, channel: str) -> tuple[Temperature, ...]:
    """Start and finish of the transformation on the curves of a posterior, of each of its stages, lowest first."""
    record = curves.posterior.records[curves.record]
    if curves.posterior.model.stages == 1:
        parts: list[tuple[int | None, tuple[str, str]]] = [(None, NAMES[record.branch])]
    else:
        parts = list(enumerate(STAGES[record.branch]))
    curve, guide = curves_beyond(curves, channel)
    found: list[Temperature] = []
    for stage, names in parts:
        guide_of_stage = None if guide is None else partial(guide, stage=stage)
        found += temperatures_of_curves(partial(curve, stage=stage), record, channel, guide_of_stage, names)
    return tuple(found)


def curves_beyond(curves: CurveDraws, channel: str) -> tuple[CurveOfStage, CurveOfStage | None]:
    """Curves of a channel as they go on beyond the sweep, and those that guide `tangents` where they wiggle."""
    curve: CurveOfStage = partial(curves.curve, channel)
    beyond = unfinished(curves, channel)
    if beyond is not None:
        curve = partial(_with_what_is_beyond, curve, beyond)
    return curve, partial(curves.with_mean_discrepancy().curve, channel) if curves.weights else None


def _with_what_is_beyond(
    curve: CurveOfStage, beyond: Unfinished, temperature: Floats, stage: int | None = None
) -> Floats:
    return curve(temperature, stage=stage) + beyond.at(temperature)


def temperatures_of_curves(
    curve: Curve,
    r: Record,
    channel: str,
    guide: Curve | None = None,
    names: tuple[str, str] | None = None,
) -> tuple[Temperature, ...]:
    """Start and finish of the transformation on any curves of a record, lower temperature first.

    Parameters
    ----------
    curve : callable
        Curves of N draws.
    r : Record
    channel : str
        Which channel they are of.
    guide : callable, optional
        See `tangents`.
    names : tuple of str, optional
        Of the lower and the upper one; by default those of a transformation in one stage.
    """
    found = tangents(curve, float(r.temperature.min()), float(r.temperature.max()), guide)
    between = 0
    if np.isfinite(found.lower).any() and np.isfinite(found.upper).any():
        low, high = np.nanmedian(found.lower), np.nanmedian(found.upper)
        between = int(np.sum((r.temperature > low) & (r.temperature < high)))
    ends = ((found.lower, found.missing_below), (found.upper, found.missing_above))
    return tuple(
        Temperature(
            name,
            MEANING[name],
            r.units["temperature"],
            channel,
            draws,
            float(np.nanmedian(missing)) if np.isfinite(missing).any() else float("nan"),
            between,
            bool(
                between >= LEAST_SAMPLES_OF_TRANSITION
                and np.mean(missing <= MAX_OUTSTANDING_SHARE) >= LEAST_SHARE_OF_DRAWS
            ),
        )
        for name, (draws, missing) in zip(names or NAMES[r.branch], ends, strict=True)
    )


def tangents(curve: Curve, low: float, high: float, guide: Curve | None = None) -> Tangents:
    """Apply the tangent rule to curves.

    The tangents of the plateaus are laid where the curve has become straight: ever further out, until the crossing
    stays where it is. A curve that never becomes straight, such as a parabola, has none, and neither has one that is
    not half-way to the plateau where they cross, as where a further step lies between.

    Parameters
    ----------
    curve : callable
        Of any model, effects included; it is evaluated beyond the measured range, too.
    low, high : float
        Ends of the measured range.
    guide : callable, optional
        Curves on which the steepest point is looked for, by default the same. The steepest point of a curve that
        wiggles as far as the measurements allow is steeper than that of the curve that was measured; where draws of a
        discrepancy wiggle, their mean tells the place, and each draw its own slope there.

    Examples
    --------
    >>> import numpy as np
    >>> found = tangents(lambda t: np.tanh((t - np.array([[50.0]])) / 4.0), 20.0, 80.0)
    >>> found.lower.round(3), found.upper.round(3)
    (array([46.]), array([54.]))
    """
    width = high - low
    middle, steepest = _steepest(guide or curve, low - _SEARCH_MARGIN * width, high + _SEARCH_MARGIN * width)
    value = curve(middle[:, None])[:, 0]
    if guide is not None:
        step = _STEP * width
        ends = curve(middle[:, None] + np.array([-step, step]))
        steepest = (ends[:, 1] - ends[:, 0]) / (2.0 * step)
    below, above = (_plateau(curve, middle, value, steepest, side * width) for side in (-1.0, 1.0))
    jump = np.abs(above.at(middle) - below.at(middle))
    below, above = (_that_is_reached(curve, line, jump) for line in (below, above))
    ends = curve(np.array([low, high]))
    with np.errstate(divide="ignore", invalid="ignore"):
        missing = [
            np.abs(ends[:, i] - line.at(t)) / jump
            for i, (line, t) in enumerate(((below, low), (above, high)))
        ]
    return Tangents(below.crossing, above.crossing, middle, missing[0], missing[1], below, above)


def half_way(curve: Curve, low: float, high: float, guide: Curve | None = None) -> Floats:
    """Temperature (N,) at which each curve is in the middle between the tangents of its plateaus; see `tangents`.

    Of several such temperatures it is the one nearest to the steepest point; NaN where a curve has no such tangents,
    or is not half-way between start and finish.

    Examples
    --------
    >>> import numpy as np
    >>> half_way(lambda t: np.tanh((t - np.array([[50.0]])) / 4.0) + 0.01 * t, 20.0, 80.0).round(3)
    array([50.])
    """
    found = tangents(curve, low, high, guide)
    margin = _SEARCH_MARGIN * (high - low)
    t = np.linspace(low - margin, high + margin, _HALF_WAY_POINTS)
    half = _nearest_zero(t, curve(t) - found.below.middle_line(found.above, t), found.middle)
    return np.where((half > found.lower) & (half < found.upper), half, np.nan)


def _nearest_zero(t: Floats, y: Floats, place: Floats) -> Floats:
    """Temperatures (N,) at which y (N, m) is zero, of several that nearest to a place (N,); NaN where there is none."""
    row, left = np.nonzero(y[:, :-1] * y[:, 1:] <= 0.0)
    first, second = y[row, left], y[row, left + 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        zero = t[left] + (t[1] - t[0]) * first / (first - second)
    distance = np.abs(zero - place[row])
    nearest_last = np.lexsort((-distance, row))
    nearest_last = nearest_last[np.isfinite(distance[nearest_last])]
    out = np.full(len(y), np.nan)
    out[row[nearest_last]] = zero[nearest_last]
    return out


@dataclass(frozen=True, slots=True, eq=False)
class Plateau:
    """Tangent to a plateau, ``value + slope (T - place)``, and where the steepest tangent crosses it; each (N,)."""

    place: Floats
    value: Floats
    slope: Floats
    crossing: Floats

    def at(self, temperature: Floats | float) -> Floats:
        """Values (N,) at one temperature, or one of each curve."""
        line = self.value + self.slope * (temperature - self.place)
        return np.asarray(np.where(np.isfinite(self.crossing), line, np.nan))

    def middle_line(self, other: Plateau, temperature: Floats) -> Floats:
        """Values (N, m) in the middle between this and another at m temperatures."""
        first, slope = temperature[0], 0.5 * (self.slope + other.slope)
        at_first = 0.5 * (self.at(first) + other.at(first))
        return np.asarray(at_first[:, None] + slope[:, None] * (temperature - first))


def _steepest(curve: Curve, low: float, high: float) -> tuple[Floats, Floats]:
    """Temperature (N,) and slope (N,) where each curve is steepest; NaN where that is at an end of the range."""
    t = np.linspace(low, high, _COARSE)
    y = curve(t)
    place, slope, inside = _steepest_chord(t, y)
    inside &= np.abs(slope) * (high - low) > _FLAT_TOLERANCE * np.abs(y).max(axis=-1)
    half = 1.5 * (t[1] - t[0])
    for _ in range(_PASSES):
        near = place[:, None] + half * np.linspace(-1.0, 1.0, _FINE)
        place, slope, _ = _steepest_chord(near, curve(near))
        half *= 3.0 / (_FINE - 1)
    return np.where(inside, place, np.nan), np.where(inside, slope, np.nan)


def _steepest_chord(t: Floats, y: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Middle and slope of the steepest of the chords between neighbours, and whether it is neither first nor last."""
    slopes = np.diff(y, axis=-1)
    slopes /= np.diff(t, axis=-1)
    best = np.argmax(np.abs(slopes), axis=-1)
    row = np.arange(len(y))
    t = np.broadcast_to(t, y.shape)
    inside = (best > 0) & (best < slopes.shape[-1] - 1)
    return 0.5 * (t[row, best] + t[row, best + 1]), slopes[row, best], inside


def _that_is_reached(curve: Curve, line: Plateau, jump: Floats) -> Plateau:
    """A plateau without the crossings at which a curve is not yet half-way to it from the other one."""
    with np.errstate(divide="ignore", invalid="ignore"):
        left = np.abs(curve(line.crossing[:, None])[:, 0] - line.at(line.crossing)) / jump
        return replace(line, crossing=np.where(left > MOST_LEFT_AT_CROSSING, np.nan, line.crossing))


def _plateau(curve: Curve, middle: Floats, value: Floats, steepest: Floats, reach: float) -> Plateau:
    """Tangent to the plateau on one side of the steepest point; a negative `reach` looks below it."""
    step = 0.01 * abs(reach)
    side = np.sign(reach)
    crossing = place = level = slope = np.full(middle.shape, np.nan)
    open_still = np.isfinite(middle)
    for _ in range(_DOUBLINGS):
        before = crossing
        at = np.where(open_still, middle + reach, place)
        y = curve(at[:, None] + np.array([-step, step]))
        place, level, slope = at, y.mean(axis=-1), (y[:, 1] - y[:, 0]) / (2.0 * step)
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = middle + (level - slope * (place - middle) - value) / (steepest - slope)
            apart = np.abs(steepest - slope) > _PARALLEL_TOLERANCE * np.abs(steepest)
            open_still = open_still & ~(
                apart & (np.abs(crossing - before) <= 100.0 * _CROSSING_TOLERANCE * step)
            )
        if not open_still.any():
            break
        reach *= 2.0
    right = ~open_still & (side * (crossing - middle) > 0.0)
    return Plateau(place, level, slope, np.where(right, crossing, np.nan))
