"""What a page holds for its chart: the curves, rounded and thinned as stated, and nothing that a name could do."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest

from sma_bayes.report.content import Content
from sma_bayes.report.explorer import MAX_POINTS, Trace, chart_data
from sma_bayes.report.figures.sheet import FigureFiles
from sma_bayes.report.tables import report_tables
from sma_bayes.studies.fit.page import _explored, render

T = np.linspace(20.0, 90.0, 71)
CURVE = 1.0 / (1.0 + np.exp(-0.2 * (T - 55.0)))
TRACE = Trace(
    "100g",
    "heating",
    "force",
    "force F [N]",
    "temperature T [°C]",
    T,
    {"q50": CURVE, "q05": CURVE - 0.1, "q95": CURVE + 0.1, "pred_q05": np.full(71, np.nan)},
    (25.0, 85.0),
    (T[5:66], CURVE[5:66]),
)


def test_the_curve_is_there_to_five_digits_and_a_band_without_numbers_is_not() -> None:
    (found,) = chart_data([TRACE])
    np.testing.assert_allclose(found["q50"], CURVE, rtol=5e-5)
    np.testing.assert_allclose(found["x"], T, rtol=5e-5)
    assert found["inside"] == [25.0, 85.0]
    assert "pred_q05" not in found
    assert json.loads(json.dumps(found, allow_nan=False)) == found


def test_stiffness_comes_first_only_where_a_fit_of_it_converged() -> None:
    """What did not converge has no band, and its stiffness, a ratio of two slopes, is the least of all to be shown."""
    stiffness = replace(TRACE, channel="stiffness", quantity="stiffness K [N/mm]")
    bare = replace(stiffness, quantiles={"q50": CURVE})

    def first(*traces: Trace) -> str:
        figures = {"loop": FigureFiles("loop", "", "", traces=traces)}
        return str(_explored(figures)[0]["quantity"])

    assert first(TRACE, stiffness) == "stiffness K [N/mm]"
    assert first(TRACE, bare) == "force F [N]"


def test_what_is_not_finite_is_null() -> None:
    hole = np.where(T < 30.0, np.nan, CURVE)
    (found,) = chart_data([replace(TRACE, quantiles={"q50": hole})])
    assert found["q50"][:10] == [None] * 10
    assert None not in found["q50"][10:]


def test_what_did_not_converge_has_measurements_and_no_curve(content: Content) -> None:
    (found,) = chart_data([replace(TRACE, quantiles={})])
    assert set(found["q50"]) == {None}
    assert "q05" not in found
    assert len(found["points"][0]) == 61
    page = render(content, report_tables(content), {}, [found])
    assert "What did not converge has no curve." in page


def test_a_curve_that_two_figures_show_is_there_once() -> None:
    assert len(chart_data([TRACE, TRACE, replace(TRACE, branch="cooling")])) == 2


@pytest.mark.parametrize(("n", "every"), [(MAX_POINTS, 1), (MAX_POINTS + 1, 2), (10 * MAX_POINTS, 10)])
def test_of_many_measurements_evenly_spaced_ones_are_drawn_and_counted(n: int, every: int) -> None:
    t = np.linspace(0.0, 1.0, n)
    (found,) = chart_data([replace(TRACE, measured=(t, t**2))])
    x, y = np.array(found["points"])
    assert found["every"] == every
    assert x.size <= MAX_POINTS
    np.testing.assert_allclose(y, x**2, atol=2e-5)


def test_a_page_says_that_not_all_measurements_are_drawn(content: Content) -> None:
    def page(trace: Trace) -> str:
        return render(content, report_tables(content), {}, chart_data([trace]))

    t = np.linspace(20.0, 90.0, 5 * MAX_POINTS)
    assert "Not all measurements are drawn" in page(replace(TRACE, measured=(t, t)))
    assert "Not all measurements are drawn" not in page(TRACE)


def test_a_name_can_not_leave_the_data(content: Content) -> None:
    bad = "</script><script>alert(1)</script>"
    page = render(content, report_tables(content), {}, chart_data([replace(TRACE, condition=bad)]))
    assert "alert(1)</script>" not in page
    assert "<script>alert" not in page
    (text,) = re.findall(r'<script type="application/json">(.*?)</script>', page, re.DOTALL)
    assert json.loads(text)[0]["condition"] == bad


def test_a_page_without_curves_has_no_script(content: Content) -> None:
    assert "<script" not in render(content, report_tables(content), {}, [])


def test_the_script_reaches_nothing_but_its_page() -> None:
    script = resources.files("sma_bayes.report").joinpath("templates/explorer.js").read_text(encoding="utf-8")
    assert not re.search(
        r"fetch|XMLHttp|import|eval|innerHTML|cookie|storage|location", script, re.IGNORECASE
    )
    assert set(re.findall(r"\w+://[^\"]*", script)) == {"http://www.w3.org/2000/svg"}
    assert "</script" not in script
