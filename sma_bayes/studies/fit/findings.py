"""How much findings about the measurements matter, and many of a kind as one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sma_bayes.records.severity import SEVERITIES, Severity, severity
from sma_bayes.runs.schema import FindingDocument


@dataclass(frozen=True, slots=True)
class FindingGroup:
    """Findings of one kind.

    Attributes
    ----------
    kind : str
    severity : str
    conditions : tuple of str
        That they concern; empty where they concern the whole campaign.
    count : int
        How many there are.
    dropped : int
        Rows that were kept out.
    message : str
        Of the first.
    alike : bool
        Whether all say the same.
    """

    kind: str
    severity: Severity
    conditions: tuple[str, ...]
    count: int
    dropped: int
    message: str
    alike: bool

    @property
    def reason(self) -> str:
        """The message without the rows of one finding, which are not those of the group; of one by name, if of one."""
        said = self.message.partition(" kept out: ")[2]
        if said or self.alike:
            return said or self.message
        return (
            f"for one, {self.conditions[0]}: {self.message}"
            if self.conditions
            else f"for one: {self.message}"
        )


def finding_groups(findings: Sequence[FindingDocument]) -> tuple[FindingGroup, ...]:
    """Findings by kind, the most serious first."""
    kinds: dict[str, list[FindingDocument]] = {}
    for f in findings:
        kinds.setdefault(f.kind, []).append(f)
    groups = [
        FindingGroup(
            kind,
            severity(kind),
            tuple(dict.fromkeys(f.condition for f in found if f.condition)),
            len(found),
            sum(f.dropped for f in found),
            found[0].message,
            len({f.message for f in found}) == 1,
        )
        for kind, found in kinds.items()
    ]
    return tuple(sorted(groups, key=lambda g: (SEVERITIES.index(g.severity), -g.dropped)))
