"""What a gap study can and can't be made from, said before any work is done."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from sma_bayes.errors import MeasurementError
from sma_bayes.quantities import ARBITRARY
from sma_bayes.records.history import History
from sma_bayes.records.types import Branch, Campaign, Record

LEAST_SAMPLES = 24
"""Samples of a condition, at least: its curve, and the functions beside which its noise is estimated, use up fewer."""

ByCondition = Mapping[str, Sequence[Record]]


@dataclass(frozen=True, slots=True, eq=False)
class Comparable:
    """A campaign whose conditions can be compared.

    Attributes
    ----------
    campaign : Campaign
        With the channels that all of its records have.
    remarks : tuple of str
        What was left out for it, and where there is less to be seen.
    """

    campaign: Campaign
    remarks: tuple[str, ...]


def comparable(campaign: Campaign) -> Comparable:
    """What of a campaign can be studied.

    Raises
    ------
    MeasurementError
        If the conditions share no channel, or have too few samples.
    """
    every: dict[str, list[Record]] = {}
    for record in campaign.records:
        every.setdefault(record.condition.id, []).append(record)
    conditions, other_units = _in_the_same_units(every)
    shared, less = _shared_channels(conditions)
    remarks = other_units + less
    for name, records in conditions.items():
        samples = sum(r.n for r in records)
        if samples < LEAST_SAMPLES:
            raise MeasurementError(
                f"condition {name!r} has {samples} samples",
                expected=f"at least {LEAST_SAMPLES}, both branches together, so that a pattern can be told from noise",
                remedy="leave the condition out, or measure more finely",
            )
        if len({r.branch for r in records}) < len(Branch):
            remarks.append(
                f"{name} has a {records[0].branch.value} branch only: nothing could be looked for on the other one."
            )
    return Comparable(
        replace(
            campaign,
            records=tuple(_with(r, shared) for r in campaign.records if r.condition.id in conditions),
        ),
        tuple(remarks),
    )


def _with(record: Record, channels: Set[str]) -> Record:
    """A record with some of its channels."""
    spare = set(record.channels) - channels
    return replace(
        record,
        observed={c: v for c, v in record.observed.items() if c not in spare},
        units={name: unit for name, unit in record.units.items() if name not in spare},
    )


def _in_the_same_units(every: ByCondition) -> tuple[ByCondition, list[str]]:
    """The conditions whose units agree, most samples of all, and a remark for each lot that is left out."""
    lots: list[tuple[dict[str, str], list[str]]] = []
    for name, records in every.items():
        own = {c: r.units[c] for r in records for c in ("temperature", *r.channels)}
        lot = next((lot for lot in lots if not _conflict(lot[0], own)), None)
        if lot is None:
            lots.append((own, [name]))
        else:
            lot[0].update(own)
            lot[1].append(name)
    best = max(lots, key=lambda lot: sum(r.n for name in lot[1] for r in every[name]))
    remarks = []
    for units, names in lots:
        if names is not best[1]:
            apart = ", ".join(
                f"{c} is in {_unit(units[c])} there and in {_unit(best[0][c])} in the others"
                for c in _conflict(units, best[0])
            )
            remarks.append(
                f"{', '.join(names)} {'were' if len(names) > 1 else 'was'} left out: {apart}. "
                "Correct the units, or study them as a campaign of their own."
            )
    return {name: every[name] for name in every if name in best[1]}, remarks


def _conflict(one: Mapping[str, str], other: Mapping[str, str]) -> list[str]:
    return [name for name in one if name in other and one[name] != other[name]]


def _unit(unit: str) -> str:
    return "arbitrary units" if unit == ARBITRARY else unit


def _shared_channels(conditions: ByCondition) -> tuple[set[str], list[str]]:
    """Channels of all records, and a remark for each that is left out."""
    own = {name: set.intersection(*(set(r.channels) for r in rs)) for name, rs in conditions.items()}
    shared = set.intersection(*own.values())
    if not shared:
        told = "; ".join(f"{name}: {', '.join(sorted(c)) or 'none'}" for name, c in own.items())
        raise MeasurementError(
            f"no channel was measured in all conditions and on all of their branches ({told})",
            expected="at least one of force, displacement, stiffness in each of them",
            remedy="leave the conditions out that lack it, or study them as a campaign of their own",
        )
    spare = sorted({c for rs in conditions.values() for r in rs for c in r.channels} - shared)
    lacking = {c: [name for name, has in own.items() if c not in has] for c in spare}
    return shared, [
        f"{channel} was left out, as it was not measured on all branches of {', '.join(names)}."
        for channel, names in lacking.items()
    ]


def smoothing_remarks(histories: Sequence[History]) -> list[str]:
    """By how much temperatures were smoothed, where they are an outcome; see `smoothed`."""
    moved = [
        h.observed["temperature"] - h.inputs["temperature"] for h in histories if "temperature" in h.observed
    ]
    if not moved:
        return []
    rms = float(np.sqrt(np.mean(np.concatenate(moved) ** 2)))
    return [
        "Temperature is an outcome here, of the current. The other channels were computed from temperatures smoothed "
        f"in time within each sweep, from which readings differ by {rms:.2g} K (rms)."
    ]
