"""Fits that are not adequate, many with the same kind of reason as one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from sma_bayes.assess.adequacy import LARGEST_MISFIT_SHARE
from sma_bayes.errors import first_of
from sma_bayes.runs.fit_document import RecordSummary

RECORDS_NAMED = 3
"""Records that a sentence names."""


@dataclass(frozen=True, slots=True)
class KindOfReason:
    """Words for a kind of reason.

    Attributes
    ----------
    subject : str
        How a sentence on records begins whose first reason it is, with a place for their names.
    counted : str
        What is said of a number of records that have it.
    """

    subject: str
    counted: str


KINDS: Final = {
    "exact": KindOfReason("The data of {records} have no noise", "readings were computed, not measured"),
    "conflict": KindOfReason(
        "The priors exclude what the data say of {records}", "prior and data contradict each other"
    ),
    "sweeps": KindOfReason(
        "One curve does not describe all sweeps of {records}", "sweeps do not repeat each other"
    ),
    "curve": KindOfReason(
        "The curve does not describe {records}",
        f"the curve without a discrepancy misses more than {100 * LARGEST_MISFIT_SHARE:g} % of the range of a channel",
    ),
    "check": KindOfReason(
        "Curve and noise do not give data like those of {records}", "a posterior predictive check fails"
    ),
    "noise": KindOfReason(
        "The noise hides the response in {records}", "the noise takes a large part of the range of a channel"
    ),
    "memory": KindOfReason(
        "The noise takes the place of the curve in {records}",
        "what the curve misses passes for noise with a memory",
    ),
    "tempered": KindOfReason("The fit does not describe the data of {records}", "the likelihood is tempered"),
    "prior": KindOfReason(
        "The data do not determine the curve of {records}",
        "parameters of the curve are led by their priors",
    ),
}
"""Words for all kinds, in the order in which they are counted."""


@dataclass(frozen=True, slots=True)
class ReasonGroup:
    """Records whose first reason is of one kind, of a number of records in all."""

    kind: str
    records: tuple[RecordSummary, ...]
    total: int

    @property
    def names(self) -> str:
        """What the records are called in a sentence."""
        return records_named(self.records, self.total)

    @property
    def quoted(self) -> str:
        """The reason of one record, by name where that of another differs."""
        if self.kind == "curve":
            worst = max(
                self.records, key=lambda r: max((d.share for d in r.discrepancy.values()), default=0.0)
            )
            which = f"most of all {worst.key}: "
        else:
            worst = self.records[0]
            which = f"for one, {worst.key}: "
        alike = len({r.why[0].message for r in self.records}) == 1
        return ("" if alike else which) + worst.why[0].message


def records_named(records: Sequence[RecordSummary], total: int) -> str:
    """The first of some records by name, and how many more there are; where it is all of many, that."""
    if RECORDS_NAMED < len(records) == total:
        return f"all {total} records"
    return first_of([r.key for r in records], RECORDS_NAMED)


def reason_groups(records: Iterable[RecordSummary], total: int) -> tuple[ReasonGroup, ...]:
    """Records that are not adequate by the kind of their first reason; empty where all are adequate.

    Parameters
    ----------
    records : iterable of RecordSummary
    total : int
        How many records the run has.
    """
    kinds: dict[str, list[RecordSummary]] = {}
    for r in records:
        if r.why:
            kinds.setdefault(r.why[0].kind, []).append(r)
    return tuple(ReasonGroup(kind, tuple(found), total) for kind, found in kinds.items())
