"""When a verdict is given, and how numbers are written on the page."""

from __future__ import annotations

import re

import pytest

from sma_bayes.paper.specifications import TABLE_1, TABLE_2
from sma_bayes.paper.tables import TABLE_6
from sma_bayes.records.types import Branch
from sma_bayes.studies.paper.claims.claim import (
    FAILS,
    HOLDS,
    OPEN,
    Claim,
    EvidenceForClaim,
    from_print,
    from_twin,
    judged,
)
from sma_bayes.studies.paper.page import _untypeset, anchor, pipes, probability
from sma_bayes.studies.paper.schema import JudgedClaim
from sma_bayes.studies.paper.tables import printed_spread


def claim(*evidence: EvidenceForClaim) -> Claim:
    return Claim("id", "text", (1,), evidence, "why")


@pytest.mark.parametrize(
    ("probabilities", "verdict"),
    [
        ((0.97,), HOLDS),
        ((0.97, 0.951), HOLDS),
        ((0.02,), FAILS),
        ((0.5,), OPEN),
        ((0.99, 0.5), OPEN),
        ((0.99, 0.01), OPEN),
        ((None,), OPEN),
        ((None, 0.99), HOLDS),
        ((), OPEN),
    ],
)
def test_a_verdict_needs_all_evidence_that_counts(
    probabilities: tuple[float | None, ...], verdict: str
) -> None:
    evidence = [from_print("", p) for p in probabilities]
    assert claim(*evidence).verdict == verdict
    for circular in (0.0, 1.0):
        assert claim(*evidence, from_twin("", circular)).verdict == verdict
        assert JudgedClaim.about(claim(*evidence)).verdict == verdict


def test_evidence_that_does_not_count_decides_nothing() -> None:
    assert claim(from_twin("", 1.0)).verdict == OPEN


def test_what_is_confounded_or_lost_never_holds() -> None:
    sure = (from_print("", 1.0),)
    assert Claim("id", "text", (1,), sure, "why", confounded=("power",)).verdict == OPEN
    assert Claim("id", "text", (1,), sure, "why", lost="stiffness").verdict == OPEN
    assert Claim("id", "text", (1,), (from_print("", 0.0),), "why", lost="stiffness").verdict == OPEN


def test_verdicts_are_those_of_holm() -> None:
    """By hand: errors 0.001, 0.012, 0.02 and 0.03 of four tests; the limits are 5 % over 4, 3, 2 and 1."""
    several = [claim(from_print("", p)) for p in (0.97, 0.999, 0.012, 0.98, None)]
    found = judged(several)
    assert [c.verdict for c in found] == [HOLDS, HOLDS, FAILS, HOLDS, OPEN]
    assert [round(c.allowed_error, 6) for c in found[:4]] == [0.05, 0.0125, round(0.05 / 3, 6), 0.025]
    stopped = judged([claim(from_print("", p)) for p in (0.96, 0.999, 0.97, 0.96)])
    assert [c.verdict for c in stopped] == [OPEN, HOLDS, OPEN, OPEN]


def test_probabilities_are_not_surer_than_draws() -> None:
    assert [probability(p) for p in (0.994, 0.996, 0.004, 0.951)] == ["0.99", "> 0.99", "< 0.01", "0.95"]


def test_tables_keep_their_columns_whatever_the_cells_hold() -> None:
    text = pipes(("a", "b"), [("|r| > 0.9", "x")])
    assert {len(re.findall(r"(?<!\\)\|", line)) for line in text.splitlines()} == {3}


def test_printed_entries_lose_their_typesetting_and_nothing_else() -> None:
    for table in (TABLE_1, TABLE_2):
        for cell in table.cells:
            shown = _untypeset(cell.entry)
            assert not set(shown) & set("$\\{}^")
            assert re.sub(r"\D", "", cell.printed) in re.sub(r"\D", "", shown)


def test_anchors() -> None:
    assert anchor("The change is 1.5 to 2 A, say") == "the-change-is-15-to-2-a-say"


def test_the_spread_goes_with_the_printed_r2() -> None:
    """R2 = 1 - SSE/(n spread**2), with n = SSE/RMSE**2 + 6."""
    column = TABLE_6.select("1.5A-10mHz", Branch.HEATING)
    spread = printed_spread(column)
    n = 0.0118 / 0.0133**2 + 6
    assert 1.0 - 0.0118 / (n * spread**2) == pytest.approx(0.9980)
