"""Conditions whose readings are another's times a constant. Their noise tells: no two measurements share it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.quantities import CHANNELS, SPECIMEN_QUANTITY, unit_text
from sma_bayes.records.run import Run
from sma_bayes.records.types import Finding

MAX_COMPARED_READINGS, LEAST_COMPARED_READINGS = 1000, 20
"""Readings of a channel that are compared, at most and at least: evenly chosen rows."""
COPIED_NOISE_CORRELATION: Final = 0.99
"""Correlation of the noise of two channels from which on they are looked at closely; of noise of their own it scatters
about zero, by 1/4 with the fewest readings."""
LEAST_NOISE_RATIO: Final = 0.5
"""Least ratio of two estimates of the noise, by fourth and by second differences. It is 1 of noise and far less of a
smooth curve, as it is computed, of which two may well be one but for their spans."""


@dataclass(frozen=True, slots=True, eq=False)
class Readings:
    """One channel of one condition, as far as it is compared.

    Attributes
    ----------
    condition, file, channel : str
    quantity, unit : str
        As people see them.
    rows : tuple of (int, bytes)
        Rows of the run, and where readings are missing: only like ones are compared.
    values : ndarray, shape (n,)
    """

    condition: str
    file: str
    channel: str
    quantity: str
    unit: str
    rows: tuple[int, bytes]
    values: Floats


def readings_of(run: Run) -> Iterator[Readings]:
    """The measured channels of a run that have noise to tell them by."""
    step = -(-run.n // MAX_COMPARED_READINGS)
    for channel in CHANNELS:
        if channel not in run.columns:
            continue
        values = run.columns[channel][::step]
        there = np.isfinite(values)
        if np.count_nonzero(there) >= LEAST_COMPARED_READINGS and _is_noisy(values[there]):
            quantity = SPECIMEN_QUANTITY.get(channel, channel) if run.specimen else channel
            unit = unit_text(run.units.get(channel, ""))
            rows = (run.n, there.tobytes())
            yield Readings(run.condition.id, run.file, channel, quantity, unit, rows, values[there])


def copied_readings(readings: Sequence[Readings], known: Sequence[Finding] = ()) -> tuple[Finding, ...]:
    """Conditions of which a channel is that of another, up to a factor and an offset.

    Parameters
    ----------
    readings : sequence of Readings
        Of all conditions, see `readings_of`.
    known : sequence of Finding
        Conditions that are copies as a whole; nothing more is said of them.
    """
    alike: dict[tuple[object, ...], list[Readings]] = defaultdict(list)
    told = {f.condition for f in known}
    for one in readings:
        if one.condition not in told:
            alike[(one.channel, *one.rows)].append(one)
    found: dict[tuple[str, str], Finding] = {}
    for group in alike.values():
        for _, second, message in _copies(group):
            finding = Finding(
                "copied-readings", message, second.file, condition=second.condition, column=second.channel
            )
            found.setdefault((second.condition, second.channel), finding)
    return tuple(found.values())


def _copies(group: Sequence[Readings]) -> Iterator[tuple[Readings, Readings, str]]:
    noise = np.stack([_unit(np.diff(r.values, 4)) for r in group])
    close = np.abs(noise @ noise.T) > COPIED_NOISE_CORRELATION
    for i, j in combinations(range(len(group)), 2):
        if not close[i, j]:
            continue
        first, second = group[i], group[j]
        slope, offset = np.polyfit(first.values, second.values, 1).tolist()
        missed = np.abs(second.values - slope * first.values - offset).max()
        rounding = abs(slope) * _step(first.values) + _step(second.values)
        if missed <= rounding and 2.0 * rounding < _noise(second.values, 4):
            yield first, second, _message(first, second, slope, offset)


def _message(first: Readings, second: Readings, slope: float, offset: float) -> str:
    close = 1e-4 * float(np.ptp(second.values))
    how = "the same as" if abs(slope - 1.0) < 1e-4 else f"{slope:.6g} times"
    more = f" plus {offset:.4g} {second.unit}".rstrip() if abs(offset) > close else ""
    return (
        f"{second.quantity} is {how} that of condition {first.condition!r}{more}, reading for reading, noise included: "
        "one of the two was not measured, or they count twice"
    )


def _is_noisy(values: Floats) -> bool:
    least = _noise(values, 4)
    return least > 0.0 and least > LEAST_NOISE_RATIO * _noise(values, 2)


_NORM: Final = {2: 6.0, 4: 70.0}  # sums of squares of the binomial coefficients


def _noise(values: Floats, order: int) -> float:
    """Standard deviation of white noise with such differences."""
    return float(np.sqrt(np.mean(np.diff(values, order) ** 2) / _NORM[order]))


def _step(values: Floats) -> float:
    """Smallest step between readings: at least what they were rounded to."""
    steps = np.diff(np.unique(values))
    steps = steps[steps > 1e-9 * np.ptp(values)]
    return float(steps.min()) if steps.size else 0.0


def _unit(values: Floats) -> Floats:
    return np.asarray(values / np.linalg.norm(values))
