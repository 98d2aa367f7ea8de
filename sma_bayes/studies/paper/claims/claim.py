"""What a claim and its evidence are, and when a verdict is given.

Claims are many, and of many that are looked at some are sure by chance. So the error that a verdict may have is that
of Holm's step-down rule over all claims that have a probability: the surest of m may err with 5 %/m, the next with
5 %/(m - 1), and so on, until one errs by more (S. Holm, A simple sequentially rejective multiple test procedure,
Scandinavian Journal of Statistics 6 (1979) 65). Nothing holds where the setting of which a claim speaks can't be told
from another one that varied along in the same tests, or where it speaks of numbers that are lost.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from pydantic import Field

from sma_bayes.assess.holm import holm_limits
from sma_bayes.document_part import DocumentPart, NumberOrNull

SURE: Final = 0.95
"""Probability with which all verdicts together are right, by Holm's rule."""
HOLDS, FAILS, OPEN = "holds", "does not hold", "cannot tell from these numbers"


class EvidenceForClaim(DocumentPart):
    """Something that speaks for or against a claim."""

    source: Literal["printed", "twin"] = Field(
        description="`printed`: from printed numbers alone; `twin`: from a campaign drawn from them"
    )
    text: str = Field(description="what was found")
    probability: NumberOrNull = Field(
        description="posterior probability of the claim by it; null where it has none [1]"
    )
    counts: bool = Field(description="whether the verdict may rest on it")


def from_print(text: str, probability: float | None) -> EvidenceForClaim:
    """Evidence from printed numbers; the verdict may rest on it."""
    return EvidenceForClaim(source="printed", text=text, probability=probability, counts=True)


def from_twin(text: str, probability: float | None, counts: bool = False) -> EvidenceForClaim:
    """Evidence from the campaign drawn from them, on which the verdict rests only where that is not circular."""
    return EvidenceForClaim(source="twin", text=text, probability=probability, counts=counts)


@dataclass(frozen=True, slots=True)
class Claim:
    """One claim of the paper.

    Attributes
    ----------
    id, claim : str
    lines : tuple of int
        Of the source text.
    evidence : tuple of EvidenceForClaim
    why : str
        What the verdict means, and what to doubt.
    errata : tuple of str
    confounded : tuple of str
        Settings from which the one of the claim can't be told in the tests that count.
    lost : str
        Numbers of which the claim speaks and which are lost; empty for none.
    allowed_error : float
        Error that a verdict may have: `judged` sets it [1].
    """

    id: str
    claim: str
    lines: tuple[int, ...]
    evidence: tuple[EvidenceForClaim, ...]
    why: str
    errata: tuple[str, ...] = ()
    confounded: tuple[str, ...] = ()
    lost: str = ""
    allowed_error: float = 1.0 - SURE

    @property
    def error(self) -> float | None:
        """Probability that the verdict which the evidence points to is wrong; None without a probability [1]."""
        found = self._probabilities
        return min(1.0 - min(found), max(found)) if found else None

    @property
    def _probabilities(self) -> list[float]:
        return [e.probability for e in self.evidence if e.counts and e.probability is not None]

    @property
    def verdict(self) -> str:
        """``holds`` or ``does not hold`` where all evidence that counts is sure of it; else it can't be told.

        It can't be told of what is confounded or lost either, however sure the evidence.

        Examples
        --------
        >>> Claim("a", "", (), (from_print("", 0.99), from_twin("", 0.2)), "").verdict
        'holds'
        >>> Claim("a", "", (), (from_print("", 0.99), from_twin("", 0.2, True)), "").verdict
        'cannot tell from these numbers'
        """
        found = self._probabilities
        if not found or self.confounded or self.lost:
            return OPEN
        if 1.0 - min(found) <= self.allowed_error:
            return HOLDS
        return FAILS if max(found) <= self.allowed_error else OPEN


def judged(claims: Sequence[Claim]) -> tuple[Claim, ...]:
    """The same claims, each with the error that Holm's rule allows its verdict.

    Examples
    --------
    >>> several = [Claim(str(p), "", (), (from_print("", p),), "") for p in (0.97, 1.0, 0.01, 0.98, 0.5)]
    >>> [c.verdict[:5] for c in judged(several)]
    ['canno', 'holds', 'does ', 'canno', 'canno']
    """
    errors = {i: c.error for i, c in enumerate(claims) if c.error is not None}
    limits = holm_limits(np.array(list(errors.values())), 1.0 - SURE).tolist()
    allowed = dict(zip(errors, limits, strict=True))
    return tuple(replace(c, allowed_error=allowed.get(i, c.allowed_error)) for i, c in enumerate(claims))
