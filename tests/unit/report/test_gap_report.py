"""The words of a gap report that are decided outside its template."""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.effects.needs import NEEDS
from sma_bayes.report.tables import Column, Table
from sma_bayes.studies.gap.figures.missing import prior_density
from sma_bayes.studies.gap.page import by_single_need, fold_texts, share_text
from sma_bayes.studies.gap.tables import ADVICE, NOT_THERE


def test_there_is_advice_for_every_need_that_a_recording_can_meet():
    assert set(NEEDS) == set(ADVICE) | NOT_THERE


def test_effects_that_lack_one_thing_are_listed_under_it():
    columns = tuple(Column(k, k) for k in ("effect", "finding", "remedy"))
    rows = (
        ("a", "-", "record time"),
        ("b", "-", "record time; cycle"),
        ("c", "-", "cycle"),
        ("d", "-", "cycle"),
    )
    table = Table("untestable", "", "", columns, (*rows, ("e", "-", "nothing: its mark is not there")))
    assert by_single_need(table) == [("cycle", ["c", "d"]), ("record time", ["a"])]


def test_folds_are_counted():
    found = {"gap": {"chosen_without": [["x"], [], ["x"]]}}
    assert fold_texts(found) == ["2 of 3: x", "1 of 3: nothing"]


@pytest.mark.parametrize(
    ("shrink", "text"), [(0.934, "93 %"), (-0.2, "−20 %"), (None, "–")]
)  # fmt: skip
def test_the_closed_share_is_a_percentage(shrink: float | None, text: str):
    assert share_text({"before": 2.0, "floor": 1.0, "shrink": shrink}) == text


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_density_of_a_one_sided_prior_stays_on_its_side(sign: float):
    prior = sign * np.exp(0.4 * np.random.default_rng(0).standard_normal(4000))
    grid = np.linspace(-6.0, 6.0, 2401)
    density = prior_density(prior, grid)
    assert np.all(density[grid * sign <= 0.0] == 0.0)
    assert density.sum() * (grid[1] - grid[0]) == pytest.approx(1.0, abs=0.01)
