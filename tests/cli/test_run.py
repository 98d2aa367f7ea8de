"""`sma-bayes run`: steps in folders of their own, the worst exit status, and going on with what is there."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from sma_bayes.errors import StudyError
from sma_bayes.studies.run.study_file import read_study

STUDY = """\
[study]
campaign = "bench"
out = "results"
jobs = 1
figures = "none"
noise = "independent"

[fit]

[[ask]]
stiffness = "0.12 N/mm"
"""


PLAN = '[plan]\nfor = "stiffness@50degC"\nrate = "2 K/min"\n'
AT = '[[ask]]\nat = ["50 degC", "323.15 kelvin"]\nunit = ["mN"]\n'


@pytest.fixture
def study(make_campaign: Callable[..., Path], tmp_path: Path) -> Path:
    make_campaign(tmp_path / "bench")
    return written(tmp_path / "study.toml", STUDY)


def written(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def document(folder: Path) -> Any:
    return json.loads((folder / "results" / "study.json").read_text(encoding="utf-8"))


def test_steps_are_run_resumed_and_added(
    run: Callable[..., Any], study: Path, published: Callable[[str], Any]
) -> None:
    folder = study.parent
    first = run("run", study, "--json")
    assert (first.status, first.err) == (0, "")
    found = json.loads(first.out)
    assert found == document(folder)
    assert (found["schema"], found["finished"], found["converged"]) == ("sma-bayes/study/1", True, True)
    assert [(s["step"], s["status"], s["summary"], s["schema"]) for s in found["steps"]] == [
        ("fit", "done", "fit/summary.json", "sma-bayes/fit/1"),
        ("ask 1", "done", "ask/1.json", "sma-bayes/ask/1"),
    ]
    for s in found["steps"]:
        assert (
            json.loads((folder / "results" / s["summary"]).read_text(encoding="utf-8"))["schema"]
            == s["schema"]
        )
    again = run("run", study)
    assert again.status == 2
    assert "--resume" in again.err
    # one condition can't be left out: this step fails, the others don't; a new question is answered
    written(study, STUDY + '[[ask]]\nforce = "1 N"\n' + AT + PLAN + '[compare]\npool = "campaign"\n')
    more = run("run", study, "--resume")
    assert more.status == 2
    found = document(folder)
    published("run").validate(found)
    assert found["exit_status"] == 2
    assert not found["converged"]
    assert {s["step"]: s["status"] for s in found["steps"]} == {
        "fit": "done", "compare": "failed", "plan": "done", "ask 1": "done", "ask 2": "done", "ask 3": "done"
    }  # fmt: skip
    told = json.loads((folder / "results" / "ask" / "3.json").read_text(encoding="utf-8"))
    assert told["schema"] == "sma-bayes/ask-at/1"
    assert told["answers"][0]["quantities"]["force"]["unit"] == "mN"
    planned = json.loads((folder / "results" / "plan" / "plan.json").read_text(encoding="utf-8"))
    assert (planned["asked"], planned["schema"]) == ("stiffness@50degC", "sma-bayes/plan/1")
    (failed,) = [s for s in found["steps"] if s["status"] == "failed"]
    assert "no two conditions" in failed["error"]
    assert "no two conditions" in more.out


@pytest.mark.parametrize(
    ("name", "key"), [("strain", "displacement"), ("stress", "force"), ("modulus", "stiffness")]
)
def test_a_specimen_is_asked_for_by_its_own_names(study: Path, name: str, key: str) -> None:
    (asked,) = read_study(written(study, STUDY.replace("stiffness =", f"{name} ="))).asks
    assert asked[key] == "0.12 N/mm"
    with pytest.raises(StudyError, match=f"unknown key '{name}'"):
        read_study(written(study, STUDY.replace("stiffness =", f'{key} = "1"\n{name} =')))


@pytest.mark.parametrize(("declared", "asked"), [("strict = true\n", ()), ("", ("--strict",))])
def test_a_strict_study_ends_with_1_where_the_fit_is_not_adequate(
    run: Callable[..., Any], study: Path, declared: str, asked: tuple[str, ...]
) -> None:
    text = STUDY.replace('noise = "independent"\n', 'noise = "effective_samples"\n' + declared)
    outcome = run("run", written(study, text), *asked)
    assert (outcome.status, outcome.err) == (1, "")
    found = document(study.parent)
    assert (found["converged"], found["exit_status"]) == (True, 1)
    assert [(s["step"], s["status"], s["exit_status"]) for s in found["steps"]] == [
        ("fit", "not adequate", 1),
        ("ask 1", "done", 0),
    ]
    assert "2 of 2 records converged, 0 adequate" in outcome.out
    lenient = run("run", written(study, text.replace(declared, "") if declared else text), "--resume")
    assert lenient.status == 0


def test_a_step_with_other_options_is_refused_and_what_was_told_is_kept(
    run: Callable[..., Any], study: Path
) -> None:
    assert run("run", study, "--quiet").status == 0
    before = document(study.parent)
    written(study, STUDY.replace("jobs = 1", "jobs = 1\nseed = 5"))
    outcome = run("run", study, "--resume")
    assert (outcome.status, outcome.out) == (2, "")
    assert "differs in seed" in outcome.err
    assert document(study.parent) == before


def test_where_the_fit_fails_questions_are_skipped(run: Callable[..., Any], study: Path) -> None:
    mark = written(
        study.parent / "empty.toml", STUDY.partition("[fit]")[0] + '[compare]\npool = "campaign"\n'
    )
    failed = run("run", mark, "--quiet")
    assert failed.status == 2  # its only step fails; the folder is that of a study now
    assert failed.err.startswith("error: ")
    machine = run("run", mark, "--resume", "--json")
    assert machine.status == 2
    assert json.loads(machine.out)["steps"][0]["status"] == "failed"
    assert "error: compare: " in machine.err  # a pipeline's log says why
    written(study.parent / "results" / "fit", "a file where a folder should be")
    written(study, STUDY + "[conditions]\n")
    outcome = run("run", study, "--resume")
    assert outcome.status == 2
    found = document(study.parent)
    assert [s["status"] for s in found["steps"]] == ["failed", "skipped", "skipped"]
    assert found["steps"][1]["error"] == "fit failed"


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('noise = "independent"', 'noise = "idependent"', "key 'fit.noise'"),
        ('noise = "independent"', 'priors = "papr"', "key 'fit.priors'"),
        ("[fit]", '[fit]\narrangement = "serial"', "did you mean 'series'"),
        ('"0.12 N/mm"', '"stiff"', "key 'ask 1.stiffness'"),
        ('"0.12 N/mm"', '"9**9**9**9 N"', "key 'ask 1.stiffness'"),
        ('"0.12 N/mm"', '"0.12 N"', "key 'ask 1.stiffness'"),
        ('stiffness = "0.12 N/mm"', 'force = "2 mm"', "key 'ask 1.force'"),
        ('stiffness = "0.12 N/mm"', 'at = ["50"]', "temperature '50' has no unit"),
        ('stiffness = "0.12 N/mm"', 'at = ["50 C"]', "did you mean 'degC'?"),
        ('stiffness = "0.12 N/mm"', 'at = ["50 N"]', "unit 'N' of temperature is of the wrong kind"),
        ('stiffness = "0.12 N/mm"', 'at = ["-300 degC"]', "temperature '-300 degC' is out of range"),
        ("[fit]", '[fit]\n[conditions]\nat = ["curent_A=2"]', "key 'conditions.at, entry 1'"),
        ("[fit]", '[fit]\n[plan]\nfor = "stiffnes@60degC"', "did you mean 'stiffness'"),
        ("[fit]", '[fit]\n[plan]\nfor = "parameters"\nsetup = "5 N"', "key 'plan.setup'"),
        ("[fit]", '[fit]\n[plan]\nfor = "parameters"\nrate = "9**9**9**9 K/min"', "key 'plan.rate'"),
        ("[fit]", '[fit]\n[plan]\nfor = "parameters"\ncondition = "b"', "key 'plan.condition'"),
        ("[fit]", '[fit]\n[plan]\nfor = "parameters"\ncandidates = "nowhere.toml"', "nowhere.toml"),
        ("[fit]", '[fit]\n[conditions]\nleave_out = ["b"]', "key 'conditions.leave_out, entry 1'"),
        ("[fit]", "[fit]\nextrapolate = 1e300", "key 'fit.extrapolate'"),
        ('"0.12 N/mm"', '"0.12 N/mm"\ncondition = "b"', "key 'ask 1.condition'"),
        ('"0.12 N/mm"', '"0.12 N/mm"\ntemperature_unit = "N"', "key 'ask 1.temperature_unit'"),
        ('"0.12 N/mm"', '"0.12 N/mm"\nextrapolate = 1e300', "key 'ask 1.extrapolate'"),
        ("[fit]", '[fit]\n[simulate]\ncurrent = "no.csv"', "no.csv"),
        ("[fit]", '[fit]\n[simulate]\nreach = "force=1 N"\nstart = ["warm"]', "key 'simulate.start'"),
        ("[fit]", '[fit]\n[simulate]\nreach = "force=1 N"\ncondition = "b"', "key 'simulate.condition'"),
        ("[fit]", '[fit]\n[watch]\nfiles = ["bench/a.csv", "no.csv"]', "key 'watch.files, entry 2'"),
        (
            "[fit]",
            '[fit]\n[watch]\nfiles = ["bench/a.csv"]\nlimit = ["strok=-20%"]',
            "key 'watch.limit, entry 1'",
        ),
        ("[fit]", '[fit]\n[modulus]\nfiles = ["no.csv"]', "key 'modulus.files, entry 1'"),
        ("[fit]", '[fit]\n[card]\narea = "2 mm"', "key 'card'"),
        ("[fit]", '[fit]\n[card]\nmodulus_austenite = "70"', "key 'card.modulus_austenite'"),
        ("[fit]", '[fit]\n[cycles]\nmodel = "sigmiod"', "key 'cycles.model'"),
        ("[fit]", '[fit]\n[sensitivity]\nat = ["50"]', "key 'sensitivity.at, entry 1'"),
        ('campaign = "bench"', 'campaign = "bunch"', "there is no such file or folder"),
        ("jobs = 1", "job = 1", "did you mean 'jobs'"),
    ],
)
def test_what_is_wrong_is_told_before_anything_is_written(
    run: Callable[..., Any], study: Path, old: str, new: str, told: str
) -> None:
    assert old in STUDY
    written(study, STUDY.replace(old, new))
    outcome = run("run", study)
    assert (outcome.status, outcome.out) == (2, "")
    assert told in outcome.err
    assert not (study.parent / "results").exists()


def test_another_folder_can_be_named(run: Callable[..., Any], study: Path, tmp_path: Path) -> None:
    written(study, STUDY.partition("[[ask]]")[0])
    assert run("run", study, "--out", tmp_path / "else" / "where", "--quiet").status == 0
    assert (tmp_path / "else" / "where" / "fit" / "summary.json").is_file()
    assert not (tmp_path / "results").exists()


SPRING = """\
[study]
campaign = "bench"
out = "results"
jobs = 1
figures = "none"
noise = "independent"
[fit]
[sensitivity]
at = ["60 degC"]
[cycles]
ahead = 2
[watch]
files = ["quiet/1.csv"]
limit = ["stroke=-20%"]
[card]
draws = 50
"""


@pytest.fixture(scope="module")
def spring(tmp_path_factory: pytest.TempPathFactory, watched_spring: ModuleType) -> Path:
    """A campaign of four cycles, one that is quiet and six whose displacement drifts."""
    folder, rng, rig = (
        tmp_path_factory.mktemp("spring"),
        np.random.default_rng(0),
        replace(watched_spring.PLAIN, channels=("force", "displacement")),
    )
    rig.campaign(folder / "bench", rng, 4)
    watched_spring.write(folder / "quiet" / "1.csv", [rig.cycle(rng)])
    watched_spring.write(
        folder / "faulty" / "1.csv", [watched_spring.offset_drift(n, rig.cycle(rng)) for n in range(1, 7)]
    )
    return folder


def test_what_starts_from_a_fit_is_declared_beside_it(run: Callable[..., Any], spring: Path) -> None:
    """Each step leaves what its verb leaves; one without current fails, and an alarm is the exit status."""
    study = written(spring / "study.toml", SPRING)
    first = run("run", study)
    found = document(spring)
    assert first.status == 0, first.out
    assert {s["step"]: (s["status"], s["summary"]) for s in found["steps"]} == {
        "fit": ("done", "fit/summary.json"),
        "sensitivity": ("done", "sensitivity/sensitivity.json"),
        "cycles": ("done", "cycles/cycles.json"),
        "watch": ("done", "watch/watch.json"),
        "card": ("done", "card/card.json"),
    }
    alone = run("sensitivity", spring / "results" / "fit", "--at", "60 degC", "--json", "--quiet")
    together = json.loads(
        (spring / "results" / "sensitivity" / "sensitivity.json").read_text(encoding="utf-8")
    )
    assert json.loads(alone.out)["records"] == together["records"]
    more = '[simulate]\nreach = "displacement=5 mm"\n'
    written(study, SPRING.replace('"quiet/1.csv"', '"quiet/1.csv", "faulty/1.csv"') + more)
    later = run("run", study, "--resume")
    assert later.status == 2
    found = document(spring)
    status = {s["step"]: (s["status"], s["exit_status"]) for s in found["steps"]}
    assert status["watch"] == ("alarm", 1)
    assert status["simulate"] == ("failed", 2)
    assert "no current was recorded" in later.out
    assert not found["converged"]
