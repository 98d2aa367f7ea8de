"""What a gap study can't be made from, said before any work is done."""

from __future__ import annotations

from collections.abc import Sequence

from sma_bayes.errors import MeasurementError
from sma_bayes.records.history import History, histories
from sma_bayes.records.types import Branch, Campaign

LEAST = 24
"""Samples of a condition, at least: its curve, and the functions beside which its noise is estimated, use up fewer."""


def check_campaign(campaign: Campaign) -> tuple[str, ...]:
    """Refuse a campaign in which no disagreement could be found.

    Parameters
    ----------
    campaign : Campaign

    Returns
    -------
    tuple of str
        What can be studied, but has less to tell: conditions with one branch only.

    Raises
    ------
    MeasurementError
        If the conditions share no channel, were measured in different units, or have too few samples.
    """
    found = histories(campaign)
    for history in found[1:]:
        _same_units(found[0], history)
    _common_channel(found)
    for history in found:
        _enough(history)
    return tuple(_one_branch(campaign))


def _same_units(first: History, other: History) -> None:
    for channel in sorted({*first.channels, "temperature"} & {*other.channels, "temperature"}):
        if first.units[channel] != other.units[channel]:
            raise MeasurementError(
                f"{channel} of condition {other.condition.id!r} is in {other.units[channel]}, that of "
                f"{first.condition.id!r} in {first.units[channel]}",
                column=channel,
                expected="conditions that can be compared: the same kind of quantity in the same unit",
                remedy="study them as two campaigns, or correct the units",
            )


def _common_channel(found: Sequence[History]) -> None:
    if set.intersection(*(set(h.channels) for h in found)) - {"temperature"}:
        return
    told = "; ".join(f"{h.condition.id}: {', '.join(h.channels) or 'none'}" for h in found)
    raise MeasurementError(
        f"no channel was measured in all conditions and on all of their branches ({told})",
        expected="at least one of force, displacement, stiffness in each of them",
        remedy="leave the conditions out that lack it, or study them as a campaign of their own",
    )


def _enough(history: History) -> None:
    if history.n < LEAST:
        raise MeasurementError(
            f"condition {history.condition.id!r} has {history.n} samples",
            expected=f"at least {LEAST}, both branches together, so that a pattern can be told from noise",
            remedy="leave the condition out, or measure more finely",
        )


def _one_branch(campaign: Campaign) -> list[str]:
    branches: dict[str, set[Branch]] = {}
    for record in campaign.records:
        branches.setdefault(record.condition.id, set()).add(record.branch)
    return [
        f"{condition} has a {next(iter(found)).value} branch only: nothing could be looked for on the other one"
        for condition, found in branches.items()
        if len(found) == 1
    ]
