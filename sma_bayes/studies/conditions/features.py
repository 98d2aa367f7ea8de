"""Numbers that sum up a condition, drawn from its posteriors: Tables 9 to 12 of the paper and what else they call for.

Stiffness is taken over the temperatures that were measured, not beyond: Eq. (7) goes to zero or grows without bound
there. It is the slope dF/dX along the actuation path, whatever the rig makes of that; see `sma_bayes.assess.path`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import expit

from sma_bayes.arrays import Floats
from sma_bayes.assess.draws import RecordDraws, of_one_rig
from sma_bayes.assess.middle import middle_temperatures
from sma_bayes.assess.transformation import (
    MAX_OUTSTANDING_SHARE,
    curves_beyond,
    tangents,
    temperatures_of_draws,
    transformation_channel,
)
from sma_bayes.fitting.curves import interval_where_defined
from sma_bayes.parameters.roles import Role
from sma_bayes.quantities import per
from sma_bayes.records.types import Branch, Condition

BOTH = "both"
"""Branch of what heating and cooling make together."""
CHANNELS = ("force", "displacement")
"""Channels whose parameters are compared between conditions, in the order in which they are listed."""
EDGE_SHARE = 0.02
"""Share of the measured range next to its ends in which an extreme counts as lying at the end."""
_Middles = Mapping[str, Floats | None]
"""Of one record, by channel: temperature at which each curve is half-way."""


@dataclass(frozen=True, slots=True, eq=False)
class Feature:
    """A number of one condition, with its posterior.

    Attributes
    ----------
    name : str
        ``least_stiffness`` and so on.
    condition : Condition
    branch : str
        ``heating``, ``cooling`` or ``both``.
    channel : str
        ``force``, ``displacement``, ``stiffness``, or empty.
    unit : str
    draws : ndarray, shape (S,)
        From the posterior; NaN of a draw that has none, equal numbers where it was measured directly.
    meaning : str
    on_log : bool
        Whether it is positive and effects multiply it.
    at_edge : float or None
        Of an extreme: probability that it lies at an end of the measured temperatures, so that it tells how far the
        temperature went.
    """

    name: str
    condition: Condition
    branch: str
    channel: str
    unit: str
    draws: Floats
    meaning: str
    on_log: bool = False
    at_edge: float | None = None

    @property
    def measured(self) -> bool:
        """Whether it is a measured number rather than one with a posterior."""
        return bool(np.ptp(self.draws) == 0.0)

    @property
    def defined(self) -> float:
        """Share of the draws that have it [1]."""
        return float(np.mean(~np.isnan(self.draws)))

    def quantiles(self) -> dict[str, float]:
        """``q05``, ``median`` and ``q95`` of the draws that have it; NaN where none has."""
        return interval_where_defined(self.draws)


def condition_features(records: Sequence[RecordDraws]) -> tuple[Feature, ...]:
    """All features of each condition, in the order of the records.

    Parameters
    ----------
    records : sequence of RecordDraws
        Heating, cooling or both of each condition. Posteriors of different records are independent, so their draws are
        paired as they come; calibrations that are declared alike are those of one rig, and their errors are one
        (`of_one_rig`).
    """
    out: list[Feature] = []
    by_condition: dict[Condition, dict[Branch, RecordDraws]] = {}
    for record in of_one_rig(records):
        by_condition.setdefault(record.condition, {})[record.branch] = record
    for condition, branches in by_condition.items():
        middles = {b: {c: middle_temperatures(r.curves, c) for c in CHANNELS} for b, r in branches.items()}
        for branch, record in branches.items():
            out += _of_branch(record, middles[branch])
        out += _of_loop(condition, branches, middles)
    return tuple(out)


def _of_branch(record: RecordDraws, middles: _Middles) -> Iterator[Feature]:
    branch, condition, units = record.branch.value, record.condition, record.units
    degrees = units["temperature"]
    model = record.posterior.model
    for channel in CHANNELS:
        what = record.quantities.get(channel, channel)
        middle = middles[channel]
        if middle is not None:
            name = model.with_role(Role.MIDPOINT, channel)
            yield Feature(
                "midpoint", condition, branch, channel, degrees, middle,
                f"temperature at which {what} is half-way; {name} where the curve misses nothing",
            )  # fmt: skip
        left = _share_left(record, channel)
        if left is not None:
            doubt = (
                "; that plateau was not measured, so the model's word alone"
                if plateau_unmeasured(left)
                else ""
            )
            yield Feature(
                "share_left", condition, branch, channel, "1", left,
                f"share of the transformation of {what} that is left at the highest measured temperature, as the curve "
                f"goes on from there{doubt}", on_log=True,
            )  # fmt: skip
        if channel in record.channels:
            slope, words, at_edge = _greatest_slope(record, channel)
            yield Feature(
                "greatest_slope", condition, branch, channel, slope_unit(units[channel], degrees), slope,
                f"slope of {record.quantities[channel]} {words}", True, at_edge,
            )  # fmt: skip
    yield from _transformation(record)
    yield from _stiffness(record)


def plateau_unmeasured(left: Floats | float) -> bool:
    """Whether so much of a transformation is left (median) that its plateau, and with it the share, is extrapolated."""
    return bool(np.nanmedian(left) > MAX_OUTSTANDING_SHARE)


def _share_left(record: RecordDraws, channel: str) -> Floats | None:
    """Share of the transformation that is left at the highest measured temperature; None where the model has no rate.

    Beside the model's curve may stand what it misses: the share is then the distance of the whole curve from the
    tangent of its upper plateau over that of the plateaus, see `Tangents`; NaN of a draw that has no such tangents.
    """
    midpoint, rate = (record.with_role(role, channel) for role in (Role.MIDPOINT, Role.RATE))
    if midpoint is None or rate is None:
        return None
    if channel not in record.weights:
        return np.asarray(expit(np.abs(rate) * (midpoint - record.hottest)))
    curve, guide = curves_beyond(record.curves, channel)
    return tangents(curve, record.coldest, record.hottest, guide).missing_above


def _greatest_slope(record: RecordDraws, channel: str) -> tuple[Floats, str, float | None]:
    """Greatest magnitude of the slope, words for where that is, and how probably it is at an end of the sweep.

    Where something stands beside the model's curve its mean tells the place, as in `tangents`: that each draw wiggles
    as far as the measurements allow is no slope of what was measured.
    """
    grid, curves = record.grid(), record.curves
    if channel not in record.weights:
        return *record.posterior.model.greatest_slope(record.curve_theta, channel, grid), None
    place = np.abs(curves.with_mean_discrepancy().slope(channel, grid)).argmax(axis=1)
    slope = np.abs(np.take_along_axis(curves.slope(channel, grid), place[:, None], axis=1)[:, 0])
    return slope, "where it is steepest over the measured temperatures", _at_edge(place, grid.size)


def _transformation(record: RecordDraws) -> Iterator[Feature]:
    """As and Af, or Mf and Ms, by the tangent rule."""
    channel = transformation_channel(record.record)
    if channel is None:
        return
    found = temperatures_of_draws(record.curves, channel)
    for t in found:
        doubt = "" if t.within_data else "; beyond what was measured, so the model's word alone"
        yield Feature(
            t.name, record.condition, record.branch.value, channel, t.unit, t.draws,
            f"{t.meaning} temperature by the tangent rule, from {record.quantities[channel]}{doubt}",
        )  # fmt: skip


def _stiffness(record: RecordDraws) -> Iterator[Feature]:
    if "stiffness" not in record.units:
        return
    grid = record.grid()
    curve = np.abs(record.curve("stiffness", grid))
    branch, condition = record.branch.value, record.condition
    unit, degrees = record.units["stiffness"], record.units["temperature"]
    what = record.quantities["stiffness"]
    where = "over the measured temperatures"
    low, high = curve.min(axis=1), curve.max(axis=1)
    slope = np.abs(np.gradient(curve, grid, axis=1)).max(axis=1)
    yield Feature("least_stiffness", condition, branch, "stiffness", unit, low, f"least {what} {where}", True,
                  _at_edge(curve.argmin(axis=1), grid.size))  # fmt: skip
    yield Feature("greatest_stiffness", condition, branch, "stiffness", unit, high, f"greatest {what} {where}",
                  True, _at_edge(curve.argmax(axis=1), grid.size))  # fmt: skip
    yield Feature("stiffness_ratio", condition, branch, "stiffness", "1", ratio(high, low),
                  f"greatest over least {what} {where}", True)  # fmt: skip
    yield Feature("steepest_stiffness", condition, branch, "stiffness", slope_unit(unit, degrees), slope,
                  f"greatest magnitude of the slope of {what} against temperature {where}", True)  # fmt: skip


def slope_unit(unit: str, degrees: str) -> str:
    """Unit of a slope against temperature.

    Examples
    --------
    >>> slope_unit("N", "degC"), slope_unit("1", "degC")
    ('N 1/degC', '1/degC')
    """
    return per(degrees) if unit == "1" else f"{unit} {per(degrees)}"


def _at_edge(place: np.ndarray[tuple[int], np.dtype[np.intp]], size: int) -> float:
    margin = EDGE_SHARE * (size - 1)
    return float(np.mean((place <= margin) | (place >= size - 1 - margin)))


def ratio(high: Floats, low: Floats) -> Floats:
    """Greatest over least [1]; infinite where the least is nothing, or next to it."""
    with np.errstate(divide="ignore", over="ignore"):
        return np.asarray(high / low)


def _of_loop(
    condition: Condition, branches: Mapping[Branch, RecordDraws], middles: Mapping[Branch, _Middles]
) -> Iterator[Feature]:
    first = next(iter(branches.values()))
    degrees = first.units["temperature"]
    coldest, hottest = min(r.coldest for r in branches.values()), max(r.hottest for r in branches.values())
    for name, value, word in (
        ("least_temperature", coldest, "lowest"),
        ("peak_temperature", hottest, "highest"),
    ):
        yield Feature(
            name, condition, BOTH, "", degrees, np.full(first.size, value), f"{word} measured temperature"
        )  # fmt: skip
    if len(branches) < len(Branch):
        return
    heating, cooling = branches[Branch.HEATING], branches[Branch.COOLING]
    size = min(heating.size, cooling.size)
    for channel in CHANNELS:
        up, down = (middles[b][channel] for b in (Branch.HEATING, Branch.COOLING))
        if up is not None and down is not None:
            yield Feature(
                "hysteresis_width", condition, BOTH, channel, degrees, up[:size] - down[:size],
                f"temperature at which {heating.quantities.get(channel, channel)} is half-way, heating less cooling",
            )  # fmt: skip
    if all("stiffness" in r.units for r in branches.values()):
        yield from _stiffness_of_loop(condition, heating, cooling, size)


def _stiffness_of_loop(
    condition: Condition, heating: RecordDraws, cooling: RecordDraws, size: int
) -> Iterator[Feature]:
    """Extremes over both branches: what Tables 9 to 12 print."""
    curves = [np.abs(r.curve("stiffness", r.grid())[:size]) for r in (heating, cooling)]
    both = np.concatenate(curves, axis=1)
    low, high = both.min(axis=1), both.max(axis=1)
    unit, what = heating.units["stiffness"], heating.quantities["stiffness"]
    where = "over the measured temperatures of both branches"
    yield Feature("least_stiffness", condition, BOTH, "stiffness", unit, low, f"least {what} {where}", True)
    yield Feature(
        "greatest_stiffness", condition, BOTH, "stiffness", unit, high, f"greatest {what} {where}", True
    )
    yield Feature("stiffness_ratio", condition, BOTH, "stiffness", "1", ratio(high, low),
                  f"greatest over least {what} {where}", True)  # fmt: skip
