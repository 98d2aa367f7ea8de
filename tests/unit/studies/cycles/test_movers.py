"""Which of several numbers change: against a sum over all choices, one by one."""

from __future__ import annotations

from itertools import product
from math import comb

import numpy as np
import pytest

from sma_bayes.studies.cycles.movers import Movers

ODDS = np.array([[0.3, 20.0], [4.0, 1e-3], [1.0, 1e-3], [0.05, 50.0], [2.0, 1e-3]])
"""Of five numbers under two laws."""
TOTAL = 1.0 + 1.0 / 2.0 + 1.0 / 3.0 + 1.0 / 4.0 + 1.0 / 5.0


def choices(law: int) -> dict[tuple[bool, ...], float]:
    """Prior times likelihood ratio of each choice of at least one."""
    return {
        which: float(np.prod(ODDS[np.array(which), law])) / (sum(which) * comb(5, sum(which)) * TOTAL)
        for which in product((False, True), repeat=5)
        if any(which)
    }


@pytest.mark.parametrize("law", [0, 1])
def test_evidence_is_the_sum_over_all_choices(law: int) -> None:
    found = Movers(np.log(ODDS)).log_odds[law]
    assert found == pytest.approx(np.log(sum(choices(law).values())), rel=1e-12)


@pytest.mark.parametrize("law", [0, 1])
def test_draws_are_choices_as_often_as_these_are_probable(law: int) -> None:
    """All 31 within four and a half standard errors and half a draw: a false alarm once in 4,700 runs."""
    size = 100_000
    drawn = Movers(np.log(ODDS)).draw(np.full(size, law), np.random.default_rng(3))
    assert drawn.any(axis=0).all()
    codes = 2 ** np.arange(5) @ drawn
    total = sum(choices(law).values())
    for which, weight in choices(law).items():
        p = weight / total
        many = int(np.sum(codes == 2 ** np.arange(5) @ np.array(which)))
        assert abs(many - size * p) < 4.5 * np.sqrt(size * p * (1.0 - p)) + 0.5


def test_a_single_one_always_changes_and_quiet_ones_cost_little() -> None:
    """One that is 1,000 times likelier to change, beside fifteen that are ten times likelier to stay.

    Were each to change with probability 1/2, these would cost it all evidence.
    """
    alone = Movers(np.array([[-3.0]]))
    assert alone.log_odds[0] == pytest.approx(-3.0)
    assert alone.draw(np.zeros(9, dtype=np.int64), np.random.default_rng(0)).all()
    odds = np.log(np.concatenate([[1000.0], np.full(15, 0.1)]))[:, None]
    of_one_alone, of_a_half = 1000.0 / (16.0 * np.sum(1.0 / np.arange(1.0, 17.0))), 0.5 * 1001.0 * 0.55**15
    assert Movers(odds).log_odds[0] > np.log(of_one_alone) > np.log(of_a_half) + 4.0
