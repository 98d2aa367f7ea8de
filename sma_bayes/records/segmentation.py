"""Where a temperature record turns round: from one run to heating and cooling sweeps.

The rule, in order:

1. Repeats of a reading are one reading: a sensor that is refreshed every few samples, or that stands still
   between two digits, tells nothing new in between.
2. The noise of the readings is estimated from their third differences and the length of their path. Where
   it could pass for a turn of the sweep the readings are averaged over a window just wide enough, never over
   more than a quarter of a sweep.
3. A turning point is an extreme after which the temperature comes back by more than a fifth of the range of
   the record, and by more than ten standard deviations of the averaged noise (hysteresis, or zig-zag, rule).
4. Rows in which the temperature stands still at the ends of a sweep are holds, and are cut off but for a few.

For white noise on triangular or sinusoidal sweeps this finds every planted cycle and no other where the noise
is below 3 % of the span of a sweep of four or more readings, or below 10 % of one of fifty or more; the
property tests hold it to that.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter, uniform_filter1d

from sma_bayes.arrays import Floats, Ints
from sma_bayes.normal import MAD_TO_SD

Mask = NDArray[np.bool_]

NOISE_MARGIN = 10.0
"""Turns are at least this many standard deviations of the noise, so that 1e6 rows of noise hold none."""

MAX_SHARE_OF_EXTREMES = 0.45
"""Readings of which a larger share are local extremes show noise rather than sweeps."""

FEWEST_HOLD_ROWS = 5
"""Rows of a hold that stay with a sweep, however few rows the sweep itself has."""

MAX_END_SHARE = 0.15
"""However noisy the temperature, this share of a sweep is the most that counts as near to its end."""

DRIVE_ON_SHARE = 0.05
"""The drive is on above this share of its usual full value (the 90th percentile of its positive values)."""

_THIRD_DIFFERENCE_NORM = math.sqrt(20.0)  # of the weights 1, -3, 3, -1


@dataclass(frozen=True, slots=True)
class Sweep:
    """Rows of one uninterrupted sweep.

    Attributes
    ----------
    start, stop : int
        First row, and the row after the last.
    heating : bool
        Direction.
    """

    start: int
    stop: int
    heating: bool

    @property
    def n(self) -> int:
        """Number of rows."""
        return self.stop - self.start


@dataclass(frozen=True, slots=True, eq=False)
class Smoothed:
    """Temperature with its noise averaged away as far as the search for turning points needs.

    Attributes
    ----------
    values : ndarray, shape (n,)
        One a row [unit of temperature].
    noise : float
        Standard deviation of what noise is left [unit of temperature].
    window : int
        Readings averaged; 1 where nothing was.
    """

    values: Floats
    noise: float
    window: int


def first_of_each_reading(values: Floats) -> Ints:
    """Index of the first sample of each run of equal values.

    Parameters
    ----------
    values : ndarray, shape (n,)

    Returns
    -------
    ndarray of int, shape (m,)

    Examples
    --------
    >>> first_of_each_reading(np.array([1.0, 1.0, 2.0, 2.0, 1.0])).tolist()
    [0, 2, 4]
    """
    if values.size == 0:
        return np.empty(0, dtype=np.int64)
    return np.flatnonzero(np.r_[True, values[1:] != values[:-1]])


def noise_sd(values: Floats) -> float:
    """Robust standard deviation of the white noise on a smooth signal.

    The median absolute third difference of the distinct readings, scaled for Gaussian noise. A trend up to
    the second order cancels, and half of the readings may be anything. Noise that is correlated over many
    readings is seen only in part.

    Parameters
    ----------
    values : ndarray, shape (n,)

    Returns
    -------
    float
        Zero for fewer than eight distinct readings [unit of the values].

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> round(noise_sd(np.linspace(0.0, 50.0, 4000) + rng.normal(0.0, 0.2, 4000)), 2)
    0.2
    """
    readings = values[first_of_each_reading(values)]
    if readings.size < 8:
        return 0.0
    third = np.abs(np.diff(readings, 3))
    return float(MAD_TO_SD * np.median(third) / _THIRD_DIFFERENCE_NORM)


def smooth(temperature: Floats, turn_fraction: float = 0.2) -> Smoothed:
    """Average the temperature just enough for turns to stand out from noise.

    With noise ``s``, range ``r`` and turns of ``f r`` a window of ``(10 s / (f r))**2`` readings leaves turns
    of ten standard deviations. It is never wider than a quarter of the median sweep, which is measured with
    turns of half the range, too large for noise to feign.

    Parameters
    ----------
    temperature : ndarray, shape (n,)
        Finite [unit of temperature].
    turn_fraction : float
        Smallest turn over the range of the record [1].
    """
    first = first_of_each_reading(temperature)
    readings = temperature[first]
    spread = float(np.ptp(readings)) if readings.size else 0.0
    turns = turning_points(readings, 0.5 * spread)
    sweep = int(np.median(np.diff(turns))) if turns.size > 1 else readings.size
    noise = max(_noise_between_turns(readings, turns), _lasting_noise(readings, sweep // 32))
    wanted = (NOISE_MARGIN * noise / (turn_fraction * spread)) ** 2 if spread > 0 else 1.0
    window = min(math.ceil(wanted) + 1, sweep // 4)
    window = max(1, window - (window + 1) % 2)
    if window > 1:
        readings = uniform_filter1d(readings, window, mode="nearest")
    length = np.diff(np.r_[first, temperature.size])
    return Smoothed(np.repeat(readings, length), noise / math.sqrt(window), window)


def _noise_between_turns(readings: Floats, turns: Ints) -> float:
    """Noise of the readings, but no more than explains how much longer their path is than its sweeps.

    A sweep of a handful of readings bends at every other one, so its third differences are no noise. But its
    path is no longer than from turn to turn, whereas noise of deviation s that outdoes the steps of the sweep
    makes steps of mean length 2 s / sqrt(pi). Where the readings turn more often than every other time (white
    noise does so two times of three) they are noise in the first place.
    """
    noise = noise_sd(readings)
    step = np.diff(readings)
    if step.size < 2 or np.mean(step[1:] * step[:-1] < 0) > MAX_SHARE_OF_EXTREMES:
        return noise
    ends = readings[np.r_[0, turns, readings.size - 1]]
    excess = float(np.abs(step).sum() - np.abs(np.diff(ends)).sum())
    return min(noise, 0.5 * math.sqrt(math.pi) * max(0.0, excess) / step.size)


def _lasting_noise(readings: Floats, longest: int) -> float:
    """White noise whose averages would be as noisy as those of the readings.

    Averages of ``b`` readings have noise ``s / sqrt(b)`` where the noise is white, and more where it lasts.
    The largest ``sqrt(b)`` times the noise of the averages is taken over b = 2, 4, 8, ... up to ``longest``.
    """
    noise, block = 0.0, 2
    while block <= longest:
        means = readings[: readings.size // block * block].reshape(-1, block).mean(axis=1)
        noise, block = max(noise, math.sqrt(block) * noise_sd(means)), 2 * block
    return noise


def turning_points(values: Floats, threshold: float) -> Ints:
    """Extremes that are followed by a return of more than a threshold, and the ends of the sweeps they bound.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Finite.
    threshold : float
        Smallest return that counts as a turn [unit of the values].

    Returns
    -------
    ndarray of int, shape (k,)
        Alternating minima and maxima; empty where no change exceeds the threshold. The search takes one step
        a turn, not one a sample.

    Examples
    --------
    >>> turning_points(np.array([5.0, 0.0, 4.0, 3.5, 9.0, 1.0, 2.0]), 2.0).tolist()
    [0, 1, 4, 5]
    """
    up, rise = _reversal(values, 0, -1.0, threshold)
    down, fall = _reversal(values, 0, 1.0, threshold)
    if rise is None and fall is None:
        return np.empty(0, dtype=np.int64)
    rising = fall is None or (rise is not None and rise < fall)
    turns = [up if rising else down]
    while True:
        extreme, confirmed = _reversal(values, turns[-1], 1.0 if rising else -1.0, threshold)
        turns.append(extreme)
        if confirmed is None:
            return np.array(turns, dtype=np.int64)
        rising = not rising


def _reversal(values: Floats, start: int, sign: float, threshold: float) -> tuple[int, int | None]:
    """Largest of ``sign * values`` before it falls back by the threshold, and where it has fallen back."""
    best, best_at = -math.inf, start
    for low, high in _growing_chunks(start, values.size):
        chunk = sign * values[low:high]
        highest = np.maximum(np.maximum.accumulate(chunk), best)
        back = np.flatnonzero(highest - chunk > threshold)
        stop = int(back[0]) + 1 if back.size else chunk.size
        at = int(np.argmax(chunk[:stop]))
        if chunk[at] > best:
            best, best_at = float(chunk[at]), low + at
        if back.size:
            return best_at, low + stop - 1
    return best_at, None


def _growing_chunks(start: int, stop: int, size: int = 256) -> Iterator[tuple[int, int]]:
    while start < stop:
        yield start, min(start + size, stop)
        start, size = start + size, 2 * size


def threshold_of_a_turn(smoothed: Smoothed, turn_fraction: float) -> float:
    """Smallest return of the temperature that counts as a turn [unit of temperature]."""
    spread = float(np.ptp(smoothed.values)) if smoothed.values.size else 0.0
    return max(turn_fraction * spread, NOISE_MARGIN * smoothed.noise)


def sweeps_of_temperature(smoothed: Smoothed, turn_fraction: float = 0.2) -> tuple[Sweep, ...]:
    """Sweeps between the turning points of the temperature itself.

    Parameters
    ----------
    smoothed : Smoothed
    turn_fraction : float
        Smallest turn over the range of the record [1].

    Returns
    -------
    tuple of Sweep
        In order of acquisition, without the rows before the first and after the last turning point; empty for
        a constant temperature.
    """
    turns = turning_points(smoothed.values, threshold_of_a_turn(smoothed, turn_fraction)).tolist()
    values = smoothed.values
    return tuple(
        Sweep(a + (k > 0), b + 1, bool(values[b] > values[a])) for k, (a, b) in enumerate(pairwise(turns))
    )


def sweeps_of_column(branch: Floats) -> tuple[Sweep, ...]:
    """Sweeps as an explicit column states them.

    Parameters
    ----------
    branch : ndarray, shape (n,)
        Positive heating, negative cooling, zero or NaN neither.
    """
    direction = np.sign(np.nan_to_num(branch))
    first = first_of_each_reading(direction)
    last = np.r_[first[1:], direction.size]
    return tuple(
        Sweep(int(a), int(b), bool(direction[a] > 0))
        for a, b in zip(first, last, strict=True)
        if direction[a] != 0
    )


def drive_is_on(drive: Floats) -> tuple[Mask, Mask]:
    """When the alloy is heated, by a drive signal with stray samples.

    Stray samples, up to four in a row, are outvoted by their neighbours (running median of nine).

    Parameters
    ----------
    drive : ndarray, shape (n,)
        Positive while it heats; NaN counts as off.

    Returns
    -------
    on : ndarray of bool, shape (n,)
    stray : ndarray of bool, shape (n,)
        Samples that say otherwise than `on`.

    Examples
    --------
    >>> on, stray = drive_is_on(np.r_[np.zeros(9), 1025.0, np.zeros(9), np.full(9, 30.0)])
    >>> on.nonzero()[0].tolist() == list(range(19, 28)), stray.nonzero()[0].tolist()
    (True, [9])
    """
    values = np.nan_to_num(drive)
    voted = median_filter(values, size=min(9, max(1, drive.size)), mode="nearest")
    positive = voted[voted > 0]
    level = DRIVE_ON_SHARE * float(np.percentile(positive, 90)) if positive.size else np.inf
    return voted > level, (values > level) != (voted > level)


def sweeps_of_drive(smoothed: Smoothed, on: Mask, turn_fraction: float = 0.2) -> tuple[Sweep, ...]:
    """Sweeps by a drive signal: heating while the drive is on and the temperature still rises.

    Heating starts when the drive is switched on. It ends when the drive is switched off, or when the
    temperature has its largest value, whichever is first: a drive that fades out lets the alloy cool before
    it is off.

    Parameters
    ----------
    smoothed : Smoothed
        Temperature.
    on : ndarray of bool, shape (n,)
        Whether the drive is on.
    turn_fraction : float
        Smallest turn over the range of the record [1].

    Returns
    -------
    tuple of Sweep
        Empty where the drive does not explain the temperature: it never switches, or more than a tenth of the
        pulses that were recorded from beginning to end heat by less than a turn (a chopped drive, say).
    """
    switch = np.flatnonzero(np.diff(on.astype(np.int8), prepend=0, append=0))
    starts, stops = switch[::2].tolist(), switch[1::2].tolist()
    if not starts or (starts[0] == 0 and stops[0] == on.size):
        return ()
    values = smoothed.values
    peaks = [start + int(np.argmax(values[start:stop])) for start, stop in zip(starts, stops, strict=True)]
    least = threshold_of_a_turn(smoothed, turn_fraction)
    whole = np.array([start > 0 and stop < on.size for start, stop in zip(starts, stops, strict=True)])
    weak = np.count_nonzero(whole & (values[peaks] - values[starts] < least))
    return _around_pulses(values, starts, peaks, least) if weak <= 0.1 * len(peaks) else ()


def _around_pulses(values: Floats, starts: list[int], peaks: list[int], least: float) -> tuple[Sweep, ...]:
    sweeps = []
    if abs(values[starts[0]] - values[0]) >= least:
        sweeps.append(Sweep(0, starts[0], bool(values[starts[0]] > values[0])))
    for start, peak, following in zip(starts, peaks, [*starts[1:], values.size], strict=True):
        sweeps += [Sweep(start, peak + 1, True), Sweep(peak + 1, following, False)]
    return tuple(s for s in sweeps if s.n)


def span(sweep: Sweep, smoothed: Smoothed) -> float:
    """Range of the smoothed temperature in a sweep [unit of temperature]."""
    return float(np.ptp(smoothed.values[sweep.start : sweep.stop])) if sweep.n else 0.0


def without_holds(sweep: Sweep, smoothed: Smoothed, tolerance: float = 0.05, share: float = 0.2) -> Sweep:
    """Cut off the rows in which the temperature stands still before and after the sweep proper.

    The sweep proper runs from the last row at which the temperature is within ``tolerance`` of the span of
    its first extreme to the first row at which it is that near to its last one. Of the rows beyond, on each
    side, those next to the sweep proper stay: at most ``share`` of the rows of the sweep proper, or five. So
    the plateaus stay anchored, and ramps of constant rate (5 % of their rows at each end are that near) and
    sinusoidal sweeps (14 %) lose nothing; a long wait, in which load or sensor drift at constant temperature,
    goes.

    Parameters
    ----------
    sweep : Sweep
    smoothed : Smoothed
        Temperature.
    tolerance : float
        Nearness to an extreme over the span of the sweep [1]; three standard deviations of noise where that
        is more, but 0.15 at most.
    share : float
        Rows of a hold that stay, over the rows of the sweep proper [1].

    Returns
    -------
    Sweep
        Without rows where the temperature is constant.
    """
    upwards = smoothed.values[sweep.start : sweep.stop] * (1.0 if sweep.heating else -1.0)
    change = float(np.ptp(upwards)) if upwards.size else 0.0
    if change == 0:
        return Sweep(sweep.start, sweep.start, sweep.heating)
    progress = (upwards - upwards.min()) / change
    near = min(max(tolerance, 3.0 * smoothed.noise / change), MAX_END_SHARE)
    half = int(np.argmax(progress >= 0.5))
    waiting = np.flatnonzero(progress[:half] <= near)
    arrived = np.flatnonzero(progress[half:] >= 1.0 - near)
    begin = int(waiting[-1]) + 1 if waiting.size else 0
    end = half + int(arrived[0]) if arrived.size else progress.size
    stay = max(FEWEST_HOLD_ROWS, math.ceil(share * max(end - begin, 0)))
    start, stop = max(0, begin - stay), min(progress.size, end + stay)
    return Sweep(sweep.start + start, sweep.start + stop, sweep.heating)


def with_quiet_ends(
    sweeps: tuple[Sweep, ...], smoothed: Smoothed, tolerance: float = 0.05
) -> tuple[Sweep, ...]:
    """Let the first and last sweep reach to the ends of the record where these are near their extremes.

    An extreme is a single row of a hold; the rows of the hold beyond it are as good as those on this side.

    Parameters
    ----------
    sweeps : tuple of Sweep
    smoothed : Smoothed
        Temperature.
    tolerance : float
        Nearness to the extreme over the span of the sweep [1].
    """
    if not sweeps:
        return ()
    values = smoothed.values
    head, tail = sweeps[0], sweeps[-1]
    if head.start and np.ptp(values[: head.start + 1]) <= tolerance * span(head, smoothed):
        sweeps = (replace(head, start=0), *sweeps[1:])
    if tail.stop < values.size and np.ptp(values[tail.stop - 1 :]) <= tolerance * span(tail, smoothed):
        sweeps = (*sweeps[:-1], replace(sweeps[-1], stop=values.size))
    return sweeps
