"""A simulation from a fit, against a wire that scipy integrates, driven by currents that were never measured."""

from __future__ import annotations

import csv
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import sma_bayes
from sma_bayes.runs.documents import SIMULATION
from sma_bayes.runs.finished_run import read_finished
from sma_bayes.studies.simulate.figures.course import _limit, course_figure
from sma_bayes.studies.simulate.schema import SimulationDocument
from sma_bayes.studies.simulate.terminal import with_starts

EDGES = [0.0, 12.0, 24.0, 33.0, 60.0, 75.0, 110.0, 150.0]
CURRENTS = [1.1, 0.6, 1.0, 0.66, 0.76, 0.68, 0.0]
"""Three turns within the transformation."""
PROFILE = {"time_s": EDGES, "current_A": [*CURRENTS, 0.0]}
UNITS = {"temperature": "degC", "force": "N", "displacement": "m", "stiffness": "N/m"}


@pytest.fixture(scope="module")
def folder(heated_fit: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("simulated") / "out"
    sma_bayes.simulate(heated_fit, PROFILE, out, condition="1.2A", reach="displacement=20 mm", figures=False)
    return out


@pytest.fixture(scope="module")
def found(folder: Path) -> Any:
    return SIMULATION.read(folder)


def bands(folder: Path, start: str) -> dict[str, Any]:
    with (folder / "bands" / f"1.2A-{start}.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(r[name]) for r in rows]) for name in rows[0]}


@pytest.mark.parametrize("start", ["cold", "hot"])
def test_bands_hold_the_truth_under_a_current_that_was_not_measured(
    folder: Path, heated_wire: Any, start: str
) -> None:
    """90 % bands; of another run they are the wider ones, and hold it nearly all along."""
    found = bands(folder, start)
    temperature, share = heated_wire.course(EDGES, CURRENTS, found["time_s"], heating=start == "cold")
    truth = {
        "temperature": temperature,
        "force": heated_wire.force(share),
        "displacement": heated_wire.displacement(share),
    }
    for channel, values in truth.items():
        low, middle, high = (found[f"{channel}_{q} [{UNITS[channel]}]"] for q in ("q05", "q50", "q95"))
        least, most = (found[f"{channel}_{q} [{UNITS[channel]}]"] for q in ("pred_q05", "pred_q95"))
        assert np.max(np.abs(middle - values)) < 0.01 * np.ptp(values), channel
        assert np.mean((values > least) & (values < most)) > 0.9, channel
        assert np.all(most - least > high - low), channel
    inside = (share > 0.1) & (share < 0.9)
    slope = (
        5.0 - 2.0 * share[inside]
    ) / 0.02  # no curve of the fit is that of this force, so its bands are narrow
    assert np.max(np.abs(found["stiffness_q50 [N/m]"][inside] / slope - 1.0)) < 0.1


def test_the_heat_balance_is_that_of_the_wire(found: Any, heated_wire: Any) -> None:
    """Each 90 % interval widened to 99.9 %: a false alarm in 250 such tests."""
    parameters = found["balance"]["parameters"]
    truth = {
        "gain": heated_wire.gain, "loss": heated_wire.loss, "ambient": heated_wire.room,
        "latent_heat.L": 500.0 * heated_wire.latent,
    }  # fmt: skip
    assert found["balance"]["effects"] == ["latent_heat"]
    for name, value in truth.items():
        p = parameters[name]
        assert abs(value - p["median"]) < (p["q95"] - p["q05"]), name


def test_turns_inside_the_loop_are_counted_and_the_other_rule_is_told(found: Any) -> None:
    """It cools four times and is heated twice again; the hot start turns once more, at the room."""
    assert [(r["start"], r["turns"]) for r in found["runs"]] == [("cold", 5.0), ("hot", 6.0)]
    for r in found["runs"]:
        assert r["inside"] >= 2.0
        assert r["other_rule"]["rule"] == "play"
        assert r["other_rule"]["difference"]["force"] > 0.05
    assert any("'play'" in c for c in found["cautions"])


def test_a_path_after_a_complete_transformation_is_that_of_the_fit(heated_fit: Path, tmp_path: Path) -> None:
    """Heated all the way in one go, force, displacement and stiffness are what `ask` tells of the heating branch."""
    profile = {"time_s": [0.0, 60.0], "current_A": [1.15, 1.15]}
    sma_bayes.simulate(
        heated_fit, profile, tmp_path / "out", condition="1.2A", start="cold", figures=False, draws=2000
    )
    band = bands(tmp_path / "out", "cold")
    for i in (40, 60, 80):
        temperature = band["temperature_q50 [degC]"][i]
        (answer,) = sma_bayes.ask(heated_fit, at=f"{temperature} degC", condition="1.2A", branch="heating")[
            "answers"
        ]
        for channel, told in answer["quantities"].items():
            slack = 0.5 * (told["high"][0] - told["low"][0])
            assert abs(band[f"{channel}_q50 [{UNITS[channel]}]"][i] - told["median"][0]) < slack


def test_the_steady_current_of_a_displacement_is_that_of_the_balance(found: Any, heated_wire: Any) -> None:
    """At 20 mm half is austenite: gain I^2 = loss (62 - 22)."""
    truth = np.sqrt(heated_wire.loss * (heated_wire.middle[0] - heated_wire.room) / heated_wire.gain)
    (one,) = found["reach"]["conditions"]
    (passage,) = one["passages"]
    assert passage["median"] == pytest.approx(truth, rel=2e-3)
    assert one["reachable"] == 1.0
    assert one["best"]["probability"] > 0.9
    low, high = one["intervals"][0]["low"], one["intervals"][0]["high"]
    assert low < one["best"]["current"] < high


def test_a_current_held_long_enough_ends_where_reach_says(heated_fit: Path, found: Any) -> None:
    (one,) = found["reach"]["conditions"]
    held = one["passages"][0]["median"]
    profile = {"time_s": [0.0, 400.0], "current_A": [held, held]}
    end = sma_bayes.simulate(heated_fit, profile, condition="1.2A", start="cold")["runs"][0]["end"][
        "displacement"
    ]
    assert end["median"] == pytest.approx(0.02, abs=1e-4)
    assert end["q05"] < 0.02 < end["q95"]


def test_starts_that_end_alike_are_told_once(found: Any) -> None:
    cold, other = SimulationDocument.model_validate(found).runs
    assert [start for _, start in with_starts([cold, cold.but(start="hot")])] == ["cold or hot"]
    force = other.end["force"]
    apart = other.but(end={**other.end, "force": force.but(median=1.1 * (force.median or 0.0) + 1.0)})
    assert [start for _, start in with_starts([cold, apart])] == ["cold", "hot"]


def test_what_no_current_within_the_measured_temperatures_gives_is_told(heated_fit: Path) -> None:
    (one,) = sma_bayes.simulate(heated_fit, reach="force=9 N", condition="1.2A")["reach"]["conditions"]
    assert (one["reachable"], one["passages"], one["best"]) == (0.0, [], None)


def test_a_start_between_the_branches_is_where_it_is_said_to_be(heated_fit: Path, heated_wire: Any) -> None:
    """At 56 °C most is martensite on heating and austenite on cooling; the room cools it at once."""
    profile = {"time_s": [0.0, 0.1], "current_A": [0.0, 0.0]}
    found = sma_bayes.simulate(
        heated_fit, profile, condition="1.2A", start=["heating:56 degC", "cooling:132.8 degF"]
    )
    forces = {r["start"]: r["end"]["force"]["median"] for r in found["runs"]}
    for name, heating in (("heating", True), ("cooling", False)):
        assert forces[name] == pytest.approx(heated_wire.force(heated_wire.share(56.0, heating)), abs=0.1)


def test_beyond_what_was_measured_is_said(heated_fit: Path) -> None:
    profile = {"time_s": [0.0, 60.0], "current_A": [1.4, 1.4]}
    found = sma_bayes.simulate(heated_fit, profile, condition="1.0A", start="cold")
    (run,) = found["runs"]
    assert run["extrapolated"] == 1.0
    assert 5.0 < run["extrapolated_from"] < 30.0
    assert any("extrapolated" in c for c in found["cautions"])
    assert any("1.2 A is the greatest" in c for c in found["cautions"])


def test_a_seed_decides_every_number(heated_fit: Path) -> None:
    profile = {"time_s": [0.0, 20.0], "current_A": [1.1, 1.1]}
    one, two, other = (
        sma_bayes.simulate(heated_fit, profile, condition="1.2A", start="cold", seed=seed)["runs"]
        for seed in (1, 1, 2)
    )
    assert one == two
    assert one != other


def test_a_room_that_is_given_shifts_the_end(heated_fit: Path) -> None:
    profile = {"time_s": [0.0, 100.0], "current_A": [0.0, 0.0]}
    given = sma_bayes.simulate(heated_fit, profile, condition="1.2A", start="cold", ambient="30 degC")
    column = sma_bayes.simulate(
        heated_fit, {**profile, "ambient_temperature_C": [30.0, 30.0]}, condition="1.2A", start="cold"
    )
    for found in (given, column):
        assert found["runs"][0]["end"]["temperature"]["median"] == pytest.approx(30.0)
    assert given["profile"]["ambient"] == "30 °C, as given"
    assert column["profile"]["ambient"] == "a column of the profile"


def test_every_branch_of_the_report_can_be_built(heated_fit: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    profile = {"time_s": [0.0, 20.0, 40.0], "current_A": [1.1, 0.0, 0.0]}
    sma_bayes.simulate(heated_fit, profile, out, reach="stiffness=150 N/m", draws=50)
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "Steady currents" in page
    assert "<p>Steady current for stiffness=150 N/m, tolerance 5 %, heated from cold.</p>" in page.replace(
        "\u00a0", " "
    )
    assert page.count("meets it most surely, with probability") == 2
    with (out / "tables" / "reach.csv").open(encoding="utf-8") as file:
        assert {"best_current [A]", "best_probability [1]"} <= set(next(csv.reader(file)))
    for name in (
        "figures/course-1.0A.png",
        "figures/course-1.2A.csv",
        "tables/end.csv",
        "tables/balance.tex",
    ):
        assert (out / name).is_file()


def test_starts_that_make_no_difference_are_one_line(heated_fit: Path, tmp_path: Path) -> None:
    """Drawn over each other cold and hot start had a colour of which the legend did not tell."""
    profile = {"time_s": [0.0, 20.0, 40.0], "current_A": [1.1, 0.0, 0.0]}
    sma_bayes.simulate(heated_fit, profile, tmp_path / "out", condition="1.0A", draws=100)
    drawn, rows = {}, {}
    for name, folder in (("room", tmp_path / "out"), ("loop", tmp_path / "loop")):
        if name == "loop":
            starts = ["heating:54 degC", "cooling:54 degC"]
            sma_bayes.simulate(heated_fit, profile, folder, condition="1.0A", start=starts, draws=100)
        stored = read_finished(SIMULATION, SimulationDocument, folder)
        (legend,) = course_figure(stored, "1.0A").figure.legends
        drawn[name] = [text.get_text() for text in legend.get_texts()][:-2]
        rows[name] = len(list(with_starts(stored.found.runs)))
    assert drawn["room"] == ["cold or hot start, median"]
    assert drawn["loop"] == ["heating at 54 °C start, median", "cooling at 54 °C start, median"]
    assert rows == {"room": 1, "loop": 2}, "starts differ by their course, not by chance"


def test_the_axis_of_a_positive_stiffness_begins_at_nought(folder: Path) -> None:
    """It began at −0.5 N/mm, since the band has no end at one instant of the start."""
    stored = read_finished(SIMULATION, SimulationDocument, folder)
    axes = course_figure(stored, "1.2A").figure.axes
    edges = np.concatenate([bands(folder, s)["stiffness_pred_q05 [N/m]"] for s in ("cold", "hot")])
    assert 0.0 < np.mean(edges < 0.0) < 0.02
    assert axes[-1].get_ylabel() == "K [N/mm]"
    assert axes[-1].get_ylim()[0] == 0.0


def test_the_axis_of_a_stiffness_is_kept_to_where_it_is_told() -> None:
    """A stiffness near 110 N/m for most of the time, and between -3000 and 4000 N/m where nothing transforms."""
    at = np.arange(100)
    unknown = at >= 70
    band = {
        "stiffness_q50 [N/m]": np.where(unknown, 420.0 - 10.0 * at, 110.0 + np.sin(at)),
        "stiffness_pred_q05 [N/m]": np.where(unknown, -3000.0, 90.0),
        "stiffness_pred_q95 [N/m]": np.where(unknown, 4000.0, 135.0),
    }
    run: Any = SimpleNamespace(units={"stiffness": "N/m"}, declared_units={})
    ax = Figure().subplots()
    _limit(ax, [(band, run)], "stiffness")
    low, high = ax.get_ylim()
    assert 0.0 <= low < 90.0
    assert 135.0 < high < 300.0
