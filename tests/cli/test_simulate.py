"""`sma-bayes simulate` as a pipeline calls it."""

from __future__ import annotations

import csv
import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import sma_bayes
from sma_bayes.runs.documents import sealed

PROFILE = "time_s,current_A\n0,1.1\n20,0.7\n60,0\n90,0\n"


@pytest.fixture
def profile(tmp_path: Path) -> Path:
    path = tmp_path / "profile.csv"
    path.write_text(PROFILE, encoding="utf-8")
    return path


def test_json_is_what_python_gives(
    run: Callable[..., Any], heated_fit: Path, profile: Path, published: Callable[[str], Any]
) -> None:
    one = ("--condition", "1.2A", "--draws", "60")
    outcome = run("simulate", heated_fit, "--current", profile, "--reach", "force=3 N", *one, "--json")
    assert (outcome.status, outcome.err) == (0, "")
    document = json.loads(outcome.out)
    again = sma_bayes.simulate(heated_fit, profile, reach="force=3 N", condition="1.2A", draws=60)
    for key in ("balance", "runs", "reach", "profile", "cautions"):
        assert document[key] == json.loads(json.dumps(again[key]))
    published("simulate").validate(document)


def test_people_get_a_table_a_current_and_a_closing_sentence(
    run: Callable[..., Any], heated_fit: Path, profile: Path
) -> None:
    call = ("simulate", heated_fit, "--current", profile, "--condition", "1.2A", "--draws", "60")
    outcome = run(*call, "--reach", "displacement=20 mm")
    assert outcome.status == 0
    for words in (
        "heat balance with gain",
        "latent heat",
        "after 90 s of profile.csv",
        "1.2A",
        "meets it most surely",
    ):
        assert words in outcome.out
    assert "displacement [mm]" in outcome.out
    assert "stiffness [N/mm]" in outcome.out
    assert outcome.out.rstrip().splitlines()[-1].startswith(("Temperatures stay within", "Part of it"))
    assert run(*call, "--quiet").out == ""


def test_temperatures_are_told_as_they_were_declared(
    run: Callable[..., Any], heated_fit: Path, profile: Path, tmp_path: Path
) -> None:
    """Of a fit whose thermometer was declared in degF all that people read is in °F; the document is in °C."""
    fahrenheit = tmp_path / "fit"
    shutil.copytree(heated_fit, fahrenheit)
    path = fahrenheit / "summary.json"
    summary = json.loads(path.read_text(encoding="utf-8"))
    for record in summary["records"]:
        record["temperature"]["declared_unit"] = "degF"
    path.write_text(json.dumps(sealed(summary)), encoding="utf-8")
    out = tmp_path / "out"
    call = ("--current", profile, "--condition", "1.2A", "--start", "hot", "--draws", "60", "--out", out)
    outcome = run("simulate", fahrenheit, *call)
    assert outcome.status == 0, outcome.err
    document = json.loads((out / "simulate.json").read_text(encoding="utf-8"))
    (one,) = document["runs"]
    assert one["units"]["temperature"] == one["hottest"]["unit"] == "degC"
    assert document["declared_units"]["temperature"] == "degF"
    assert "hottest [°F]" in outcome.out
    gain = document["balance"]["parameters"]["gain"]
    assert gain["unit"] == "K/(s A^2)"
    with (out / "tables" / "balance.csv").open(encoding="utf-8") as file:
        shown = {r["parameter"]: r for r in csv.DictReader(file)}
    assert shown["gain"]["unit"].startswith("°F/(s")
    assert float(shown["gain"]["value_median [unit]"]) == pytest.approx(1.8 * gain["median"], rel=1e-8)
    with (out / "tables" / "end.csv").open(encoding="utf-8") as file:
        ends = {r["quantity"]: r for r in csv.DictReader(file)}
    for name, of in (("hottest temperature", one["hottest"]), ("temperature", one["end"]["temperature"])):
        assert ends[name]["unit"] == "°F"
        assert float(ends[name]["value_median [unit]"]) == pytest.approx(32.0 + 1.8 * of["median"], rel=1e-8)
    page = re.sub(r"(?s)<(style|script).*?</\1>", "", (out / "report.html").read_text(encoding="utf-8"))
    for text in (outcome.out, page):
        assert "°F" in text
        assert "°C" not in text


def test_a_folder_is_resumed_guarded_and_its_report_is_built_again(
    run: Callable[..., Any], heated_fit: Path, profile: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    call = (
        "simulate",
        heated_fit,
        "--current",
        profile,
        "--condition",
        "1.2A",
        "--draws",
        "60",
        "--out",
        out,
    )
    assert run(*call, "--no-figures").status == 0
    assert run(*call).status == 2
    assert run(*call, "--resume").status == 0
    assert run("report", out).status == 0
    assert (out / "report.html").is_file()
    band = out / "bands" / "1.2A-cold.csv"
    band.write_text(band.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    spoilt = run("report", out)
    assert spoilt.status == 2
    assert "bands/1.2A-cold.csv" in spoilt.err


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("time_s,current_A\n0,1\n5,\n9,0\n", ("row 3", "column 'current_A'", "no value")),
        ("time_s,current_A\n-3,1\n5,0\n", ("row 2", "column 'time_s'", "from 0 on")),
        ("time_s,current_A\n0,1\n5,1\n4,0\n", ("row 4", "rise from row to row")),
        ("time_s,drive\n0,1\n5,1\n", ("no current", "time_s,current_A")),
    ],
)
def test_a_profile_that_cannot_be_used_ends_with_2_and_leaves_nothing(
    run: Callable[..., Any], heated_fit: Path, tmp_path: Path, text: str, told: tuple[str, ...]
) -> None:
    path, out = tmp_path / "bad.csv", tmp_path / "out"
    path.write_text(text, encoding="utf-8")
    outcome = run("simulate", heated_fit, "--current", path, "--out", out)
    assert outcome.status == 2
    for words in ("bad.csv", *told):
        assert words in outcome.err
    assert not out.exists()


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ((), "neither a current nor a value"),
        (("--reach", "stiffness"), "--reach 'stiffness'"),
        (("--reach", "stiffness=500"), "no unit"),
        (("--reach", "stiffness=500 degC"), "stiffness"),
        (("--reach", "colour=3 N"), "one of force, displacement, stiffness"),
        (("--reach", "force=3 N", "--condition", "9A"), "unknown condition"),
        (("--reach", "force=3 N", "--start", "warm"), "cold, hot"),
        (("--reach", "force=3 N", "--rule", "preisach"), "proportional"),
        (("--reach", "force=3 N", "--pool", "some"), "unknown pool"),
        (("--reach", "force=3 N", "--ambient", "-400 degC"), "out of range"),
        (("--reach", "force=3 N", "--draws", "1"), "20 to 10,000"),
        (("--reach", "force=3 N", "--probability", "2"), "probability 2"),
    ],
)
def test_a_call_that_makes_no_sense_ends_with_2(
    run: Callable[..., Any], heated_fit: Path, options: tuple[str, ...], told: str
) -> None:
    outcome = run("simulate", heated_fit, *options)
    assert outcome.status == 2
    assert told in outcome.err


def test_a_campaign_without_current_ends_with_2(
    run: Callable[..., Any], make_campaign: Callable[..., Path], profile: Path, tmp_path: Path
) -> None:
    campaign = sma_bayes.read_campaign(make_campaign(tmp_path / "bench"))
    sma_bayes.fit_campaign(campaign, tmp_path / "fit", noise="independent", jobs=1, figures=False)
    outcome = run("simulate", tmp_path / "fit", "--current", profile)
    assert outcome.status == 2
    assert "no current was recorded" in outcome.err
    assert "`current` and `time`" in outcome.err


def test_a_profile_that_lasts_too_long_ends_with_2(
    run: Callable[..., Any], heated_fit: Path, tmp_path: Path
) -> None:
    path = tmp_path / "long.csv"
    path.write_text("time_s,current_A\n0,1\n1e6,0\n", encoding="utf-8")
    outcome = run("simulate", heated_fit, "--current", path)
    assert outcome.status == 2
    assert "time constants" in outcome.err
