"""Which channels answer to the temperature, and which the rig held.

A load frame that keeps the stress constant still records it, with noise, drift and lapses of its control.
Fitted as a response it would give a curve that nobody imposed. The rule, for a condition as a whole:

- A channel *follows* the temperature on a branch if a monotone function of temperature explains at least half
  of the variance between its averages in temperature bins, and if it changes, from the cold end to the hot,
  by at least 5 % of its mean (force and stiffness; the zero of a displacement is arbitrary).
- It is fitted if it follows on some branch, and in the same direction on all on which it does: a drift in
time
  goes up on one branch and down on the other.
- Else it is held. If no channel follows, the one that does so best is fitted all the same.

``fit_channels`` overrules all this.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import isotonic_regression

from sma_bayes.arrays import Floats, Ints
from sma_bayes.normal import MAD_TO_SD
from sma_bayes.quantities import CHANNELS
from sma_bayes.records.cleaning import MAX_SHARE_MISSING
from sma_bayes.records.ledger import Ledger
from sma_bayes.records.quality import CHANNEL_WINDOW, spikes
from sma_bayes.records.run import Run
from sma_bayes.records.segmentation import Mask
from sma_bayes.records.types import Branch, HeldChannel

SWEEP_BINS: Final = 40
"""Bins of temperature in which a channel is averaged to see whether it follows."""

LEAST_EXPLAINED_SHARE: Final = 0.5
"""Share of the variance between bins that a monotone function explains where a channel follows."""

LOAD_OFF, LOAD_OFF_SDS = 0.1, 5.0
"""A load is off where it is further from its median than this share of it and this many standard
deviations."""

LEAST_NONLINEAR_SHARE: Final = 0.01
"""A channel shows no transformation where a straight line explains all but this share of what any monotone
function does."""


@dataclass(frozen=True, slots=True, eq=False)
class Leg:
    """Rows of one sweep.

    Attributes
    ----------
    branch : Branch
    rows : ndarray of int
        Positions in the run, in order of acquisition.
    cycle, segment : int
        Number of the thermal cycle, and of the sweep, from 1.
    """

    branch: Branch
    rows: Ints
    cycle: int
    segment: int


def rows_of(legs: Sequence[Leg], branch: Branch | None = None) -> Ints:
    """Positions in the run of the rows of some legs, of one branch if it is given."""
    rows = [leg.rows for leg in legs if branch in (None, leg.branch)]
    return np.concatenate(rows) if rows else np.empty(0, dtype=np.int64)


@dataclass(frozen=True, slots=True)
class Course:
    """How a channel follows the temperature along one branch.

    Attributes
    ----------
    monotone : float
        Share of the variance between temperature bins that a monotone function of temperature explains [1].
    straight : float
        Share of it that a straight line explains [1].
    rise : float
        Change of that monotone function from the cold end to the hot end [unit of the channel].
    low, high : float
        Extremes of the bin means [unit of the channel].
    """

    monotone: float
    straight: float
    rise: float
    low: float
    high: float


def course(temperature: Floats, values: Floats) -> Course:
    """Average a channel in bins of temperature and ask how monotone and how straight it is.

    Averages in up to 40 bins of equal width, so that sample noise does not hide a response; the monotone
    function is the better of the two isotonic regressions (rising, falling), weighted by the samples of a
    bin's square root, so that a long plateau does not drown the transformation.

    Parameters
    ----------
    temperature, values : ndarray, shape (n,)
        Finite.
    """
    bins = int(np.clip(temperature.size // 5, 2, SWEEP_BINS))
    edges = np.linspace(temperature.min(), temperature.max(), bins + 1)
    where = np.clip(np.searchsorted(edges, temperature, side="right") - 1, 0, bins - 1)
    count = np.bincount(where, minlength=bins)
    used = count > 0
    mean = np.bincount(where, values, bins)[used] / count[used]
    at = np.bincount(where, temperature, bins)[used] / count[used]
    weight = np.sqrt(count[used])
    centre = np.average(mean, weights=weight)
    total = float(np.sum(weight * (mean - centre) ** 2))
    low, high = float(mean.min()), float(mean.max())
    if mean.size < 3 or total <= 1e-24 * max(low * low, high * high) * weight.sum():
        return Course(0.0, 0.0, 0.0, low, high)
    best = min(
        (isotonic_regression(mean, weights=weight, increasing=up).x for up in (True, False)),
        key=lambda fit: float(np.sum(weight * (mean - fit) ** 2)),
    )
    line = np.polynomial.Polynomial.fit(at, mean, 1, w=np.sqrt(weight))(at)
    left = [float(np.sum(weight * (mean - fit) ** 2)) for fit in (best, line)]
    return Course(1.0 - left[0] / total, 1.0 - left[1] / total, float(best[-1] - best[0]), low, high)


def _steady(run: Run, channel: str) -> Mask:
    """Rows in which a channel has a value that does not jump away from its neighbours and back.

    One such spike would outweigh a whole sweep.
    """
    steady = np.isfinite(run.columns[channel])
    there = np.flatnonzero(steady & np.isfinite(run.columns["temperature"]))
    steady[there] = ~spikes(
        run.columns[channel][there], CHANNEL_WINDOW, against=run.columns["temperature"][there]
    )
    return steady


def courses(run: Run, legs: Sequence[Leg], channel: str) -> dict[Branch, Course]:
    """How a channel follows the temperature on each branch.

    The first tenth of the first sweep and the last tenth of the last are left out: there the load may still
    be coming on, or be off already. So are spikes.

    Returns
    -------
    dict of Branch to Course
        Branches with at least four rows.
    """
    return _courses(run, legs, channel, _steady(run, channel))


def _courses(run: Run, legs: Sequence[Leg], channel: str, steady: Mask) -> dict[Branch, Course]:
    """The same, where it is known which rows are steady."""
    inner = list(legs)
    if inner:
        inner[0] = _without(inner[0], head=inner[0].rows.size // 10)
        inner[-1] = _without(inner[-1], tail=legs[-1].rows.size // 10)
    found = {}
    for branch in Branch:
        rows = rows_of(inner, branch)
        rows = rows[steady[rows]]
        if rows.size >= 4:
            found[branch] = course(run.columns["temperature"][rows], run.columns[channel][rows])
    return found


def _without(leg: Leg, *, head: int = 0, tail: int = 0) -> Leg:
    return Leg(leg.branch, leg.rows[head : leg.rows.size - tail], leg.cycle, leg.segment)


def responds(channel: str, along: dict[Branch, Course], mean: float, min_change: float) -> bool:
    """Whether a channel is a response to the temperature, by the rule of this module.

    Parameters
    ----------
    channel : str
    along : dict of Branch to Course
    mean : float
        Of the channel [its unit].
    min_change : float
        Least change of a force or stiffness over its mean [1].
    """
    least = 0.0 if channel == "displacement" else min_change * abs(mean)
    follows = [c for c in along.values() if c.monotone >= LEAST_EXPLAINED_SHARE and abs(c.rise) >= least]
    return len({c.rise > 0 for c in follows}) == 1


def choose_channels(
    ledger: Ledger, legs: Sequence[Leg], fit_channels: tuple[str, ...] | None, min_change: float
) -> tuple[str, ...]:
    """Channels to fit, by the rule of this module or as told.

    Returns
    -------
    tuple of str
        In canonical order; empty only where no channel has values.
    """
    run, rows = ledger.run, rows_of(legs)
    there = [c for c in CHANNELS if c in run.columns]
    if fit_channels is not None:
        return tuple(c for c in there if c in fit_channels)
    filled = []
    for channel in there:
        share = float(np.isfinite(run.columns[channel][rows]).mean()) if rows.size else 0.0
        if share >= MAX_SHARE_MISSING:
            filled.append(channel)
        else:
            message = (
                f"{ledger.quantity(channel)} is missing in {1.0 - share:.0%} of the rows and is not fitted"
            )
            ledger.note(rows[:0], "sparse-channel", message, column=channel)
    steady = {c: _steady(run, c) for c in filled}
    along = {c: _courses(run, legs, c, steady[c]) for c in filled}
    mean = {c: float(run.columns[c][rows[steady[c][rows]]].mean()) for c in filled}
    fitted = tuple(c for c in filled if responds(c, along[c], mean[c], min_change))
    if fitted or not filled:
        return fitted
    return (max(filled, key=lambda c: max((k.monotone for k in along[c].values()), default=0.0)),)


def keep_out_load_off(ledger: Ledger, legs: Sequence[Leg]) -> None:
    """Keep out the rows at both ends of a run in which a held load is not on yet, or is off already.

    Rows count from the ends of the run to the first at which the load is within 10 % of its median and within
    five robust standard deviations. A lapse of the load control in mid-sweep stays in and is reported.
    """
    rows = rows_of(legs)
    rows = rows[np.isfinite(ledger.run.columns["force"][rows])]
    load = ledger.run.columns["force"][rows]
    if not rows.size:
        return
    usual = float(np.median(load))
    away = np.abs(load - usual)
    on = np.flatnonzero(away <= max(LOAD_OFF * abs(usual), LOAD_OFF_SDS * MAD_TO_SD * float(np.median(away))))
    name = ledger.quantity("force")
    why = f"{name} is far from its usual {ledger.amount('force', usual, digits=4)} at the beginning or end of the run"
    ends = np.r_[rows[: on[0]], rows[on[-1] + 1 :]] if on.size else rows[:0]
    ledger.keep_out(ends, "load-off", why, column="force")


def note_held(ledger: Ledger, legs: Sequence[Leg], channel: str, *, told: bool, min_change: float) -> None:
    """Report a channel that is not fitted, and whether it was as constant as a held one should be.

    Parameters
    ----------
    ledger : Ledger
    legs : sequence of Leg
    channel : str
    told : bool
        True where the user chose the channels to fit.
    min_change : float
        Largest range of its averages over its mean with which a force or stiffness is called constant.
    """
    run, rows = ledger.run, rows_of(legs)
    name = ledger.quantity(channel)
    steady = _steady(run, channel)
    mean = float(run.columns[channel][rows[steady[rows]]].mean())
    along = _courses(run, legs, channel, steady)
    spike = rows[np.isfinite(run.columns[channel][rows]) & ~steady[rows]]
    if spike.size:
        message = f"{name} jumps away from its neighbours and back; these readings are left out of its mean"
        ledger.note(spike, "spike", message, column=channel)
    if not along:
        return
    low, high = min(c.low for c in along.values()), max(c.high for c in along.values())
    middle, least, most = (ledger.amount(channel, v, digits=4) for v in (mean, low, high))
    extent = f"mean {middle}, averages along the sweep from {least} to {most}"
    none = rows[:0]
    if channel != "displacement" and high - low > 2.0 * min_change * abs(mean):
        kind = "load-not-constant" if channel == "force" else "not-constant"
        message = f"{name} was not constant ({extent}), yet "
        message += "is not fitted, as told" if told else "does not follow the temperature and is not fitted"
        message += "; the other channels answer to it as well as to the temperature" * (channel == "force")
        ledger.note(none, kind, message, column=channel)
    elif told:
        ledger.note(none, "not-fitted", f"{name} is not fitted, as told ({extent})", column=channel)
    elif channel == "force":
        slope, tested = ("dσ/dε", "specimen") if ledger.run.specimen else ("dF/dX", "spring")
        message = (
            f"constant load: {slope} along the path says nothing about the {tested}; {name} has {extent}"
        )
        ledger.note(none, "constant-load", message, column=channel)
    else:
        message = f"{name} does not follow the temperature and is set aside as held ({extent})"
        ledger.note(none, "constant-channel", message, column=channel)


def held_channels(run: Run, rows: Ints, fitted: Sequence[str]) -> dict[str, HeldChannel]:
    """Mean and standard deviation of the channels that are not fitted, without spikes.

    Parameters
    ----------
    run : Run
    rows : ndarray of int
        Positions in the run.
    fitted : sequence of str

    Returns
    -------
    dict of str to HeldChannel
        Channels that are missing in more than half of the rows are left out.
    """
    held = {}
    for channel in CHANNELS:
        if channel in run.columns and channel not in fitted:
            values = run.columns[channel][rows[_steady(run, channel)[rows]]]
            if values.size and values.size >= MAX_SHARE_MISSING * rows.size:
                held[channel] = HeldChannel(float(values.mean()), float(values.std()))
    return held


def note_no_transformation(ledger: Ledger, legs: Sequence[Leg], channel: str) -> None:
    """Report a fitted channel without a sign of a transformation on a branch."""
    name = ledger.quantity(channel)
    for branch, c in courses(ledger.run, legs, channel).items():
        if c.monotone < LEAST_EXPLAINED_SHARE:
            message = f"no transformation: {name} does not follow the temperature on {branch.value}"
        elif c.straight >= c.monotone - LEAST_NONLINEAR_SHARE:
            message = (
                f"no transformation: {name} changes on a straight line with temperature on {branch.value}"
            )
        else:
            continue
        ledger.note(rows_of(legs)[:0], "no-transformation", message, column=channel, branch=branch.value)
