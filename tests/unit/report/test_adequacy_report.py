"""What the report says and shows of curves that do not describe their data."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest

from sma_bayes import fit_campaign
from sma_bayes.assess.adequacy import Reason
from sma_bayes.records.types import Branch, Campaign, Condition, Record
from sma_bayes.report.content import Content, RecordContent
from sma_bayes.report.figures.sheet import STYLE, save
from sma_bayes.report.tables import report_tables
from sma_bayes.runs.outputs import StoredRun, read_run
from sma_bayes.runs.schema import ModelChoiceDocument
from sma_bayes.runs.stored_draws import draws_of
from sma_bayes.studies.fit.figures.discrepancy import discrepancy_figure
from sma_bayes.studies.fit.page import render
from sma_bayes.studies.fit.report_content import report_content

MIDDLE, SHARE = 40.0, 0.15
"""Midpoint of the second step [degC] and its share of the span."""


@pytest.fixture(scope="module")
def run(make_record: Callable[..., Record], tmp_path_factory: pytest.TempPathFactory) -> StoredRun:
    """A finished fit of two conditions that share their parameters; displacement has a second step."""
    records = []
    for i, name in enumerate(("a", "b")):
        r = make_record(n=80, seed=i, noise=0.004)
        step = 1.0 / (1.0 + np.exp(-1.2 * (r.temperature - MIDDLE)))
        x = r.observed["displacement"]
        seen = {**r.observed, "displacement": x + SHARE * np.ptp(x) * step}
        records.append(replace(r, condition=Condition(name), branch=Branch.HEATING, observed=seen))
    folder = tmp_path_factory.mktemp("steps") / "run"
    fit_campaign(
        Campaign("steps", "made up", "0", tuple(records)), folder, noise="independent", pool="campaign",
        jobs=1, figures=False,
    )  # fmt: skip
    return read_run(folder)


@pytest.fixture(scope="module")
def steps(run: StoredRun) -> Content:
    return report_content(run)


def told(r: RecordContent, **changes: Any) -> RecordContent:
    """A record whose document says something else."""
    return replace(r, document=r.document.model_copy(update=changes))


def text_of(content: Content) -> str:
    return " ".join(render(content, report_tables(content), {}).split())


def test_reasons_stand_near_the_top(steps: Content) -> None:
    page = text_of(steps)
    assert "0 of 2</b> records adequate" in page
    section = page[page.index('id="adequacy"') : page.index('id="noise"')]
    for r in steps.records:
        assert r.document.why[0].message in section
        assert "displacement by up to" in r.document.why[0].message
    assert "What the curves miss" in section
    answer = page[page.index('id="answer"') : page.index('id="conclusions"')]
    assert all(r.document.why[0].message in answer for r in steps.records)


def test_an_adequate_record_is_said_to_be(steps: Content) -> None:
    good = replace(
        steps, records=tuple(replace(told(r, why=(), discrepancy={}), adequate=True) for r in steps.records)
    )
    page = text_of(good)
    assert "All records are adequate." in page
    assert "not adequate</span>" not in page
    assert "What the curves miss" not in page
    assert "Nearest published parameters" not in page


def test_nearest_parameters_state_norm_and_range(steps: Content) -> None:
    page = text_of(steps)
    part = page[page.index('id="nearest"') : page.index('id="agreement"')]
    assert "least mean square over the temperatures that were measured" in part
    assert "30.00 to 70.00 °C" in part
    table = report_tables(steps)["nearest"]
    keys = [c.key for c in table.columns]
    found = {row[keys.index("parameter")] for row in table.rows}
    assert found == {"A1", "A2", "A3", "A4", "B1", "B2", "B3", "B4"}


def test_a_model_that_was_chosen_is_told_with_its_reason(steps: Content) -> None:
    choice = ModelChoiceDocument(
        name="two_stage", reason="two_stage: ln evidence 40 more", ln_evidence={}, held_out={}
    )
    chosen = replace(told(steps.records[0], model_choice=choice), model="two_stage")
    page = text_of(replace(steps, records=(chosen, *steps.records[1:])))
    assert page.count("two_stage: ln evidence 40 more") == 2, "in the diagnostics and with the record"


def test_stiffness_that_is_withheld_is_told(steps: Content) -> None:
    why = Reason(
        kind="prior",
        channel="force",
        message="the data hardly tell where and how fast force changes: its prior does",
    )
    led = told(steps.records[0], quantities_of_branch=(), why=(why,))
    assert led.stiffness_withheld == (why,)
    page = text_of(replace(steps, records=(led, *steps.records[1:])))
    part = page[page.index('id="loops"') : page.index('id="transformation"')]
    assert "No stiffness is given where the prior" in part
    assert why.message in part
    assert "No stiffness is given" not in text_of(steps)


def test_the_figure_shows_what_is_missed(run: StoredRun, steps: Content, tmp_path: Path) -> None:
    """Its data tell the step that was put in, as far as no sigmoid can take it up."""
    for content, summary in zip(steps.records, run.summary.records, strict=True):
        files = save(
            partial(discrepancy_figure, content, draws_of(run.folder, summary, run.summary.seed)), tmp_path
        )
        assert {p.suffix for p in tmp_path.glob(f"{files.stem}.*")} == {".pdf", ".png", ".csv"}
        with (tmp_path / f"{files.stem}.csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        assert set(content.document.discrepancy) == {"force", "displacement"}
        assert sum(row["what"] == "measured" for row in rows) == 2 * content.document.n
        curve = [row for row in rows if row["what"] == "curve" and row["channel"] == "displacement"]
        unit = "[unit]"
        middle = np.array([float(row[f"discrepancy_q50 {unit}"]) for row in curve])
        model, total = (
            np.array([float(row[f"{name} {unit}"]) for row in curve]) for name in ("model_q50", "total_q50")
        )
        missed = content.document.discrepancy["displacement"]
        assert np.abs(middle).max() == pytest.approx(abs(missed.largest), rel=0.02)
        np.testing.assert_allclose(model + middle, total, atol=0.1 * np.abs(middle).max())


def test_nothing_of_it_lies_beyond_the_sheet(run: StoredRun, steps: Content) -> None:
    with mpl.rc_context(STYLE):
        figure = discrepancy_figure(
            steps.records[0], draws_of(run.folder, run.summary.records[0], run.summary.seed)
        ).figure
        figure.canvas.draw()
        width, height = figure.canvas.get_width_height()
        for part in (*figure.axes, *figure.texts, *figure.legends):
            box = part.get_tightbbox()
            assert box is not None
            assert min(box.x0, box.y0) >= -1, part
            assert box.x1 <= width + 1, part
            assert box.y1 <= height + 1, part
