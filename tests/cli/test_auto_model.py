"""`--model auto` through every verb: one model for all records where a verb needs one, and the reason with it."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

PLAIN, SLOPED = "modified_sigmoid", "phase_slopes"
CAMPAIGN = """\
[campaign]
name = "sloped phases"
[columns]
time = { name = "time_s", unit = "s" }
temperature = { name = "temperature_C", unit = "degC" }
displacement = { name = "displacement_mm", unit = "mm" }
"""
STUDY = """\
[study]
campaign = "bench"
out = "results"
jobs = 1
figures = "report"
model = "auto"
noise = "independent"
[fit]
[conditions]
[compare]
"""


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three loads: two phases with slopes that any record shows, and one without."""
    folder = tmp_path_factory.mktemp("auto")
    (folder / "bench").mkdir()
    text = CAMPAIGN
    for i, slope in enumerate((3.0, 3.0, 0.0)):
        rng = np.random.default_rng(i)
        t = np.linspace(25.0, 75.0, 80)
        x = 1.0 + 20.0 / (1.0 + np.exp(-0.35 * (t - 48.0 - i))) + slope * (t - 50.0) / 50.0
        x += 0.1 * rng.standard_normal(t.size)
        rows = "\n".join(f"{j},{a:.6g},{b:.6g}" for j, (a, b) in enumerate(zip(t, x, strict=True)))
        (folder / "bench" / f"{i}.csv").write_text(f"time_s,temperature_C,displacement_mm\n{rows}\n", "utf-8")
        text += f'[[condition]]\nid = "{i + 1}N"\nfile = "{i}.csv"\nload_N = {i + 1}\n'
    (folder / "bench" / "campaign.toml").write_text(text, "utf-8")
    (folder / "study.toml").write_text(STUDY, "utf-8")
    return folder


def test_the_curves_that_are_tried_are_told(run: Callable[..., Any], bench: Path) -> None:
    """Before anything is fitted how many there are, and while they are which, with what the others will take."""
    plain = ("--noise", "independent", "--jobs", "1", "--figures", "none", "-v")
    outcome = run("fit", bench / "bench", "--model", "auto", "--out", bench / "told", *plain)
    assert outcome.status == 0
    found = re.findall(r"fitting curve (\d) of (\d), (\w+), with its noise(, some \d+ s for)?", outcome.err)
    count = int(found[0][1])
    assert [int(n) for n, *_ in found] == 3 * list(range(1, count + 1))
    assert {name for *_, name, _ in found} >= {PLAIN, SLOPED}
    assert all(bool(rest) == (n != "1") for n, _, _, rest in found)
    assert outcome.err.count(f"comparing {count} curves by evidence and held-out samples") == 3
    first = f"choosing among {count} curves a record, and sampling"
    assert outcome.err.index(first) < outcome.err.index("fitting curve 1")


@pytest.fixture(scope="module")
def results(bench: Path) -> Path:
    from sma_bayes import run_study

    assert run_study(bench / "study.toml")["exit_status"] == 0
    return bench / "results"


def read(path: Path) -> Any:
    return json.loads(path.read_text("utf-8"))


def test_a_fit_chooses_for_each_record(results: Path) -> None:
    found = read(results / "fit" / "summary.json")["records"]
    assert [r["model"] for r in found] == [SLOPED, SLOPED, PLAIN]


def test_conditions_take_one_model_and_fit_again_what_has_another(results: Path) -> None:
    found = read(results / "conditions" / "conditions.json")
    assert found["model_choice"]["name"] == SLOPED
    assert "of all 3 together" in found["model_choice"]["reason"]
    assert found["refitted"] == ["3N-heating"]
    assert [list(p["parameters"]) for p in found["populations"]] == [["1N", "2N", "3N"]]
    assert found["options"]["model"] == "auto"
    page = (results / "conditions" / "report.html").read_text("utf-8")
    assert "Fitted again with it: 3N-heating" in page
    assert "--model auto" in page


def test_without_it_conditions_of_different_models_are_not_joined(
    run: Callable[..., Any], results: Path, tmp_path: Path
) -> None:
    found = run("conditions", results / "fit", "--out", tmp_path / "out", "--no-figures", "--json")
    document = json.loads(found.out)
    assert [list(p["parameters"]) for p in document["populations"]] == [["1N", "2N"]]
    assert any("3N-heating (modified_sigmoid" in r for r in document["remarks"])
    assert document["model_choice"] is None
    named = run("conditions", results / "fit", "--out", tmp_path / "no", "--model", SLOPED)
    assert named.status == 2
    assert f"a fit of the model '{SLOPED}'" in named.err
    assert "--model auto" in named.err
    assert not (tmp_path / "no").exists()


def test_what_is_fitted_again_is_what_fit_gives(results: Path, bench: Path, tmp_path: Path) -> None:
    """The refitted record has, to the bit, the features that a fit with that model named would give."""
    from sma_bayes import fit_campaign, read_campaign, study_conditions

    campaign = read_campaign(bench / "bench")
    fit_campaign(campaign, tmp_path / "fit", model=SLOPED, noise="independent", jobs=1, figures="none")
    named = study_conditions(tmp_path / "fit", jobs=1)
    chosen = read(results / "conditions" / "conditions.json")
    assert named["features"] == chosen["features"]


def test_compare_lets_the_chosen_rung_take_part(results: Path) -> None:
    found = read(results / "comparison" / "comparison.json")
    assert found["options"]["model"] == "auto"
    assert found["model_choice"]["name"] == SLOPED
    assert set(found["model_choice"]["ln_evidence"]) >= {PLAIN, SLOPED}
    for record in found["records"]:
        assert SLOPED in record["models"]
        assert "two_stage" not in record["models"]
    assert [r["preferred"] for r in found["records"]][:2] == [SLOPED, SLOPED]
    assert "--model auto" in (results / "comparison" / "report.html").read_text("utf-8")


def test_gap_starts_from_the_chosen_rung(run: Callable[..., Any], bench: Path, tmp_path: Path) -> None:
    out = tmp_path / "gap"
    found = run("gap", bench / "bench", "--out", out, "--model", "auto", "--jobs", 1, "--no-figures")
    assert found.status == 0, found.err
    document = read(out / "gap.json")
    assert document["model"] == document["model_choice"]["name"] == SLOPED
    assert document["verdict"] == "none"
    assert "of all 3 together" in " ".join(found.out.split())


@pytest.mark.parametrize(
    ("verb", "arguments", "said"),
    [
        ("fit", ("--noise", "effective_samples"), "--model auto with --noise effective_samples"),
        ("compare", ("--noise", "effective_samples"), "--model auto with --noise effective_samples"),
        ("gap", ("--noise", "ar1"), "a gap study estimates AR(1) noise"),
    ],
)
def test_what_gives_no_evidence_is_refused(
    run: Callable[..., Any], bench: Path, tmp_path: Path, verb: str, arguments: tuple[str, ...], said: str
) -> None:
    found = run(verb, bench / "bench", "--out", tmp_path / "out", "--model", "auto", *arguments)
    assert found.status == 2
    assert said in found.err
    assert not (tmp_path / "out").exists()


def test_priors_of_a_richer_rung_are_taken_where_it_has_the_parameter(
    run: Callable[..., Any], bench: Path, tmp_path: Path
) -> None:
    """They speak of parameters that lower rungs have not; a name that no rung has is still refused."""
    head = 'schema = "sma-bayes/priors/1"\nextends = "phase_slopes"\nmodel = "phase_slopes"\ntitle = "own"\n'
    own = '[both.{}]\nfamily = "normal"\nmean = 0.0\nsd = 0.1\nrelative_to = "span(displacement)/span(temperature)"\n'
    (tmp_path / "good.toml").write_text(head + own.format("A_cold_slope"), "utf-8")
    (tmp_path / "bad.toml").write_text(head + own.format("A_cold_slop"), "utf-8")
    call = ("fit", bench / "bench", "--model", "auto", "--noise", "independent", "--jobs", 1, "--no-figures")
    good = run(*call, "--priors", tmp_path / "good.toml", "--out", tmp_path / "out")
    assert good.status == 0, good.err
    bad = run(*call, "--priors", tmp_path / "bad.toml", "--out", tmp_path / "none")
    assert bad.status == 2
    assert "no parameter is called 'A_cold_slop'" in bad.err
    assert not (tmp_path / "none").exists()


def test_a_misspelt_choice_is_named(run: Callable[..., Any], bench: Path, tmp_path: Path) -> None:
    found = run("gap", bench / "bench", "--out", tmp_path / "out", "--model", "autoo")
    assert found.status == 2
    assert "did you mean 'auto'?" in found.err
