"""Figures: their files, their data, and what they say when something is odd."""

from __future__ import annotations

import csv
import os
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib import resources
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from sma_bayes.report.content import Content, RecordContent
from sma_bayes.report.figures.sheet import (
    STYLE,
    BranchData,
    Drawing,
    abridged,
    in_units_of,
    ordered_colours,
    power_of,
    save,
    take_power,
    wrapped,
)
from sma_bayes.runs.outputs import StoredBand
from sma_bayes.studies.fit.figures.campaign import (
    correlation_figure,
    diagnostics_figure,
    parameter_figure,
    printed_figure,
)
from sma_bayes.studies.fit.figures.condition import loop_figure, overview_figure
from sma_bayes.studies.fit.figures.marginals import corner_figure
from sma_bayes.studies.fit.figures.publication import publication_figure
from sma_bayes.studies.fit.figures.record import predictive_figure, residual_figure, trace_figure
from sma_bayes.studies.fit.residuals import standardised_residuals

Gather = Callable[[RecordContent], BranchData]
FIGURES = ("loop", "overview", "corner", "trace", "predictive", "residuals", "correlation", "parameters",
           "diagnostics", "printed")  # fmt: skip


def draw(kind: str, content: Content, gather: Gather) -> Drawing:
    branches = [gather(r) for r in content.records]
    first = branches[0]
    e = standardised_residuals(first.content, first.stored, first.curve)
    with mpl.rc_context(STYLE):
        return {
            "loop": partial(loop_figure, first.content.condition, branches),
            "overview": partial(overview_figure, "stiffness", {first.content.condition: branches}),
            "corner": partial(corner_figure, first),
            "trace": partial(trace_figure, first),
            "predictive": partial(predictive_figure, first),
            "residuals": partial(residual_figure, first, e),
            "correlation": partial(correlation_figure, content),
            "parameters": partial(parameter_figure, content),
            "diagnostics": partial(diagnostics_figure, content),
            "printed": partial(printed_figure, content),
        }[kind]()


def words(figure: Figure) -> str:
    return " | ".join(t.get_text() for t in figure.findobj(mpl.text.Text))


@pytest.mark.parametrize("kind", FIGURES)
def test_each_figure_has_its_data_beside_it(
    kind: str, content: Content, branch_of: Gather, tmp_path: Path
) -> None:
    drawing = draw(kind, content, branch_of)
    files = save(lambda: drawing, tmp_path)
    assert {p.suffix for p in tmp_path.iterdir()} == {".pdf", ".png", ".csv"}
    assert {p.stem for p in tmp_path.iterdir()} == {files.stem}
    assert (tmp_path / f"{files.stem}.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / f"{files.stem}.pdf").read_bytes().startswith(b"%PDF")
    with (tmp_path / f"{files.stem}.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    assert len(rows) > 1
    assert len({len(row) for row in rows}) == 1
    assert drawing.alt
    assert drawing.caption.endswith(".")


@pytest.mark.parametrize("kind", FIGURES)
def test_nothing_is_drawn_beyond_the_sheet(kind: str, content: Content, branch_of: Gather) -> None:
    figure = draw(kind, content, branch_of).figure
    with mpl.rc_context(STYLE):
        figure.canvas.draw()
        width, height = figure.canvas.get_width_height()
        for part in (*figure.axes, *figure.texts, *figure.legends):
            box = part.get_tightbbox()
            assert box is not None
            inside = box.x0 >= -1 and box.y0 >= -1 and box.x1 <= width + 1 and box.y1 <= height + 1
            assert inside, f"{part} at {box} on a sheet of {width} by {height}"


@pytest.mark.parametrize("kind", ["parameters", "printed"])
def test_a_number_at_the_end_of_an_axis_is_not_cut(kind: str, content: Content, branch_of: Gather) -> None:
    """A4 of the Flexinol wire had its last number, 0.044, at the edge of the sheet."""
    figure = draw(kind, content, branch_of).figure
    with mpl.rc_context(STYLE):
        for ax in figure.axes:
            ax.set_xticks([ax.get_xlim()[1]], ["\N{MINUS SIGN}0.0444"])
        figure.canvas.draw()
        for ax in figure.axes:
            box = ax.get_tightbbox()
            assert box is not None
            assert box.x1 <= figure.canvas.get_width_height()[0]


def test_the_same_figure_is_the_same_to_the_byte(content: Content, branch_of: Gather, tmp_path: Path) -> None:
    for folder in ("a", "b"):
        save(lambda: draw("corner", content, branch_of), tmp_path / folder)
    for a, b in zip(sorted((tmp_path / "a").iterdir()), sorted((tmp_path / "b").iterdir()), strict=True):
        assert a.read_bytes() == b.read_bytes(), a.name


def test_fonts_are_truetype_and_the_same_in_every_process(
    content: Content, branch_of: Gather, tmp_path: Path
) -> None:
    command = (
        "import hashlib, matplotlib.font_manager as m; from sma_bayes.report.figures.typeface import families;"
        "print(hashlib.sha256(open(m.findfont(families()[0]), 'rb').read()).hexdigest(), m.findfont(families()[0]))"
    )
    found = [
        subprocess.run(
            [sys.executable, "-c", command],
            capture_output=True, text=True, timeout=120, check=True,
            env={**os.environ, "MPLCONFIGDIR": str(tmp_path / cache)},
        ).stdout.split()
        for cache in ("one", "other", "other")
    ]  # fmt: skip
    assert len({digest for digest, _ in found}) == 1
    assert found[1] == found[2]  # kept for the next process
    save(lambda: draw("diagnostics", content, branch_of), tmp_path)
    (pdf,) = tmp_path.glob("*.pdf")
    assert b"/FontFile2" in pdf.read_bytes()
    assert b"/Type3" not in pdf.read_bytes()


def test_settings_of_others_are_left_alone(content: Content, branch_of: Gather, tmp_path: Path) -> None:
    before = dict(mpl.rcParams)
    save(lambda: draw("diagnostics", content, branch_of), tmp_path)
    assert dict(mpl.rcParams) == before


def test_pyplot_is_not_needed() -> None:
    command = "import sys, sma_bayes.studies.report.build; print('matplotlib.pyplot' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", command], capture_output=True, text=True, timeout=120, check=True
    )
    assert done.stdout.strip() == "False"


def test_the_loop_holds_what_was_measured_and_the_bands(content: Content, branch_of: Gather) -> None:
    drawing = draw("loop", content, branch_of)
    what, channel = np.array(drawing.data["what"]), np.array(drawing.data["channel"])
    assert (what == "measured").sum() == 2 * sum(r.document.n for r in content.records)
    assert set(channel[what == "measured"]) == {"force", "displacement"}
    assert (what == "band").sum() == 2 * 3 * 161
    assert "Stiffness (derived)" in words(drawing.figure)
    assert "temperature T [arbitrary unit]" in words(drawing.figure)
    assert "stiffness K [N/cm]" in words(drawing.figure)


def test_the_loop_marks_transformation_temperatures(content: Content, branch_of: Gather) -> None:
    """Labels at the edge stand at the medians; a record whose sweep stops short has its label in brackets."""
    (condition,) = content.conditions
    records = content.branches(condition)
    branches = [branch_of(r) for r in records]
    first = records[0].document
    extrapolated = {n: t.model_copy(update={"within_data": False}) for n, t in first.transformation.items()}
    short = replace(records[0], document=first.model_copy(update={"transformation": extrapolated}))
    figure = loop_figure(condition, [replace(branches[0], content=short), *branches[1:]])
    labels = {text.get_text(): text.get_position()[0] for ax in figure.figure.axes for text in ax.texts}
    told = {n: t.median for r in records for n, t in r.document.transformation.items()}
    assert set(told) == {"As", "Af", "Mf", "Ms"}
    assert {n.strip("()"): x for n, x in labels.items() if n.strip("()") in told} == told
    assert {"(As)", "(Af)", "Ms", "Mf"} <= set(labels)
    marked = next(ax for ax in figure.figure.axes if "As" in {t.get_text().strip("()") for t in ax.texts})
    low, high = marked.get_ylim()
    medians = np.concatenate([line.get_ydata() for line in marked.lines if len(line.get_xdata()) == 161])
    assert medians.min() > low + 0.1 * (high - low)  # the names stand between the curves and the edge
    assert medians.max() < high - 0.1 * (high - low)
    data = dict(
        zip(
            figure.data["what"],
            figure.data[next(k for k in figure.data if k.startswith("temp"))],
            strict=True,
        )
    )
    assert {n: data[f"{n} median"] for n in told} == told


def test_a_record_that_did_not_converge_is_marked(content: Content, branch_of: Gather) -> None:
    bad = replace(
        content, records=tuple(replace(r, converged=r.branch == "cooling") for r in content.records)
    )
    for kind in ("loop", "corner", "trace", "predictive", "residuals"):
        assert "NOT CONVERGED: heating" in words(draw(kind, bad, branch_of).figure), kind
    assert "not converged" in words(draw("overview", bad, branch_of).figure)
    for kind in ("parameters", "correlation"):
        assert "cross marks a record that did not converge" in draw(kind, bad, branch_of).caption


def wild(branch: BranchData) -> BranchData:
    """A branch that did not converge, whose curves are a thousand times too large."""
    bands = {
        channel: StoredBand(
            band.temperature, {n: 1e3 * q for n, q in band.quantiles.items()}, band.extrapolated
        )
        for channel, band in branch.bands.items()
    }
    return replace(branch, bands=bands, content=replace(branch.content, converged=False))


def test_a_curve_that_did_not_converge_has_no_say_in_the_axis(content: Content, branch_of: Gather) -> None:
    """Of a wire in water it ran to -3000 mm, and nothing was seen of a stroke of 15 mm."""
    branches = [branch_of(r) for r in content.records]
    with mpl.rc_context(STYLE):
        plain, other = (
            loop_figure("c", some).figure for some in (branches, [wild(branches[0]), *branches[1:]])
        )
        alone = overview_figure("force", {"c": [wild(b) for b in branches]}).figure
    for before, after in zip(plain.axes[:2], other.axes[:2], strict=True):
        assert np.ptp(after.get_ylim()) == pytest.approx(np.ptp(before.get_ylim()), rel=0.2)
    force = np.concatenate([b.stored.observed["force"] for b in branches])
    assert np.ptp(alone.axes[0].get_ylim()) == pytest.approx(np.ptp(force), rel=0.2)


def test_what_did_not_converge_is_measurements_alone_in_a_chart_and_for_a_paper(
    content: Content, branch_of: Gather
) -> None:
    """A figure for a paper drew its curve and bands beside the others without a word."""
    good, bad = (branch_of(r) for r in content.records)
    bad = wild(bad)
    with mpl.rc_context(STYLE):
        figure = publication_figure("c", [good, bad], 3.3)
        before = publication_figure("c", [good], 3.3)
    assert f"{bad.content.branch}, not converged" in words(figure.figure)
    assert "What did not converge has no curve" in figure.caption
    for ax, alone in zip(figure.figure.axes, before.figure.axes, strict=True):
        assert len(ax.lines) == len(alone.lines)
        assert np.ptp(ax.get_ylim()) < 10.0 * np.ptp(alone.get_ylim())
    traces = overview_figure("force", {"c": [good, bad]}).traces
    assert [bool(t.quantiles) for t in traces] == [True, False]
    assert traces[1].measured is not None
    assert len(overview_figure("stiffness", {"c": [good, bad]}).traces) == 1, "nothing of it was measured"


def steep(branch: BranchData, low: float, high: float) -> BranchData:
    """A branch whose stiffness runs evenly in its logarithm."""
    band = branch.bands["stiffness"]
    curve = np.geomspace(low, high, band.temperature.size)
    names = {
        name: curve * f
        for name, f in (("q05", 0.9), ("q25", 0.95), ("q50", 1.0), ("q75", 1.05), ("q95", 1.1))
    }
    missing = np.full(curve.size, np.nan)
    changed = StoredBand(
        band.temperature, names | {"pred_q05": missing, "pred_q95": missing}, band.extrapolated
    )
    return replace(branch, bands={**branch.bands, "stiffness": changed})


def test_a_logarithmic_axis_says_so(content: Content, branch_of: Gather) -> None:
    branches = [branch_of(r) for r in content.records]
    with mpl.rc_context(STYLE):
        plain = loop_figure("c", [steep(b, 1.0, 20.0) for b in branches]).figure
        logarithmic = loop_figure("c", [steep(b, 1e-3, 50.0) for b in branches]).figure
        logarithmic.draw_without_rendering()
    assert "log" not in words(plain)
    assert "stiffness K [N/cm], log axis" in words(logarithmic)
    assert {"0.01", "1", "10"} <= set(words(logarithmic).split(" | "))
    assert "$" not in words(logarithmic), "mathematical text is switched off"


def test_a_band_that_leaves_the_axis_is_told(content: Content, branch_of: Gather) -> None:
    branch = branch_of(content.records[0])
    band = branch.bands["stiffness"]
    wild = StoredBand(
        band.temperature, {**band.quantiles, "q95": band.quantiles["q95"] + 1e6}, band.extrapolated
    )
    with mpl.rc_context(STYLE):
        figure = loop_figure("c", [replace(branch, bands={**branch.bands, "stiffness": wild})]).figure
    assert "the band goes beyond the axis" in words(figure)
    assert figure.axes[2].get_ylim()[1] < 10.0


def test_a_stiffness_that_overflows_is_still_drawn(
    content: Content, branch_of: Gather, tmp_path: Path
) -> None:
    branch = branch_of(content.records[0])
    band = branch.bands["stiffness"]
    wild = {name: np.abs(q) * np.geomspace(1.0, 1e290, q.size) for name, q in band.quantiles.items()}
    for q in wild.values():
        q[-5:] = np.nan  # what is not finite is an empty cell in the file
    bands = {**branch.bands, "stiffness": StoredBand(band.temperature, wild, band.extrapolated)}
    changed = replace(branch, bands=bands)
    for figure in (
        partial(loop_figure, "c", [changed]),
        partial(overview_figure, "stiffness", {"c": [changed]}),
    ):
        save(figure, tmp_path)
    assert "logarithmic axis" in words(save_and_look(partial(loop_figure, "c", [changed])))


def save_and_look(make: Callable[[], Drawing]) -> Figure:
    with mpl.rc_context(STYLE):
        return make().figure


def test_an_uncertain_calibration_is_told(content: Content, branch_of: Gather) -> None:
    branch = branch_of(content.records[0])
    uncertain = replace(branch, content=replace(branch.content, calibration=("force: scale known to 2 %",)))
    with mpl.rc_context(STYLE):
        assert "calibration" not in loop_figure("c", [branch]).caption
        assert "carry the uncertainty of the calibration" in loop_figure("c", [uncertain]).caption


def test_extrapolation_is_marked(content: Content, branch_of: Gather) -> None:
    branch = branch_of(content.records[0])
    outside = np.arange(161) > 150
    bands = {c: StoredBand(b.temperature, b.quantiles, outside) for c, b in branch.bands.items()}
    with mpl.rc_context(STYLE):
        figure = loop_figure("c", [replace(branch, bands=bands)]).figure
    assert "extrapolated" in words(figure)


def test_prior_driven_parameters_are_marked_in_the_corner(content: Content, branch_of: Gather) -> None:
    record = content.records[0]
    parameters = tuple(
        p.model_copy(update={"identified": p.name != "A1", "contraction": 0.2}) for p in record.parameters
    )
    with mpl.rc_context(STYLE):
        drawing = corner_figure(branch_of(replace(record, parameters=parameters)))
    assert "Tinted: A1" in drawing.caption
    assert "not identified by the data" in words(drawing.figure)


def test_the_corner_holds_the_prior_density(content: Content, branch_of: Gather) -> None:
    data = draw("corner", content, branch_of).data
    what = np.array(data["what"])
    p = next(p for p in content.records[0].parameters if p.name == "A3")
    column = np.asarray(data["A3 [arbitrary]"])
    x, density = column[what == "prior, value"], column[what == "prior, density"]
    mean, sd = p.numbers["mean"], p.numbers["sd"]
    assert density == pytest.approx(np.exp(-0.5 * ((x - mean) / sd) ** 2) / (sd * np.sqrt(2 * np.pi)))
    assert (what == "posterior draw").sum() == branch_of(content.records[0]).stored.draws["A3"].size


def test_one_branch_and_one_channel_make_figures_too(content: Content, branch_of: Gather) -> None:
    branch = branch_of(content.records[0])
    record = replace(branch.content, channels=branch.content.channels[:1])
    alone = replace(branch, content=record)
    with mpl.rc_context(STYLE):
        assert loop_figure("c", [alone]).figure.axes
        assert predictive_figure(alone).figure.axes
        assert correlation_figure(replace(content, records=(record,))).figure.axes


def test_a_dollar_sign_in_a_name_is_only_a_dollar_sign(
    content: Content, branch_of: Gather, tmp_path: Path
) -> None:
    record = replace(content.records[0], key="cost $5_x$ \\frac", condition="cost $5_x$ \\frac")
    save(partial(trace_figure, branch_of(content.records[0])), tmp_path)
    with mpl.rc_context(STYLE):
        figure = diagnostics_figure(replace(content, records=(record,))).figure
        figure.canvas.draw()
    assert "cost $5_x$ \\frac" in words(figure)


def test_powers_of_ten_go_into_the_unit() -> None:
    assert power_of(np.array([0.0, 4e-4])) == -4
    assert power_of(np.array([-20.0, 3.0])) == 0
    assert power_of(np.array([2e8])) == 8
    assert power_of(np.array([])) == 0
    assert in_units_of(8, "Pa") == "10⁸ Pa"
    assert in_units_of(0, "1") == "1"
    axes = Figure().add_subplot()
    axes.set_ylim(0.0, 3e8)
    assert take_power(axes.yaxis) == 8
    assert [t.get_text() for t in axes.yaxis.get_ticklabels()][-1] in ("3", "3.0")


def test_long_names_lose_their_middle() -> None:
    assert abridged("short") == "short"
    assert abridged("a" * 30 + "b" * 30, 21) == "a" * 10 + "…" + "b" * 10


def test_long_names_are_in_lines_before_they_lose_their_middle() -> None:
    name = "bench rig 7, spring 2, load 150 g, second day"
    assert wrapped(name, 20, 3) == "bench rig 7, spring\n2, load 150 g,\nsecond day"
    begin, end = wrapped(name, 20, 2).splitlines()
    assert begin.startswith("bench rig 7,")
    assert end.endswith("second day")
    assert max(len(begin), len(end)) <= 20
    assert wrapped("a" * 40 + "b" * 40, 20, 2) == "a" * 19 + "…\n" + "b" * 19
    assert wrapped("short", 20, 2) == "short"


def luminance(colour: np.ndarray) -> float:
    """Relative luminance, as WCAG has it."""
    linear = np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)
    return float(linear @ (0.2126, 0.7152, 0.0722))


def test_no_colour_of_an_order_is_lost_on_a_light_or_a_dark_page() -> None:
    """The last curves of a training were dark on a dark page."""
    style = resources.files("sma_bayes.report").joinpath("templates/report.css").read_text(encoding="utf-8")
    found = re.search(r"invert\(([\d.]+)\) hue-rotate\(180deg\) brightness\(([\d.]+)\)", style)
    assert found is not None
    share, brighter = map(float, found.groups())
    grey = np.tile((0.213, 0.715, 0.072), (3, 1))

    def on_a_dark_page(colour: np.ndarray) -> np.ndarray:
        turned = (2.0 * grey - np.eye(3)) @ (
            share - (2.0 * share - 1.0) * colour
        )  # by 180 degrees, as CSS does
        return np.clip(np.clip(turned, 0.0, 1.0) * brighter, 0.0, 1.0)

    white, dark = 1.0, luminance(on_a_dark_page(np.ones(3)))
    for colour in ordered_colours(9)[:, :3]:
        assert (white + 0.05) / (luminance(colour) + 0.05) > 2.0
        assert (luminance(on_a_dark_page(colour)) + 0.05) / (dark + 0.05) > 4.0
