"""What a claim and its evidence are, and when a verdict is given."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

SURE: Final = 0.95
"""Probability from which a claim holds; below one less this it does not."""
HOLDS, FAILS, OPEN = "holds", "does not hold", "cannot tell from these numbers"


@dataclass(frozen=True, slots=True)
class ClaimEvidence:
    """Something that speaks for or against a claim.

    Attributes
    ----------
    source : str
        ``printed`` or ``twin``.
    text : str
    probability : float or None
        Posterior probability of the claim by this evidence; None where it has none [1].
    counts : bool
        Whether the verdict may rest on it.
    """

    source: str
    text: str
    probability: float | None
    counts: bool = True


@dataclass(frozen=True, slots=True)
class Claim:
    """One claim of the paper.

    Attributes
    ----------
    id, text : str
    lines : tuple of int
        Of the source text.
    evidence : tuple of ClaimEvidence
    why : str
        What the verdict means, and what to doubt.
    errata : tuple of str
    """

    id: str
    text: str
    lines: tuple[int, ...]
    evidence: tuple[ClaimEvidence, ...]
    why: str
    errata: tuple[str, ...] = ()

    @property
    def verdict(self) -> str:
        """``holds`` or ``does not hold`` where all evidence that counts is sure of it; else it can't be told.

        Examples
        --------
        >>> Claim("a", "", (), (ClaimEvidence("printed", "", 0.99), ClaimEvidence("twin", "", 0.2, False)), "").verdict
        'holds'
        >>> Claim("a", "", (), (ClaimEvidence("printed", "", 0.99), ClaimEvidence("twin", "", 0.2)), "").verdict
        'cannot tell from these numbers'
        """
        found = [e.probability for e in self.evidence if e.counts and e.probability is not None]
        if found and min(found) >= SURE:
            return HOLDS
        return FAILS if found and max(found) <= 1.0 - SURE else OPEN

    def document(self) -> dict[str, Any]:
        """As the result file has it."""
        return {
            "id": self.id,
            "claim": self.text,
            "lines": list(self.lines),
            "verdict": self.verdict,
            "why": self.why,
            "errata": list(self.errata),
            "evidence": [
                {"source": e.source, "text": e.text, "probability": e.probability, "counts": e.counts}
                for e in self.evidence
            ],
        }
