"""A study file: what it may say, and how each mistake in it is told."""

from __future__ import annotations

from pathlib import Path

import pytest

from sma_bayes.errors import StudyError
from sma_bayes.studies.run.study_file import read_study

WHOLE = """\
[study]
campaign = "bench"
out = "results"
seed = 7
priors = "mine.toml"
noise = "ar1"

[fit]
noise = "student_t"
arrangement = "parallel"
bias = 120.0

[compare]
pool = "campaign"
priors = "paper"

[gap]
figures = "none"
model = "phase_slopes"

[conditions]
at = ["current_A=2"]
figures = "all"

[[ask]]
stiffness = "130 N/m"

[[ask]]
force = "2 N"
branch = "heating"
probability = 0.95
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "study.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_paths_are_relative_to_the_file_and_steps_inherit(tmp_path: Path) -> None:
    study = read_study(written(tmp_path, WHOLE))
    assert (study.campaign, study.out, study.data) == (tmp_path / "bench", tmp_path / "results", None)
    assert (study.seed, study.jobs) == (7, None)
    mine = str(tmp_path / "mine.toml")
    assert study.steps == {
        "fit": {
            "model": "modified_sigmoid", "priors": mine, "pool": "none", "figures": "report", "noise": "student_t",
            "sampler": "independence", "extrapolate": 0.0, "arrangement": "parallel", "bias": 120.0,
            "self_check": False,
        },
        "compare": {
            "model": "modified_sigmoid", "priors": "paper", "pool": "campaign", "figures": "report", "noise": "ar1",
        },
        "gap": {"model": "phase_slopes", "priors": mine, "pool": "none", "figures": "none"},
        "conditions": {"at": ("current_A=2",), "leave_out": (), "scatter": 0.1, "figures": "all", "model": None},
    }  # fmt: skip
    assert [a["stiffness"] or a["force"] for a in study.asks] == ["130 N/m", "2 N"]
    assert study.asks[1]["probability"] == 0.95


def test_an_empty_table_runs_a_step_with_its_defaults(tmp_path: Path) -> None:
    study = read_study(written(tmp_path, '[study]\ncampaign = "a"\nout = "b"\n[gap]\n'))
    assert list(study.steps) == ["gap"]


def test_a_plan_to_tell_apart_starts_from_the_gap_and_finds_its_candidates(tmp_path: Path) -> None:
    text = '[study]\ncampaign = "a"\nout = "b"\n[gap]\n[plan]\nfor = "tell-apart"\ncandidates = "c.toml"\n'
    options = read_study(written(tmp_path, text)).steps["plan"]
    assert (options["asked"], options["figures"], options["setup"]) == ("tell-apart", "report", "0 min")
    assert options["candidates"] == str(tmp_path / "c.toml")


def test_steps_of_files_find_them_and_keep_defaults_of_their_own(tmp_path: Path) -> None:
    """The pool of a heat balance and the model of a modulus are not those of the fit."""
    text = """\
[study]
campaign = "a"
out = "b"
pool = "none"
model = "two_stage"
[fit]
[sensitivity]
[cycles]
[simulate]
current = "profile.csv"
start = ["hot"]
[modulus]
files = ["dmta.csv", "more/dmta.xlsx"]
[watch]
files = ["new.csv"]
[card]
"""
    study = read_study(written(tmp_path, text))
    assert study.needs == dict.fromkeys(("sensitivity", "simulate", "watch", "card"), "fit")
    steps = study.steps
    assert (steps["simulate"]["current"], steps["simulate"]["start"]) == (
        str(tmp_path / "profile.csv"),
        ("hot",),
    )
    assert (steps["simulate"]["pool"], steps["modulus"]["model"], steps["cycles"]["model"]) == (
        "campaign", "auto", "two_stage"
    )  # fmt: skip
    assert steps["modulus"]["files"] == [str(tmp_path / "dmta.csv"), str(tmp_path / "more" / "dmta.xlsx")]
    assert steps["watch"]["files"] == [str(tmp_path / "new.csv")]


@pytest.mark.parametrize(
    ("old", "new", "column", "told"),
    [
        ("seed = 7", "sede = 7", "study.sede", "did you mean 'seed'"),
        ("seed = 7", 'seed = "7"', "study.seed", "integer"),
        ("seed = 7", "seed = -1", "study.seed", "greater than or equal to 0"),
        ('campaign = "bench"\n', "", "study.campaign", "campaign = ..."),
        ('out = "results"\n', "", "study.out", "out = ..."),
        ("[compare]", "[comapre]", "comapre", "did you mean 'compare'"),
        ("[gap]\nfigures", "[gap]\nnoise = 'ar1'\nfigures", "gap.noise", "known: "),
        ('pool = "campaign"', 'pool = "all"', "compare.pool", "'none' or 'campaign'"),
        ('arrangement = "parallel"\n', "", "fit", "an arrangement beside bias"),
        ('force = "2 N"', 'force = "2 N"\nstiffness = "1 N/m"', "ask 2", "exactly one of stiffness"),
        ('force = "2 N"', 'force = "2 N"\nat = ["50 degC"]', "ask 2", "exactly one of stiffness"),
        ('force = "2 N"', 'force = "2 N"\nunit = ["mN"]', "ask 2", "unit beside `at` only"),
        ('force = "2 N"', "force = 2", "ask 2.force", "a text in quotation marks"),
        ("probability = 0.95", "probability = 95", "ask 2.probability", "less than or equal to 1"),
        ('at = ["current_A=2"]', 'at = "current_A=2"', "conditions.at", "a list: [ ... ]"),
        ('at = ["current_A=2"]', 'pool = "none"', "conditions.pool", "known: "),
        ('noise = "student_t"', 'pool = "campaign"', "fit.pool", 'pool = "none" under [fit]'),
        ('branch = "heating"', 'branch = "up"', "ask 2.branch", "'heating' or 'cooling'"),
        ("[[ask]]\nforce", "[plan]\nfro = 'parameters'\n[[ask]]\nforce", "plan.fro", "did you mean 'for'"),
        ("[[ask]]\nforce", "[plan]\nhours = 2.0\n[[ask]]\nforce", "plan.for", "for = ..."),
        (
            "[[ask]]\nforce",
            "[plan]\nfor = 'parameters'\nhours = 0.0\n[[ask]]\nforce",
            "plan.hours",
            "greater than 0",
        ),
        (
            "[[ask]]\nforce",
            "[simulate]\nrule = 'play'\n[[ask]]\nforce",
            "simulate",
            "current, reach, or both",
        ),
        ("[[ask]]\nforce", "[watch]\n[[ask]]\nforce", "watch.files", "files = ..."),
        ("[[ask]]\nforce", "[cycles]\nshare = 0.0\n[[ask]]\nforce", "cycles.share", "greater than 0"),
        ("[[ask]]\nforce", "[card]\ndraws = 1\n[[ask]]\nforce", "card.draws", "greater than or equal to 50"),
        ("[[ask]]\nforce", "[fit2]\nforce", "fit2", "did you mean 'fit'"),
    ],
)
def test_each_mistake_is_told_with_file_and_key(
    tmp_path: Path, old: str, new: str, column: str, told: str
) -> None:
    assert old in WHOLE
    path = written(tmp_path, WHOLE.replace(old, new))
    with pytest.raises(StudyError) as caught:
        read_study(path)
    assert caught.value.file == str(path)
    assert caught.value.column == column
    assert told in str(caught.value)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('[study]\ncampaign = "a"\nout = "b"\n', "no step is declared"),
        ('[study]\ncampaign = "a"\nout = "b"\n[gap]\n[[ask]]\nforce = "1 N"\n', "ask without a fit"),
        ('[study]\ncampaign = "a"\nout = "b"\n[gap]\n[plan]\nfor = "parameters"\n', "plan without a fit"),
        ('[study]\ncampaign = "a"\nout = "b"\n[fit]\n[plan]\nfor = "tell-apart"\n', "plan without a gap"),
        (
            '[study]\ncampaign = "a"\nout = "b"\n[fit]\n[ask]\nforce = "1 N"\n',
            r"each begins with \[\[ask\]\]",
        ),
        ('[study]\ncampaign = "a"\nout = "b"\n[gap]\n[card]\n', "card without a fit"),
        (
            '[study]\ncampaign = "a"\nout = "b"\npool = "campaign"\n[fit]\n[sensitivity]\n',
            "sensitivity after a fit in which all conditions share",
        ),
        ("study = 3\n[fit]\n", r"a table: \[study\]"),
        ("[fit]\n", "campaign = ..."),
        ("[study\n", "row 1"),
    ],
)
def test_what_is_no_study(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(StudyError, match=told):
        read_study(written(tmp_path, text))


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="can't be read"):
        read_study(tmp_path / "no.toml")


@pytest.mark.parametrize(
    ("fit", "conditions", "taken"),
    [("", "", None), ('model = "auto"', "", "auto"), ('model = "auto"', 'model = "two_stage"', "two_stage")],
)
def test_conditions_take_one_model_where_the_fit_chooses(
    tmp_path: Path, fit: str, conditions: str, taken: str | None
) -> None:
    text = f'[study]\ncampaign = "bench"\nout = "results"\n[fit]\n{fit}\n[conditions]\n{conditions}\n'
    assert read_study(written(tmp_path, text)).steps["conditions"]["model"] == taken
