"""`sma-bayes ask` as a pipeline calls it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sma_bayes
from sma_bayes import fit_campaign
from sma_bayes.runs.documents import sealed
from sma_bayes.studies.ask.terminal import answer_text


@pytest.fixture(scope="module")
def folder(make_campaign: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("ask")
    campaign = sma_bayes.read_campaign(make_campaign(place / "bench"))
    fit_campaign(campaign, place / "out", noise="independent", jobs=1, figures=False)
    return place / "out"


def test_json_is_what_python_gives(
    run: Callable[..., object], folder: Path, published: Callable[[str], Any]
) -> None:
    outcome = run("ask", folder, "--stiffness", "0.12 N/mm", "--branch", "heating", "--json")
    assert (outcome.status, outcome.err) == (0, "")
    document = json.loads(outcome.out)
    assert document == sma_bayes.ask(folder, stiffness="0.12 N/mm", branch="heating")
    assert document["schema"] == "sma-bayes/ask/1"
    published("ask").validate(document)
    published("ask-at").validate(sma_bayes.ask(folder, at=["45 degC", "500 degC"]))
    (answer,) = document["answers"]
    assert (answer["target"], answer["unit"]) == (0.12, "N/mm")


def test_people_get_a_few_lines(run: Callable[..., object], folder: Path) -> None:
    outcome = run("ask", folder, "--force", "1.5 N")
    assert outcome.status == 0
    assert "a-heating, measured from 30 to 70 °C" in outcome.out
    assert "rising at" in outcome.out
    assert max(map(len, outcome.out.splitlines())) < 120
    assert run("ask", folder, "--force", "1.5 N", "--quiet").out == ""


def test_curves_that_wind_about_a_value_are_one_line(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    document = sma_bayes.ask(folder, force="1.5 N", branch="heating")
    (answer,) = document["answers"]
    (passage,) = answer["passages"]
    answer["passages"] = [
        {**passage, "low": 40.0 + i, "high": 42.0 + i, "direction": ("rising", "falling")[i % 2]}
        for i in range(6)
    ]
    told = answer_text(document)
    assert "up and down, 6 times a curve, between 40 and 47 °C: they wind about the value there" in told
    assert "rising at" not in told


def test_what_is_not_reached_is_an_answer(run: Callable[..., object], folder: Path) -> None:
    outcome = run("ask", folder, "--force", "40 N")
    assert outcome.status == 0
    assert "stays below with probability 1.000" in outcome.out


def test_a_fit_that_did_not_converge_ends_with_1(
    run: Callable[..., object], folder: Path, tmp_path: Path
) -> None:
    copy = tmp_path / "copy"
    copy.mkdir()
    for name in ("posterior", "bands"):
        (copy / name).symlink_to(folder / name)
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    summary["records"][0]["converged"] = False
    (copy / "summary.json").write_text(json.dumps(sealed(summary)), encoding="utf-8")
    outcome = run("ask", copy, "--force", "1.5 N")
    assert outcome.status == 1
    assert "NOT CONVERGED" in outcome.out
    assert run("ask", copy, "--force", "1.5 N", "--branch", "cooling").status == 0


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ((), "no value is asked for"),
        (("--stiffness", "130"), "has no unit"),
        (("--stiffness", "130 kg"), "wrong kind"),
        (("--stiffness", "130 N/m", "--condition", "b"), "known: 'a'"),
        (("--modulus", "3 GPa"), "wrong kind"),
        (("--overall-stiffness", "130 N/m"), "--arrangement"),
    ],
)
def test_what_is_wrong_is_told_in_one_message(
    run: Callable[..., object], folder: Path, arguments: tuple[str, ...], told: str
) -> None:
    outcome = run("ask", folder, *arguments)
    assert (outcome.status, outcome.out) == (2, "")
    assert told in outcome.err
    assert "Traceback" not in outcome.err


AT = ("--at", "50 degC", "--at", "62 degC")


def test_what_temperatures_give_is_what_the_bands_say(run: Callable[..., object], folder: Path) -> None:
    outcome = run("ask", folder, *AT, "--json")
    assert (outcome.status, outcome.err) == (0, "")
    found = json.loads(outcome.out)
    assert found["schema"] == "sma-bayes/ask-at/1"
    assert found == sma_bayes.ask(folder, at=["50 degC", "62 degC"])
    assert [a["key"] for a in found["answers"]] == ["a-heating", "a-cooling"]
    for answer in found["answers"]:
        assert set(answer["quantities"]) == {"force", "displacement", "stiffness"}
        for channel, told in answer["quantities"].items():
            band = np.genfromtxt(
                folder / "bands" / f"{answer['key']}-{channel}.csv", delimiter=",", names=True
            )
            for ours, theirs in (("low", "q05"), ("median", "q50"), ("high", "q95")):
                there = np.interp(answer["temperature"], band["temperature_degC"], band[theirs])
                assert told[ours] == pytest.approx(there, rel=2e-3)
            if channel == "stiffness":
                assert told["pred_low"] == [None, None], "its noise is not known"
                continue
            # quantiles of 2,000 draws each: of the width of the interval 1.7 standard errors are some 5 %
            for ours, theirs in (("pred_low", "pred_q05"), ("pred_high", "pred_q95")):
                there = np.interp(answer["temperature"], band["temperature_degC"], band[theirs])
                width = np.interp(
                    answer["temperature"], band["temperature_degC"], band["pred_q95"] - band["pred_q05"]
                )
                assert np.all(np.abs(np.array(told[ours]) - there) < 0.15 * width)


def test_answers_come_in_the_unit_of_the_question(folder: Path) -> None:
    kelvin = sma_bayes.ask(folder, at="323.15 kelvin", unit=["mN", "mm"], condition="a", branch="heating")
    plain = sma_bayes.ask(folder, at="50 degC", condition="a", branch="heating")
    (k,), (p,) = kelvin["answers"], plain["answers"]
    assert (k["temperature_unit"], k["temperature"]) == ("kelvin", [323.15])
    assert k["measured"] == pytest.approx([303.15, 343.15])
    assert (k["quantities"]["force"]["unit"], k["quantities"]["displacement"]["unit"]) == ("mN", "mm")
    assert k["quantities"]["stiffness"]["unit"] == "N/m"
    for name, scale in (("force", 1e3), ("displacement", 1e3), ("stiffness", 1.0)):
        assert k["quantities"][name]["median"][0] == pytest.approx(scale * p["quantities"][name]["median"][0])


def test_an_error_of_the_setting_widens_what_is_got(folder: Path) -> None:
    sure = sma_bayes.ask(folder, at="50 degC", branch="heating")["answers"][0]["quantities"]["force"]
    rough = sma_bayes.ask(folder, at="122 degF", branch="heating", temperature_sd=1.8)["answers"][0][
        "quantities"
    ]["force"]
    slope = 2.5 * 0.35 * np.exp(0.7) / (1.0 + np.exp(0.7)) ** 2  # of the curve that the data were drawn from
    spread = (rough["high"][0] - rough["low"][0]) / (2 * 1.645)
    assert spread == pytest.approx(slope, rel=0.15), "1.8 degF are 1 degC"
    assert sure["high"][0] - sure["low"][0] < 0.2 * (rough["high"][0] - rough["low"][0])


def test_beyond_what_was_measured_nothing_is_told_unless_asked(
    run: Callable[..., object], folder: Path
) -> None:
    outcome = run("ask", folder, "--at", "72 degC", "--at", "50 degC")
    assert "72 *" in outcome.out
    assert "--extrapolate" in outcome.out
    (answer, _) = sma_bayes.ask(folder, at=["72 degC", "50 degC"])["answers"]
    assert answer["extrapolated"] == [True, False]
    assert answer["quantities"]["force"]["median"][0] is None
    told = sma_bayes.ask(folder, at="72 degC", extrapolate=3.0)["answers"][0]
    assert told["quantities"]["force"]["median"][0] == pytest.approx(3.0, abs=0.1)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("--at", "60"), "has no unit"),
        (("--at", "60 degC, 80 degC"), "is more than one"),
        (("--at", "60 N"), "wrong kind"),
        (("--at", "hot"), "a number with its unit"),
        ((*AT, "--force", "1 N"), "error: force and temperatures are asked for at once"),
        ((*AT, "--unit", "Pa"), "is of no quantity of the fit"),
        (("--force", "1 N", "--unit", "mN"), "without --at"),
    ],
)
def test_what_is_wrong_about_temperatures(
    run: Callable[..., object], folder: Path, arguments: tuple[str, ...], told: str
) -> None:
    outcome = run("ask", folder, *arguments)
    assert (outcome.status, outcome.out) == (2, "")
    assert told in outcome.err
