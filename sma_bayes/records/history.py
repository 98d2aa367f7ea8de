"""A condition's measurements in the order in which they were made, both branches together.

Fits look at one branch at a time. What a lagging sensor, a drifting zero or a training spring does depends on what
happened before, so the gap workflow follows each condition along its whole history.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_smoothing_spline

from sma_bayes.arrays import Floats, Ints
from sma_bayes.records.types import Branch, Campaign, Condition, Record, plain_fields

GAP_MEDIAN_STEPS = 5.0
"""Steps of time, in medians of the steps of the sweeps beside it, from which on samples no longer follow each other."""
RATE_SAMPLES = 7
"""Samples of a sweep to which a straight line is fitted for dT/dt."""

LEAST_SPLINE_SAMPLES = 10
"""Fewest samples of a sweep through which a smoothing spline is laid."""

BRANCH_SIGN = {Branch.HEATING: 1.0, Branch.COOLING: -1.0}
"""How a branch stands among the inputs."""


@dataclass(frozen=True, slots=True, eq=False)
class History:
    """All samples of one condition, in order.

    Attributes
    ----------
    condition : Condition
    inputs : mapping of str to ndarray, shape (n,)
        ``temperature`` [degC]; ``branch``: 1 heating, -1 cooling; ``cycle``, from 1, and ``last_cycle``, the greatest
        of the campaign; ``run``: place of the condition in the campaign, from 0; ``cycle_of_all``: cycles of all
        conditions in a row, from 0; ``segment``: samples of one uninterrupted sweep share a number; ``stretch``:
        samples between which nothing was left out share a number;
        ``order``: place in the history, from 0. Where they were recorded: ``time`` [s], ``rate``: dT/dt [K/s],
        ``typical_rate``: median of its magnitude over the campaign [K/s], ``current`` [A], ``ambient_temperature``
        [degC], `DELIVERED` [A^2 s], ``resistance`` and ``typical_resistance``, its median over the campaign [ohm];
        where they were set: ``load`` and ``typical_load``, its median over the campaign [N, or Pa of a specimen],
        ``frequency`` [Hz], ``duty_cycle``.
    observed : mapping of str to ndarray, shape (n,)
        Channels among force, displacement, stiffness; temperature too where current and time were recorded, since it
        then is an outcome as well.
    row : ndarray of int, shape (n,)
        Source line of each sample.
    units : mapping of str to str
    specimen : bool
        See `Record`.
    averaged : int
        Source rows that a sample stands for, at most.
    held : mapping of str to float
        Mean of channels that the rig kept constant.
    """

    condition: Condition
    inputs: Mapping[str, Floats]
    observed: Mapping[str, Floats]
    row: Ints
    units: Mapping[str, str]
    specimen: bool = False
    averaged: int = 1
    held: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("inputs", "observed", "units", "held"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    def __reduce__(self) -> tuple[object, ...]:
        return History, plain_fields(self)

    @property
    def n(self) -> int:
        """Number of samples."""
        return int(self.row.size)

    @property
    def channels(self) -> tuple[str, ...]:
        """Observed channels, in canonical order."""
        return tuple(self.observed)

    def of(self, channels: Collection[str], **inputs: Floats) -> History:
        """The same with some of the observed channels, and with further inputs."""
        observed = {c: v for c, v in self.observed.items() if c in channels}
        return replace(self, observed=observed, inputs={**self.inputs, **inputs})

    def part(self, kept: np.ndarray) -> History:
        """Only the samples for which a mask is true; where some are left out, sweeps and stretches end."""
        cut = np.cumsum(np.diff(np.flatnonzero(kept), prepend=-1) != 1).astype(float)
        inputs = {name: values[kept] for name, values in self.inputs.items()}
        for name in ("segment", "stretch"):
            inputs[name] = _numbered(inputs[name], cut)
        observed = {name: values[kept] for name, values in self.observed.items()}
        return History(
            self.condition,
            inputs,
            observed,
            self.row[kept],
            self.units,
            self.specimen,
            self.averaged,
            self.held,
        )


def starts(inputs: Mapping[str, Floats]) -> NDArray[np.bool_]:
    """Mask (n,) of the first sample of each stretch, whose past is unknown."""
    return np.asarray(np.diff(inputs["stretch"], prepend=-1.0) != 0)


def histories(campaign: Campaign) -> tuple[History, ...]:
    """One history for each condition of a campaign.

    Channels that only one branch has are left out, as there is no history of them.

    Returns
    -------
    tuple of History
        In the order of the campaign's records.
    """
    conditions = dict.fromkeys(r.condition.id for r in campaign.records)
    found = tuple(_joined([r for r in campaign.records if r.condition.id == i]) for i in conditions)
    rates = [np.abs(h.inputs["rate"]) for h in found if "rate" in h.inputs]
    typical = float(np.median(np.concatenate(rates))) if rates else 0.0
    shared = {"last_cycle": max(float(h.inputs["cycle"].max()) for h in found)}
    if typical > 0.0:
        shared["typical_rate"] = typical
    for name in ("resistance", "load"):
        if all(name in h.inputs for h in found):
            shared[f"typical_{name}"] = float(np.median(np.concatenate([h.inputs[name] for h in found])))
    out, cycles = [], 0
    for run, h in enumerate(found):
        distinct, rank = np.unique(h.inputs["cycle"], return_inverse=True)
        own = {name: np.full(h.n, value) for name, value in (shared | {"run": float(run)}).items()}
        out.append(replace(h, inputs={**h.inputs, **own, "cycle_of_all": cycles + rank.astype(float)}))
        cycles += distinct.size
    return tuple(out)


def _joined(records: Sequence[Record]) -> History:
    first = records[0]
    names = set.intersection(*(set(r.inputs) for r in records)) - {"segment"}
    channels = [c for c in first.channels if all(c in r.observed for r in records)]
    inputs = {name: np.concatenate([r.inputs[name] for r in records]) for name in names}
    inputs["branch"] = np.concatenate([np.full(r.n, BRANCH_SIGN[r.branch]) for r in records])
    sweep = np.concatenate([1000.0 * i + r.inputs["segment"] for i, r in enumerate(records)])
    sources = list(dict.fromkeys(r.source for r in records))
    file = np.concatenate([np.full(r.n, float(sources.index(r.source))) for r in records])
    row = np.concatenate([r.row for r in records])
    timed = "time" in inputs
    order = np.lexsort((row, inputs["time"] if timed else row, file))
    inputs = {name: values[order] for name, values in inputs.items()}
    sweep, file, row = sweep[order], file[order], row[order]
    inputs.setdefault("cycle", np.ones(row.size))
    inputs["order"] = np.arange(1.0, row.size + 1.0)
    inputs["segment"] = _numbered(sweep)
    inputs["stretch"] = _numbered(file, _interruptions(inputs["time"] if timed else row.astype(float), sweep))
    if timed:
        inputs["rate"] = sweep_rate(inputs["temperature"], inputs["time"], inputs["segment"])
    observed = {c: np.concatenate([r.observed[c] for r in records])[order] for c in channels}
    if timed and "current" in inputs:
        observed["temperature"] = inputs["temperature"]
        inputs["temperature"] = smoothed(inputs["temperature"], inputs["time"], inputs["segment"])
    condition = first.condition
    for name, value in (
        ("load", condition.load), ("frequency", condition.frequency), ("duty_cycle", condition.duty_cycle),
        ("current", condition.current),
    ):  # fmt: skip
        if value is not None and name not in inputs:
            inputs[name] = np.full(row.size, float(value))
    return History(
        condition,
        inputs,
        observed,
        row,
        {**first.units, "rate": "K/s"},
        first.specimen,
        max(r.rows_averaged for r in records),
        {c: h.mean for c, h in first.held.items()},
    )


def smoothed(temperature: Floats, time: Floats, segment: Floats) -> Floats:
    """Temperature of the alloy from noisy readings: a smoothing spline in time through each sweep.

    A response that is computed from noisy readings of the temperature inherits their noise where it is steep, and
    flattens there [1]_. How smooth it has to be, generalised cross-validation tells; readings without noise stay.

    Parameters
    ----------
    temperature, time, segment : ndarray, shape (n,)

    Returns
    -------
    ndarray, shape (n,)
        As read, where a sweep has fewer than `LEAST_SPLINE_SAMPLES` samples or two at one time.

    References
    ----------
    .. [1] Carroll, Ruppert, Stefanski and Crainiceanu, Measurement Error in Nonlinear Models (2006), regression
       calibration.
    """
    return _sweep_by_sweep(_spline, temperature, time, segment)


def _spline(temperature: Floats, time: Floats) -> Floats:
    if time.size < LEAST_SPLINE_SAMPLES or not np.all(np.diff(time) > 0.0):
        return temperature
    t = (time - time[0]) / ((time[-1] - time[0]) / time.size)
    return np.asarray(make_smoothing_spline(t, temperature)(t))


def _sweep_by_sweep(
    made_of: Callable[[Floats, Floats], Floats], temperature: Floats, time: Floats, segment: Floats
) -> Floats:
    """What a function makes of temperature and time of each sweep, joined again, shape (n,)."""
    ends = np.flatnonzero(np.diff(segment)) + 1
    sweeps = zip(np.split(temperature, ends), np.split(time, ends), strict=True)
    return np.concatenate([made_of(*sweep) for sweep in sweeps])


def _interruptions(clock: Floats, sweep: Floats) -> Floats:
    """Numbers that rise where a step is far longer than is usual in the sweeps on either side."""
    step = np.abs(np.diff(clock, prepend=clock[:1]))
    inside = np.diff(sweep, prepend=sweep[0] - 1.0) == 0
    usual = {s: float(np.median(step[inside & (sweep == s)])) for s in np.unique(sweep[inside])}
    each = np.array([usual.get(s, 0.0) for s in sweep.tolist()])
    longest = np.maximum(each, np.concatenate([each[:1], each[:-1]]))
    return np.cumsum(step > GAP_MEDIAN_STEPS * np.maximum(longest, 1e-300)).astype(float)


def _numbered(*labels: Floats) -> Floats:
    """Numbers from 0 that rise where any of the labels changes."""
    changes = np.zeros(labels[0].size, dtype=bool)
    for label in labels:
        changes[1:] |= np.diff(label) != 0
    return np.cumsum(changes).astype(float)


def sweep_rate(temperature: Floats, time: Floats, segment: Floats) -> Floats:
    """Rate dT/dt of each sample: the slope of a straight line through its neighbours in the same sweep.

    Parameters
    ----------
    temperature, time, segment : ndarray, shape (n,)

    Returns
    -------
    ndarray, shape (n,)
        0 where a sweep has a single sample or a single time.
    """
    return _sweep_by_sweep(_slope, temperature, time, segment)


def _slope(temperature: Floats, time: Floats) -> Floats:
    t = time - time[0]
    sums = np.zeros((4, t.size + 1))
    np.cumsum([t, temperature, t * t, t * temperature], axis=1, out=sums[:, 1:])
    at, half = np.arange(t.size), RATE_SAMPLES // 2
    left, right = np.maximum(at - half, 0), np.minimum(at + half + 1, t.size)
    count = right - left
    st, sy, stt, sty = sums[:, right] - sums[:, left]
    spread = count * stt - st * st
    good = spread > 1e-12 * np.maximum(count * stt, 1e-300)
    return np.where(good, (count * sty - st * sy) / np.where(good, spread, 1.0), 0.0)
