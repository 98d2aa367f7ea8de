"""Figures of a gap study: what stands beside the curves can be read."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from sma_bayes.report.figures.sheet import COLOURS
from sma_bayes.studies.gap.figures import disagreement, missing
from sma_bayes.studies.gap.outputs import Samples
from sma_bayes.studies.gap.schema import StatedDisagreement
from sma_bayes.studies.gap.terminal import _stretch


def test_numbers_of_stretches_in_one_place_do_not_touch() -> None:
    """Two stretches of heating of the same temperatures, told apart by their cycles, had one number on the other."""
    ax = Figure(figsize=(4.0, 3.0)).subplots()
    t = np.linspace(20.0, 80.0, 50)
    marked = []
    for i in range(4):
        stated = {
            "condition": "c", "branch": "heating", "channel": "force", "covariate": "cycle", "from": i, "to": i,
            "unit": "1", "size_sigma": 5.0, "mean_residual": 0.1,
        }  # fmt: skip
        measured = 1.0 + 0.01 * t + 0.002 * i
        inside = Samples({"condition": np.full(t.size, "c")}, {"temperature": t, "measured": measured})
        marked.append((str(i), StatedDisagreement.model_validate(stated), inside))
        ax.plot(t, inside["measured"])
    disagreement._number(ax, marked, np.empty((0, 2)))
    ax.figure.draw_without_rendering()
    boxes = [text.get_bbox_patch().get_window_extent() for text in ax.texts]
    assert len(boxes) == 4
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])


def test_the_number_of_a_stretch_covers_no_measured_point() -> None:
    """Under a stretch of heating, where it was put, were the points of cooling."""
    ax = Figure(figsize=(4.0, 3.0)).subplots()
    t = np.linspace(20.0, 80.0, 200)
    stated = {
        "condition": "c", "branch": "heating", "channel": "force", "covariate": "temperature", "from": 20, "to": 80,
        "unit": "degC", "size_sigma": 5.0, "mean_residual": 0.1,
    }  # fmt: skip
    heating, cooling = 1.0 + 0.01 * t, 0.9 + 0.01 * t
    ax.plot(t, heating)
    ax.plot(t, cooling)
    ax.set_ylim(0.5, 2.0)
    inside = Samples({"condition": np.full(t.size, "c")}, {"temperature": t, "measured": heating})
    points = np.column_stack([np.tile(t, 2), np.concatenate([heating, cooling])])
    disagreement._number(ax, [("1", StatedDisagreement.model_validate(stated), inside)], points)
    ax.figure.draw_without_rendering()
    box = ax.texts[0].get_bbox_patch().get_window_extent()
    assert box.count_contains(ax.transData.transform(points)) == 0


def test_the_number_of_a_stretch_lies_within_its_panel() -> None:
    """Under a flat end of a loop, where it was put, were the axis and its ticks."""
    ax = Figure(figsize=(4.0, 3.0)).subplots()
    t = np.linspace(20.0, 80.0, 200)
    ax.plot(t, np.tanh((t - 40.0) / 5.0))
    stated = _stated(branch="heating", ends=(20.0, 30.0))
    flat = t < 30.0
    inside = Samples(
        {"condition": np.full(flat.sum(), "c")},
        {"temperature": t[flat], "measured": np.full(flat.sum(), -1.0)},
    )
    disagreement._number(ax, [("1", stated, inside)], np.column_stack([t, np.tanh((t - 40.0) / 5.0)]))
    ax.figure.draw_without_rendering()
    box, frame = ax.texts[0].get_bbox_patch().get_window_extent(), ax.get_window_extent()
    assert frame.y0 < box.y0
    assert box.y1 < frame.y1


@pytest.mark.parametrize("branch", COLOURS)
def test_the_number_beside_residuals_covers_none_of_them(branch: str) -> None:
    """It stood at the rim of the panel, where the greatest residuals were drawn over it."""
    t = np.linspace(20.0, 80.0, 400)
    left = np.where(t < 50.0, 1.0, -1.0) * np.abs(np.sin(t))
    samples = Samples(
        {
            name: np.full(t.size, word)
            for name, word in {"condition": "c", "channel": "force", "branch": branch}.items()
        },
        {"temperature": t, "measured": left, "before": np.zeros(t.size)},
    )
    part = SimpleNamespace(
        disagreement=[_stated(branch=branch, ends=(20.0, 80.0))], units={"temperature": "degC"},
        channels={"force": SimpleNamespace(name="force", symbol="F", unit="N")},
    )  # fmt: skip
    ax = Figure(figsize=(3.5, 1.0)).subplots()
    disagreement._strip(ax, SimpleNamespace(samples=samples, part=part), "c", "force")
    ax.figure.draw_without_rendering()
    assert (
        ax.texts[0].get_window_extent().count_contains(ax.transData.transform(np.column_stack([t, left])))
        == 0
    )


def test_the_title_of_a_loop_names_its_channel_where_there_are_several() -> None:
    """Force and displacement of a condition had one title."""
    part = SimpleNamespace(channels={c: SimpleNamespace(name=c) for c in ("force", "displacement")})
    study = SimpleNamespace(part=part)
    name = "a-spring-of-the-second-batch-after-annealing"
    both = [(name, "force"), (name, "displacement")]
    titles = [disagreement._loop_title(study, both, *place, room=30) for place in both]
    assert [t.partition(": ")[2] for t in titles] == ["force", "displacement"]
    assert max(map(len, titles)) <= 30
    assert disagreement._loop_title(study, [("2A", "force")], "2A", "force", room=30) == "2A"


def _stated(branch: str, ends: tuple[float, float]) -> StatedDisagreement:
    return StatedDisagreement.model_validate({
        "condition": "c", "branch": branch, "channel": "force", "covariate": "temperature", "from": ends[0],
        "to": ends[1], "unit": "degC", "size_sigma": 5.0, "mean_residual": 0.1,
    })  # fmt: skip


def _luminance(colour: object) -> float:
    """Relative luminance of WCAG 2.1."""
    c = np.array(to_rgb(colour))
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize("side", disagreement.MARKS)
@pytest.mark.parametrize("branch", COLOURS)
def test_points_are_seen_on_the_stretch_they_are_in(side: str, branch: str) -> None:
    """Stretches were drawn translucent, sample over sample, and grew as dark as the points upon them."""
    stretch = disagreement.stretch_style(side)
    assert stretch.get("alpha", 1.0) == 1.0, "what is translucent darkens where samples are dense"
    ground, ink = _luminance(stretch["color"]), _luminance(COLOURS[branch])
    assert (ground + 0.05) / (ink + 0.05) >= 3.0


@pytest.mark.parametrize(
    ("ends", "unit", "told"),
    [
        ((1685.0, 18740.0), "s", "1685 to 18740 s"),
        ((1.0, 1.0), "1", "1"),
        ((85.09, 140.6), "degC", "85.1 to 141 °C"),
    ],
)
def test_a_stretch_is_told_without_powers_of_ten(ends: tuple[float, float], unit: str, told: str) -> None:
    stated = {
        "condition": "c", "branch": "heating", "channel": "force", "covariate": "cycle", "from": ends[0],
        "to": ends[1], "unit": unit, "size_sigma": 5.0, "mean_residual": 0.1,
    }  # fmt: skip
    assert _stretch(StatedDisagreement.model_validate(stated)) == told


@pytest.mark.parametrize("name", ["before", "after"])
def test_the_number_of_a_stretch_lies_on_no_curve_of_the_model(name: str) -> None:
    """Points of a steep curve lie far apart, and that with the effects was not looked at."""
    ax = Figure(figsize=(3.0, 3.0)).subplots()
    t = np.linspace(20.0, 80.0, 30)
    measured, curve = np.tanh((t - 50.0) / 3.0), np.tanh((t - 52.0) / 1.0) - 0.35
    ax.plot(t, curve, label=name)
    flat = t < 48.0
    inside = Samples(
        {"condition": np.full(flat.sum(), "c")}, {"temperature": t[flat], "measured": measured[flat]}
    )
    disagreement._number(
        ax, [("1", _stated(branch="heating", ends=(20.0, 48.0)), inside)], np.column_stack([t, measured])
    )
    ax.figure.draw_without_rendering()
    dense = np.linspace(20.0, 80.0, 4000)
    drawn = ax.transData.transform(np.column_stack([dense, np.interp(dense, t, curve)]))
    assert ax.texts[0].get_bbox_patch().get_window_extent().count_contains(drawn) == 0


def test_values_of_the_ladder_stand_beside_no_mark() -> None:
    """A value was written behind the mark of its guard, and read as that of the next bar."""
    ax = Figure(figsize=(4.0, 2.0)).subplots()
    bars = [("r_phase", 1178.0, 2429.0, "candidate"), ("run_offset", 509.0, 2429.0, "candidate")]
    ax.set_xlim(-1.0, 3000.0)
    missing._round(ax, bars, worth=3.0)
    ax.figure.draw_without_rendering()
    assert [text.get_text() for text in ax.texts] == ["1178", "509"]
    assert all(text.get_window_extent().x0 > ax.get_window_extent().x1 for text in ax.texts)


def test_an_effect_is_headed_by_what_it_is() -> None:
    """It was headed by its id; what is longer than the figure goes on below."""
    title = "load raises the transformation temperatures"
    assert missing._headed(title, 4.6) == ["Load raises the transformation temperatures"]
    assert missing._headed(title, 3.0) == ["Load raises the transformation", "temperatures"]


def test_a_map_tells_conditions_by_their_whole_names_where_there_is_room() -> None:
    long = "NiTiHf rod 3, as aged, 100 MPa, second day of the run"
    few = disagreement._row_labels([(long, 1), ("300 MPa", 1)], 1.1)
    assert [(name.replace("\n", " "), at) for name, at in few] == [(long, 0.5), ("300 MPa", 1.5)]
    many = disagreement._row_labels([(f"{n}: {long}", 1) for n in range(20)], 3.4)
    assert len({name for name, _ in many}) == 20
    assert all("\n" not in name for name, _ in many), "lines of neighbours would touch"
