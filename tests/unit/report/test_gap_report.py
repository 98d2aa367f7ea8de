"""The words of a gap report that are decided outside its template."""

from __future__ import annotations

from importlib import resources
from typing import Any

import numpy as np
import pytest

from sma_bayes.effects.needs import NEEDS
from sma_bayes.report.tables import Column, Table
from sma_bayes.studies.gap.figures.missing import prior_density
from sma_bayes.studies.gap.page import by_single_need, fold_texts, share_text, way_text
from sma_bayes.studies.gap.schema import NamedChannel, StatedGap, StatedPeriodicity
from sma_bayes.studies.gap.tables import ADVICE, UNMEASURABLE_NEEDS
from sma_bayes.studies.gap.words import periodic_text


def test_there_is_advice_for_every_need_that_a_recording_can_meet():
    assert set(NEEDS) == set(ADVICE) | UNMEASURABLE_NEEDS


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


def gap(**changes: Any) -> StatedGap:
    stated = {
        "metric": "", "before": 2.0, "after": 1.0, "floor": 1.0, "shrink": 1.0, "noise": 1.0, "way_to_noise": 1.0,
        "channels": {}, "held_out": "", "chosen_without": (),
    }  # fmt: skip
    return StatedGap.model_validate(stated | changes)


def test_folds_are_counted():
    assert fold_texts(gap(chosen_without=(("x",), (), ("x",)))) == ["2 of 3: x", "1 of 3: nothing"]


@pytest.mark.parametrize(
    ("shrink", "text"), [(0.934, "93 %"), (-0.2, "−20 %")]
)  # fmt: skip
def test_the_closed_share_is_a_percentage(shrink: float, text: str):
    assert share_text(gap(shrink=shrink)) == text


def test_where_there_is_nothing_to_close_there_is_no_share():
    assert share_text(gap(before=1.0, shrink=0.0)) == "–"
    assert way_text(gap(before=0.99, way_to_noise=0.0)) == "–"
    assert way_text(gap(before=5.47, way_to_noise=0.0716)) == "7 %"


def test_channels_and_units_are_named_as_the_campaign_calls_them():
    line = StatedPeriodicity(
        condition="2A", channel="force", frequency=0.37, width=0.01, unit="Hz", amplitude=0.042, size_sigma=9.0,
        ln_bayes_factor=30.0,
    )  # fmt: skip
    channels = {"force": NamedChannel(name="force", symbol="F", unit="N")}
    assert periodic_text(channels, line) == (
        "2A: force repeats at 0.37 Hz, out of step with the temperature, amplitude 0.042 N"
    )


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_density_of_a_one_sided_prior_stays_on_its_side(sign: float):
    prior = sign * np.exp(0.4 * np.random.default_rng(0).standard_normal(4000))
    grid = np.linspace(-6.0, 6.0, 2401)
    density = prior_density(prior, grid)
    assert np.all(density[grid * sign <= 0.0] == 0.0)
    assert density.sum() * (grid[1] - grid[0]) == pytest.approx(1.0, abs=0.01)


def test_a_page_speaks_of_functions_without_a_mechanism() -> None:
    """It called them meaningless, as if that were a finding about the measurements."""
    page = resources.files("sma_bayes.studies.gap").joinpath("page.html.j2").read_text(encoding="utf-8")
    assert "smooth function without a mechanism" in page
    assert "meaningless" not in page
