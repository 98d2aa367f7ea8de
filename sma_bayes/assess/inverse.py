"""The inverse question: the temperatures at which a curve has a wanted value, and how sure that is.

Each draw of the posterior is a curve. Where a curve passes the wanted value is a temperature of that draw; over all
draws these temperatures have a distribution. It is not the same as the set of temperatures at which the value is met
within a tolerance with a stated probability: that one is what a controller may aim at, and may well be empty. Eq. (7)
can be a hump, so that a stiffness is met twice, once rising and once falling, or not at all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from sma_bayes.arrays import Floats

Curve = Callable[[Floats], Floats]
"""Curves of N draws: temperatures of shape (m,) or (N, m) to values of shape (N, m)."""

SEARCH_POINTS = 401
"""Temperatures at which curves are searched for passages: so many where they were measured, so many on either side."""
REFINED_POINTS = 201
"""Further temperatures about each passage, so that a short stretch between two of the others is not missed."""
SIGNIFICANT_STANDARD_ERRORS = 3.0
"""Standard errors of a probability from which on it is less than another [1]."""
FEW_PASSAGES = 4
"""More passages than these, as a curve with two humps has, tell that curves stay near the value and wind about it."""
_BISECTIONS = 50


Direction = Literal["rising", "falling"]


@dataclass(frozen=True, slots=True, eq=False)
class Passage:
    """Where curves pass a value.

    Attributes
    ----------
    direction : str
        ``rising`` or ``falling`` with temperature.
    draws : ndarray, shape (N,)
        Temperature at which each curve does; NaN where it does not.
    """

    direction: Direction
    draws: Floats

    @property
    def probability(self) -> float:
        """Share of the curves that pass the value so [1]."""
        return float(np.mean(np.isfinite(self.draws)))


@dataclass(frozen=True, slots=True)
class Stretch:
    """Temperatures from `low` to `high`.

    Attributes
    ----------
    low, high : float
    low_error, high_error : float
        How far other draws of the same posterior would put these ends elsewhere; 0 at an end of what was searched.
    """

    low: float
    high: float
    low_error: float = 0.0
    high_error: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Met:
    """How surely a value between two bounds is met, temperature by temperature.

    Attributes
    ----------
    temperature, probability : ndarray, shape (m,)
        Share of the curves that lie between the bounds [1].
    draws : int
        How many curves that is a share of; 0 where it is exact.
    """

    temperature: Floats
    probability: Floats
    draws: int = 0

    def at_least(self, probability: float) -> tuple[Stretch, ...]:
        """Stretches in which the probability is that or more; ends between two temperatures are interpolated.

        Two of them are one where between them it is less by no more than the chance of the draws makes it.
        """
        t, p = self.temperature, self.probability - probability
        chance = np.sqrt(probability * (1.0 - probability) / self.draws) if self.draws else 0.0
        runs: list[tuple[int, int]] = []
        for first, last in _runs(p >= 0.0):
            if runs and np.min(p[runs[-1][1] : first + 1]) >= -SIGNIFICANT_STANDARD_ERRORS * chance:
                first = runs.pop()[0]
            runs.append((first, last))
        out = []
        for first, last in runs:
            low = t[first] if first == 0 else _root(t[first - 1 : first + 1], p[first - 1 : first + 1])
            high = t[last] if last == t.size - 1 else _root(t[last : last + 2], p[last : last + 2])
            errors = (self._error(p, first, -1, chance), self._error(p, last, 1, chance))
            out.append(Stretch(float(low), float(high), *errors))
        return tuple(out)

    def _error(self, excess: Floats, end: int, out: int, chance: float) -> float:
        """Standard error of an end: half of what lies between one standard error more and one less."""
        beyond, within = excess[end::out], excess[end::-out]
        if beyond.size == 1 or not chance:
            return 0.0
        less = int(np.argmax(beyond < -chance)) if np.any(beyond < -chance) else beyond.size - 1
        more = int(np.argmax(within > chance)) if np.any(within > chance) else 0
        return float(0.5 * abs(self.temperature[end + out * less] - self.temperature[end - out * more]))

    @property
    def best(self) -> tuple[float, float]:
        """Temperature at which the value is met most surely, and that probability: the middle where several tie."""
        top = float(self.probability.max())
        first, last = max(
            _runs(self.probability >= top),
            key=lambda run: self.temperature[run[1]] - self.temperature[run[0]],
        )
        return 0.5 * float(self.temperature[first] + self.temperature[last]), top


def search_grid(low: float, high: float, beyond: float = 0.0) -> Floats:
    """Temperatures at which curves are searched for passages, shape (m,).

    Parameters
    ----------
    low, high : float
        Ends of the measured range; within it they are even.
    beyond : float
        How far to go beyond it on either side, in steps that grow.

    Examples
    --------
    >>> t = search_grid(20.0, 80.0, 500.0)
    >>> float(t[0]), float(t[-1]), int(((t >= 20.0) & (t <= 80.0)).sum())
    (-480.0, 580.0, 401)
    """
    t = np.linspace(low, high, SEARCH_POINTS)
    if beyond <= 0.0:
        return t
    away = np.geomspace(min(float(t[1] - t[0]), beyond), beyond, SEARCH_POINTS)
    return np.unique(np.concatenate([low - away, t, high + away]))


def passages(curve: Curve, t: Floats, value: float) -> tuple[Passage, ...]:
    """Temperatures at which each curve passes a value.

    Parameters
    ----------
    curve : callable
    t : ndarray, shape (m,)
        Temperatures, rising; two passages between neighbours are not seen.
    value : float
        Wanted value [unit of the curve].

    Returns
    -------
    tuple of Passage
        Rising ones first; another of the same direction for curves that pass the value more than once so.

    Examples
    --------
    >>> hump = lambda t: 9.0 - (t - np.array([[50.0], [51.0]])) ** 2
    >>> [(p.direction, p.draws.round(6).tolist()) for p in passages(hump, search_grid(40.0, 60.0), 5.0)]
    [('rising', [48.0, 49.0]), ('falling', [52.0, 53.0])]
    """
    above = curve(t) >= value
    out = []
    directions: tuple[Direction, Direction] = ("rising", "falling")
    changes = (~above[:, :-1] & above[:, 1:], above[:, :-1] & ~above[:, 1:])
    for direction, change in zip(directions, changes, strict=True):
        count = change.cumsum(axis=1)
        for number in range(1, int(count.max(initial=0)) + 1):
            here = change & (count == number)
            cell = np.argmax(here, axis=1)
            place = _halved(curve, t[cell], t[cell + 1], value, rising=direction == "rising")
            out.append(Passage(direction, np.where(here.any(axis=1), place, np.nan)))
    return tuple(out)


def _halved(curve: Curve, low: Floats, high: Floats, value: float, *, rising: bool) -> Floats:
    """Passages within cells, one for each curve, by halving."""
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        before = (curve(middle[:, None])[:, 0] < value) == rising
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return 0.5 * (low + high)


def finer(t: Floats, near: Floats) -> Floats:
    """Temperatures with more of them about passages, so that no short stretch is missed between two.

    Parameters
    ----------
    t : ndarray, shape (m,)
    near : ndarray
        Temperatures of passages.
    """
    if not near.size:
        return t
    cell = float(np.diff(t).min())
    about = np.linspace(near.min() - cell, near.max() + cell, REFINED_POINTS)
    passing = np.unique(np.quantile(near, np.linspace(0.0, 1.0, REFINED_POINTS)))
    # between the passages, since at one of them rounding decides whether its curve has the value
    every = np.concatenate([t, about, 0.5 * (passing[1:] + passing[:-1])])
    return np.unique(np.clip(every, t[0], t[-1]))


def met(temperature: Floats, values: Floats, bounds: tuple[float, float]) -> Met:
    """How surely curves lie between two bounds.

    Parameters
    ----------
    temperature : ndarray, shape (m,)
    values : ndarray, shape (N, m)
        Curves at these temperatures.
    bounds : tuple of float
        Least and greatest value that will do, infinite where there is none [unit of the curves].
    """
    inside = (values >= bounds[0]) & (values <= bounds[1])
    return Met(temperature, np.mean(inside, axis=0), len(values))


def _runs(inside: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> Iterator[tuple[int, int]]:
    """First and last index of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(np.int8)))
    for first, after in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        yield first, after - 1


def _root(t: Floats, p: Floats) -> float:
    """Where a straight line through two points is zero."""
    return float(t[0] - p[0] * (t[1] - t[0]) / (p[1] - p[0]))
