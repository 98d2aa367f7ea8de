"""How much findings about the measurements matter, and many of a kind as one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

from sma_bayes.report.content import Finding

Severity = Literal["serious", "look", "note"]
"""``serious``: numbers may be other than they seem; ``look``: rows kept out, or an assumption to confirm; ``note``:
what was done as it should be."""
SEVERITIES: Final[tuple[Severity, ...]] = ("serious", "look", "note")

_SERIOUS: Final = frozenset({
    "branch-contradicted", "clipped", "load-not-constant", "narrow-sweep", "no-branch", "no-transformation",
    "not-constant", "one-branch", "time-restart", "time-reversal", "truncated",
})  # fmt: skip
_NOTES: Final = frozenset({
    "assumed", "constant-channel", "constant-load", "cut", "held-samples", "hold", "not-fitted", "quantised",
    "recognised", "reduced", "segments", "twin",
})  # fmt: skip


def severity(kind: str) -> Severity:
    """How much a kind of finding matters; one that is not known here is worth a look.

    Examples
    --------
    >>> severity("clipped"), severity("spike"), severity("reduced")
    ('serious', 'look', 'note')
    """
    return "serious" if kind in _SERIOUS else "note" if kind in _NOTES else "look"


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
    """

    kind: str
    severity: Severity
    conditions: tuple[str, ...]
    count: int
    dropped: int
    message: str


def finding_groups(findings: Sequence[Finding]) -> tuple[FindingGroup, ...]:
    """Findings by kind, the most serious first."""
    kinds: dict[str, list[Finding]] = {}
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
        )
        for kind, found in kinds.items()
    ]
    return tuple(sorted(groups, key=lambda g: (SEVERITIES.index(g.severity), -g.dropped)))
