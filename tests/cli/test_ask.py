"""`sma-bayes ask` as a pipeline calls it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

import sma_bayes
from sma_bayes.workflow import fit_campaign


@pytest.fixture(scope="module")
def folder(make_campaign: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("ask")
    campaign = sma_bayes.read_campaign(make_campaign(place / "bench"))
    fit_campaign(campaign, place / "out", noise="independent", jobs=1, figures=False)
    return place / "out"


def test_json_is_what_python_gives(run: Callable[..., object], folder: Path) -> None:
    outcome = run("ask", folder, "--stiffness", "0.12 N/mm", "--branch", "heating", "--json")
    assert (outcome.status, outcome.err) == (0, "")
    document = json.loads(outcome.out)
    assert document == sma_bayes.ask(folder, stiffness="0.12 N/mm", branch="heating")
    assert document["schema"] == "sma-bayes/ask/1"
    (answer,) = document["answers"]
    assert (answer["target"], answer["unit"]) == (0.12, "N/mm")


def test_people_get_a_few_lines(run: Callable[..., object], folder: Path) -> None:
    outcome = run("ask", folder, "--force", "1.5 N")
    assert outcome.status == 0
    assert "a-heating, measured from 30 to 70 °C" in outcome.out
    assert "rising at" in outcome.out
    assert max(map(len, outcome.out.splitlines())) < 120
    assert run("ask", folder, "--force", "1.5 N", "--quiet").out == ""


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
    (copy / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
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
