"""Fits that are not adequate, many with the same kind of reason as one."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from sma_bayes.errors import first_of
from sma_bayes.runs.fit_document import RecordSummary

RECORDS_NAMED = 3
"""Records that a sentence names."""


@dataclass(frozen=True, slots=True)
class ReasonGroup:
    """Records whose first reason is of one kind."""

    kind: str
    records: tuple[RecordSummary, ...]

    @property
    def names(self) -> str:
        """The first records by name, and how many more there are."""
        return first_of([r.key for r in self.records], RECORDS_NAMED)

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


def reason_groups(records: Iterable[RecordSummary]) -> tuple[ReasonGroup, ...]:
    """Records that are not adequate by the kind of their first reason; empty where all are adequate."""
    kinds: dict[str, list[RecordSummary]] = {}
    for r in records:
        if r.why:
            kinds.setdefault(r.why[0].kind, []).append(r)
    return tuple(ReasonGroup(kind, tuple(found)) for kind, found in kinds.items())
