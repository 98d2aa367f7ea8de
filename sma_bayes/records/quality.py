"""What is wrong with a column: drop-outs, spikes, a clock that runs backwards, digits, clipping, gaps.

Which findings keep rows out and which are only reported:

=====================  ==================================================================
kept out and counted   missing temperature, missing or spoilt channel to fit, drop-out,
                       spike, duplicate row, time running backwards
only reported          quantised, clipped, gap, steps of the load, kelvin, row numbers,
                       repeated time stamps, held samples, restart of the clock, no transformation, narrow sweep,
                       a thermometer that is stuck
=====================  ==================================================================

All functions take plain arrays and return masks or numbers; nothing is changed.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.ndimage import median_filter

from sma_bayes.arrays import Floats, Ints
from sma_bayes.normal import MAD_TO_SD
from sma_bayes.records.segmentation import Mask, first_of_each_reading, noise_sd

SPIKE_SDS = 8.0
"""A spike is this many robust standard deviations off the running median: 1e6 Gaussian samples hold none."""

TEMPERATURE_WINDOW, CHANNEL_WINDOW = 11, 7
"""Readings of the running median; a spike is shorter than half of it."""

SPIKE_WINDOW_SHARE = 0.1
"""A channel is searched for spikes where its window spans less than this share of the temperature range."""

GAP_STEPS, GAP_JUMPS, GAP_SHARE = 10.0, 5.0, 0.05
"""A gap is a step of time of ten usual ones, or a step of temperature of a twentieth of the sweep and of five
large ones (a large one is exceeded by a tenth of the steps)."""


LEVEL_STEP, LEVEL_ROWS = 0.05, 5
"""A load was changed where it steps by more than this share of its largest value and stays for so many rows."""

COLDEST_KELVIN, HOTTEST_KELVIN = 250.0, 650.0
"""Readings that all lie between these are more likely kelvin than degrees Celsius: rigs begin near room temperature."""


def looks_like_kelvin(temperature: Floats) -> bool:
    """Whether readings in degrees Celsius are more likely in kelvin, see `COLDEST_KELVIN`.

    Examples
    --------
    >>> looks_like_kelvin(np.array([295.0, 370.0])), looks_like_kelvin(np.array([25.0, 300.0]))
    (True, False)
    """
    return bool(temperature.min() >= COLDEST_KELVIN and temperature.max() <= HOTTEST_KELVIN)


def are_row_numbers(values: Floats) -> bool:
    """Whether values count the rows: 0, 1, 2 and so on, or from 1.

    Examples
    --------
    >>> are_row_numbers(np.arange(1.0, 30.0)), are_row_numbers(np.arange(20.0, 90.0))
    (True, False)
    """
    return bool(values.size > 2 and values[0] in (0.0, 1.0) and np.all(np.diff(values) == 1.0))


def digit(values: Floats, most: float = 0.5) -> float:
    """Smallest step by which a quantised channel changes.

    Parameters
    ----------
    values : ndarray, shape (n,)
    most : float
        Different values that there may be, as a share of all of them.

    Returns
    -------
    float
        Zero where the values are not multiples of one step [unit of the values].

    Examples
    --------
    >>> digit(np.round(np.linspace(0.0, 3.0, 500), 1))
    0.1
    """
    levels = np.unique(values[np.isfinite(values)])
    if levels.size < 3 or levels.size > most * values.size:
        return 0.0
    steps = np.diff(levels)
    resolution = 1e-9 * max(abs(levels[0]), abs(levels[-1]))
    steps = steps[steps > resolution]
    step = float(np.percentile(steps, 5)) if steps.size else 0.0
    if step <= 0:
        return 0.0
    ratio = steps / step
    multiple = np.abs(ratio - np.round(ratio)) < 0.02 + 2.0 * resolution / step
    return float(f"{step:.6g}") if np.mean(multiple) > 0.95 else 0.0


def zero_dropouts(values: Floats, *, steps: float = 2.0, follow_up: bool = True) -> Mask:
    """Readings of exactly zero that stand for a missing value.

    A run of exact zeros is compared with the straight line between its neighbours. It is a drop-out where the
    line is further from zero than three digits, four standard deviations of the noise and ``steps`` times the
    median step from reading to reading. Once a record has shown one, the display is known to drop out, and
    every run of zeros further than 1.5 digits from its line is one too.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Finite, in order of acquisition.
    steps : float
        Clearance in usual steps.
    follow_up : bool
        Whether the first drop-out makes near-by zeros suspect.

    Returns
    -------
    ndarray of bool, shape (n,)

    Examples
    --------
    >>> zero_dropouts(np.array([-9.0, -8.0, -7.0, 0.0, -5.0, -4.0, -3.0, -2.0])).nonzero()[0].tolist()
    [3]
    """
    zero = values == 0.0
    found = np.zeros(values.size, dtype=bool)
    if not zero.any() or zero.all():
        return found
    others = np.flatnonzero(~zero)
    readings = values[others][first_of_each_reading(values[others])]
    step = digit(values[others])
    usual = float(np.median(np.abs(np.diff(readings)))) if readings.size > 1 else 0.0
    clear = max(3.0 * step, 4.0 * noise_sd(values[others]), steps * usual)
    away = np.abs(np.interp(np.flatnonzero(zero), others, values[others]))
    run = np.cumsum(np.diff(np.flatnonzero(zero), prepend=-2) > 1) - 1
    furthest = np.zeros(int(run[-1]) + 1)
    np.maximum.at(furthest, run, away)
    certain = furthest > clear
    if follow_up and certain.any():
        certain = furthest > 1.5 * step
    found[zero] = certain[run]
    return found


def spikes(values: Floats, window: int, against: Floats | None = None) -> Mask:
    """Samples far off the running median of their neighbours (Hampel's test, on distinct readings).

    A spike is off by more than eight times the scale: the largest of the robust standard deviation of the
    residuals in the 25 readings around, the same over the whole record, the noise and one digit. It is also
    off by more than the signal usually moves, step by step, in half a window, so that the tip of a sweep is
    none, and its value is not held for long. A running median follows steps and ramps; neither is a spike.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Finite, in order of acquisition.
    window : int
        Readings of the running median, odd; a spike is shorter than half of it.
    against : ndarray, shape (n,), optional
        Temperature. Given, a sample is judged only where the temperature changes by less than a tenth of
        its range over the window: a sparse record may hold a whole transformation in three samples.

    Returns
    -------
    ndarray of bool, shape (n,)

    References
    ----------
    F. R. Hampel, "The influence curve and its role in robust estimation", J. Am. Stat. Assoc. 69 (1974)
    383-393, doi:10.1080/01621459.1974.10482962.
    """
    first = first_of_each_reading(values)
    readings = values[first]
    if readings.size < 2 * window:
        return np.zeros(values.size, dtype=bool)
    off = np.abs(readings - median_filter(readings, size=window, mode="mirror"))
    overall = max(MAD_TO_SD * float(np.median(off)), digit(values), noise_sd(values))
    candidate = np.flatnonzero(off > SPIKE_SDS * overall)
    around = np.clip(candidate[:, None] + np.arange(-12, 13), 0, readings.size - 1)
    local = MAD_TO_SD * np.median(off[around], axis=1)
    pace = np.percentile(np.abs(np.diff(readings[around], axis=1)), 60, axis=1)
    least = np.maximum(SPIKE_SDS * np.maximum(local, overall), 0.5 * window * pace)
    length = np.diff(np.r_[first, values.size])
    candidate = candidate[(off[candidate] > least) & (length[candidate] <= window * np.median(length))]
    if against is not None and candidate.size:
        candidate = candidate[_at_one_temperature(against[first], candidate, window)]
    flagged = np.repeat(_back_where_it_was(readings, candidate), length)
    return np.asarray(flagged, dtype=bool)


def _at_one_temperature(temperature: Floats, at: Ints, window: int) -> Mask:
    near = np.clip(at[:, None] + np.arange(window) - window // 2, 0, temperature.size - 1)
    return np.asarray(np.ptp(temperature[near], axis=1) < SPIKE_WINDOW_SHARE * np.ptp(temperature))


def _back_where_it_was(readings: Floats, candidate: Ints) -> Mask:
    """Candidates in runs after which the signal is back: the sides differ by less than half the jump."""
    flagged = np.zeros(readings.size, dtype=bool)
    for run in np.split(candidate, np.flatnonzero(np.diff(candidate) > 1) + 1) if candidate.size else ():
        before, after = readings[max(0, run[0] - 3) : run[0]], readings[run[-1] + 1 : run[-1] + 4]
        sides = [float(np.median(side)) for side in (before, after) if side.size]
        height = abs(float(np.median(readings[run])) - float(np.mean(sides)))
        flagged[run] = np.ptp(sides) < 0.5 * height
    return flagged


def out_of_order(time: Floats) -> tuple[Mask, Ints]:
    """Rows whose time is out of order, and where the clock starts again.

    Around each step back (50 rows on either side) the longest stretch of non-decreasing times is kept, and
    the other rows are out of order. Where one step back alone would cost more than 25 rows, or the clock is
    still behind afterwards, it has started again: all rows are good, and a new stretch begins.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Finite [s].

    Returns
    -------
    bad : ndarray of bool, shape (n,)
    restarts : ndarray of int, shape (k,)
        First rows after a restart.

    Examples
    --------
    >>> bad, again = out_of_order(np.array([0.0, 1.0, 9.0, 2.0, 3.0, 4.0, 5.0]))
    >>> bad.nonzero()[0].tolist(), again.tolist()
    ([2], [])
    """
    bad = np.zeros(time.size, dtype=bool)
    back = np.flatnonzero(np.diff(time) < 0) + 1
    if back.size:
        for group in np.split(back, np.flatnonzero(np.diff(back) > 2 * _ROWS_AROUND_STEP) + 1):
            near = slice(max(0, int(group[0]) - _ROWS_AROUND_STEP), int(group[-1]) + _ROWS_AROUND_STEP)
            astray = ~_longest_non_decreasing(time[near])
            if group.size > 1 or np.count_nonzero(astray) <= _ROWS_AROUND_STEP // 2:
                bad[near] |= astray
    good = np.flatnonzero(~bad)
    return bad, good[1:][np.diff(time[good]) < 0]


_ROWS_AROUND_STEP = 50  # rows on either side of a step back that are looked at


def _longest_non_decreasing(values: Floats) -> Mask:
    """Mask of one longest non-decreasing subsequence (patience sorting)."""
    tails: list[float] = []
    tail_at: list[int] = []
    previous = np.full(values.size, -1, dtype=np.int64)
    for k, value in enumerate(values.tolist()):
        pile = bisect_right(tails, value)
        tails[pile : pile + 1], tail_at[pile : pile + 1] = [value], [k]
        previous[k] = tail_at[pile - 1] if pile else -1
    kept = np.zeros(values.size, dtype=bool)
    at = tail_at[-1] if tail_at else -1
    while at >= 0:
        kept[at] = True
        at = int(previous[at])
    return kept


def repeated_rows(columns: Sequence[Floats], time: Floats | None) -> tuple[Mask, int]:
    """Rows that say again what an earlier row said.

    With a clock a row is a duplicate if an earlier row has the same time and the same value in every column.
    Without one a row is compared with the row before it, and taken for a duplicate only where fewer than 5 %
    of the rows repeat like this; where more do, the channels are refreshed more slowly than they are stored.

    Parameters
    ----------
    columns : sequence of ndarray, shape (n,)
        All columns but time.
    time : ndarray, shape (n,), or None

    Returns
    -------
    duplicate : ndarray of bool, shape (n,)
    held : int
        Rows that repeat the row before them because the channels were held.
    """
    table = np.column_stack(columns)
    table = np.where(np.isnan(table), np.inf, table)  # a missing value equals a missing value
    if time is None:
        same = np.r_[False, np.all(table[1:] == table[:-1], axis=1)]
        count = int(np.count_nonzero(same))
        return (same, 0) if count < 0.05 * same.size else (np.zeros(same.size, dtype=bool), count)
    duplicate = np.zeros(time.size, dtype=bool)
    order = np.argsort(time, kind="stable")
    tie = np.diff(time[order]) == 0
    tied = order[np.r_[tie, False] | np.r_[False, tie]]
    if tied.size:
        keys = np.column_stack([table[tied], time[tied]])
        by_value = np.lexsort(keys.T[::-1])  # stable: of equal rows the earliest comes first
        ranked = keys[by_value]
        duplicate[tied[by_value[1:]]] = np.all(ranked[1:] == ranked[:-1], axis=1)
    return duplicate, 0


@dataclass(frozen=True, slots=True)
class FlatTop:
    """A run of samples at the largest or smallest value of a channel.

    Attributes
    ----------
    start, stop : int
        First sample, and the one after the last, of the longest such run.
    count : int
        Samples at that value.
    value : float
    """

    start: int
    stop: int
    count: int
    value: float


def clipped(values: Floats) -> tuple[FlatTop, ...]:
    """Flat tops and bottoms that look like the end of a sensor's range.

    The signal has its extreme value exactly, in a run of at least five samples and three times longer than
    99 % of all other runs, and it comes into or goes out of that run at half of its usual pace or more, over the
    time of five usual readings. A plateau that is approached slowly is none.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Finite.
    """
    first = first_of_each_reading(values)
    if first.size < 20:
        return ()
    length = np.diff(np.r_[first, values.size])
    readings = values[first]
    pace = max(float(np.median(np.abs(np.diff(readings)))), noise_sd(values), digit(values))
    aside = 5 * int(np.median(length))
    found = []
    for extreme in (readings.max(), readings.min()):
        at = np.flatnonzero(readings == extreme)
        k = int(at[np.argmax(length[at])])
        start, stop = int(first[k]), int(first[k] + length[k])
        others = np.delete(length, at)
        usual = float(np.percentile(others, 99)) if others.size else 0.0
        sides = values[[max(0, start - aside), min(values.size, stop + aside) - 1]]
        if length[k] >= max(5, 3 * usual) and np.abs(sides - extreme).max() > 2.5 * pace:
            found.append(FlatTop(start, stop, int(length[at].sum()), float(extreme)))
    return tuple(found)


def stuck(values: Floats) -> tuple[FlatTop, ...]:
    """Stretches of a sweep in which a thermometer shows one reading and then catches up by a jump.

    At least five samples, three times more than 99 % of all other readings are held for, and left by a jump of half of
    what the sweep usually moves in that time or more. A hold and a coarse display are left by one usual step.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Finite, of one sweep, in order of acquisition.

    Examples
    --------
    >>> sweep = np.linspace(20.0, 80.0, 121)
    >>> sweep[40:50] = sweep[40]
    >>> [(s.start, s.stop, s.value) for s in stuck(sweep)]
    [(40, 50, 40.0)]
    """
    first = first_of_each_reading(values)
    if first.size < 20:
        return ()
    length = np.diff(np.r_[first, values.size])
    pace = abs(float(values[-1] - values[0])) / values.size
    found = []
    for k in np.flatnonzero(length[:-1] >= 5):
        usual = float(np.percentile(np.delete(length, k), 99))
        jump = abs(float(values[first[k + 1]] - values[first[k]]))
        if length[k] > 3 * usual and jump >= 0.5 * pace * float(length[k]):
            start = int(first[k])
            found.append(FlatTop(start, start + int(length[k]), int(length[k]), float(values[start])))
    return tuple(found)


def levels(values: Floats, against: Floats | None = None) -> tuple[FlatTop, ...]:
    """Stretches of a load that was changed in steps.

    Parameters
    ----------
    values : ndarray, shape (n,)
        In order of acquisition.
    against : ndarray, shape (n,), optional
        Temperature. Given, each stretch must cover half of its range: a force that answers to the temperature does not
        stand still while that sweeps.

    Returns
    -------
    tuple of FlatTop
        Two or more, each with its median; empty where the load was not changed, or otherwise than in steps of more than
        `LEVEL_STEP` of its largest value between stretches of at least `LEVEL_ROWS` rows, twenty at most.

    Examples
    --------
    >>> [(s.start, s.stop, s.value) for s in levels(np.repeat([1.0, 1.5], 10))]
    [(0, 10, 1.0), (10, 20, 1.5)]
    """
    there = np.flatnonzero(np.isfinite(values))
    load = values[there]
    if load.size < 2 * LEVEL_ROWS:
        return ()
    ranked = np.sort(load)
    apart = np.flatnonzero(np.diff(ranked) > LEVEL_STEP * float(np.abs(ranked).max()))
    if not apart.size:
        return ()
    level = np.searchsorted(0.5 * (ranked[apart] + ranked[apart + 1]), load)
    cut = np.r_[0, np.flatnonzero(np.diff(level)) + 1, load.size]
    length = np.diff(cut)
    if length.size > 20 or length.min() < LEVEL_ROWS:
        return ()
    found = []
    for a, b in pairwise(int(c) for c in cut):
        if against is not None and np.ptp(against[there[a:b]]) < 0.5 * np.ptp(against[there]):
            return ()
        found.append(FlatTop(int(there[a]), int(there[b - 1]) + 1, b - a, float(np.median(load[a:b]))))
    return tuple(found)


def gaps(time: Floats | None, temperature: Floats) -> Ints:
    """Samples of one sweep that come after a gap.

    Parameters
    ----------
    time : ndarray, shape (n,), or None
        Of one sweep [s].
    temperature : ndarray, shape (n,)
        Of the same sweep.

    Returns
    -------
    ndarray of int, shape (k,)
        They follow a step of time of more than ten usual ones, or a step of temperature of more than a
        twentieth of the sweep and five times what a tenth of the steps exceed.
    """
    if temperature.size < 3:
        return np.empty(0, dtype=np.int64)
    jump = np.abs(np.diff(temperature))
    least = max(GAP_JUMPS * float(np.percentile(jump, 90)), GAP_SHARE * float(np.ptp(temperature)))
    wide = jump > least
    if time is not None:
        step = np.diff(time)
        usual = np.median(step[step > 0]) if np.any(step > 0) else np.inf
        wide |= step > GAP_STEPS * usual
    return np.flatnonzero(wide) + 1
