"""Average correlation factors in tables and figures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.report.content import PAPER_CORRELATION, Content, Estimate
from sma_bayes.report.figures.averages import LEAST_DISTANCE_FROM_ONE, Mark, correlation_axis
from sma_bayes.report.figures.sheet import empty_sheet
from sma_bayes.report.tables import average_table, cell_text, probability_text
from sma_bayes.runs.schema import AverageR, Factor
from sma_bayes.studies.fit.figures.averages import average_figure

UNDEFINED = Estimate(None, None, None)


def drawn(*estimates: Estimate) -> tuple[tuple[float, float], list[float]]:
    """Limits of the axis as correlations, and the correlations at which there are points."""
    ax = empty_sheet(4.0, 2.0).subplots()
    correlation_axis(ax, [Mark(float(i), e, "black") for i, e in enumerate(estimates)])
    left, right = ax.get_xlim()
    points = [float(1.0 - line.get_xdata()[0]) for line in ax.lines if line.get_marker() == "o"]  # type: ignore[index]
    return (1.0 - left, 1.0 - right), points


@pytest.mark.parametrize("r", [-0.5, 0.2, 0.94, 0.951, 0.9999, 1.0 - 1e-8])
def test_the_axis_shows_every_r_beside_the_papers(r: float) -> None:
    (low, high), points = drawn(Estimate(r, r - 1e-9, r + 1e-9))
    assert low < min(r, PAPER_CORRELATION)
    assert high > max(r, PAPER_CORRELATION)
    assert points == pytest.approx([r])


def test_a_perfect_r_is_drawn_at_the_end_and_an_undefined_one_not_at_all() -> None:
    (_, high), points = drawn(Estimate(1.0, 0.9999, 1.0), UNDEFINED)
    assert points == pytest.approx([1.0 - LEAST_DISTANCE_FROM_ONE])
    assert high <= 1.0


def test_left_out_records_are_counted(content: Content) -> None:
    first = content.averages[0]
    table = average_table(
        [replace(first, document=first.document.model_copy(update={"left_out": ("x", "y")}))]
    )
    assert table.rows[0][4] == f"{len(first.document.records)} of {len(first.document.records) + 2}"


def test_an_average_that_is_not_defined_is_a_dash(content: Content) -> None:
    first = content.averages[0]
    none = {"q05": None, "median": None, "q95": None, "undefined": 1.0}
    without = {"r": {first.rule: AverageR(**none, above=0.0)}, "r2": {first.rule: Factor(**none)}}
    nothing = replace(first, document=first.document.model_copy(update=without))
    row = average_table([nothing]).rows[0]
    assert cell_text(row[5]) == cell_text(None)
    assert row[6] == "< 0.001"
    drawing = average_figure(replace(content, averages=(nothing,)))
    assert np.isnan(drawing.data["r_median [1]"]).all()


def test_the_papers_value_stands_only_beside_its_twin(content: Content) -> None:
    assert content.printed
    of_twin, of_others = average_figure(content), average_figure(replace(content, printed=()))
    assert "that the paper states" in of_twin.caption
    assert "paper" not in of_others.caption
    dashed = [
        [line for ax in d.figure.axes for line in ax.lines if line.get_ls() == "--"]
        for d in (of_twin, of_others)
    ]
    assert dashed[0]
    assert not dashed[1]


def test_probabilities_are_as_sure_as_their_draws() -> None:
    assert [probability_text(1.0, n) for n in (50, 2000, 20000)] == ["> 0.9", "> 0.999", "> 0.9999"]
    assert probability_text(None, 2000) == "–"
