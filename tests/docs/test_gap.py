"""The pages on the gap workflow: numbers that decide, effects and keys are those of the program."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from sma_bayes import study_gap
from sma_bayes.effects import EFFECTS
from sma_bayes.records.campaign import read_campaign
from sma_bayes.studies.gap import name, study

DOCS = Path(__file__).resolve().parents[2] / "docs"
THRESHOLDS = {
    "p_value": study.SIGNIFICANT_P,
    "ln_bayes_factor": study.LEAST_LN_BAYES_FACTOR,
    "ln_bayes_factor_apart": study.LN_BAYES_FACTOR_TOLD_APART,
    "unexplained_share": pytest.approx(1.0 - study.LEAST_SHARE_CARRIED),
    "share_beside": name.LEAST_SHARE_BESIDE_FLEXIBLE,
    "share_of_form": name.MOST_SHARE_OF_FORM,
    "share_beyond_shape": name.LEAST_SHARE_BEYOND_SHAPE,
    "ln_bayes_factor_shape": study.MISFIT_LN_BAYES_FACTOR,
    "further_share": study.LEAST_FURTHER_SHARE,
}


@pytest.fixture(scope="module")
def explanation() -> str:
    return (DOCS / "explanation" / "gap.md").read_text(encoding="utf-8")


def test_thresholds_are_those_in_force(explanation: str) -> None:
    told = re.findall(r"\| ([\d.e-]+) \| `(\w+)` \|", explanation)
    assert {key: float(value) for value, key in told} == THRESHOLDS


def test_every_effect_is_listed_with_its_title_and_no_other(explanation: str) -> None:
    listed = dict(re.findall(r"^\| `(\w+)` \| (.+?) \|", explanation, re.MULTILINE))
    assert listed == {name: effect.title for name, effect in EFFECTS.items()}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study in which something was found, without figures."""
    place = tmp_path_factory.mktemp("study")
    rng = np.random.default_rng(2)
    share = np.concatenate([np.linspace(0.0, 1.0, 30), np.linspace(1.0, 0.0, 30)])
    lines = ["time_s,temperature_C,displacement_mm"]
    for i in range(480):
        temperature = 25.0 + 50.0 * share[i % 60]
        middle = 52.0 if i % 60 < 30 else 46.0
        trained = 0.6 * (1.0 - np.exp(-(i // 60) / 3.0))
        stroke = 10.0 + 20.0 / (1.0 + np.exp(-0.32 * (temperature - middle)))
        lines.append(f"{i},{temperature:.5g},{stroke + trained + 0.05 * rng.standard_normal():.6g}")
    (place / "run.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    study_gap(read_campaign(place / "run.csv"), place / "out", jobs=1, figures=False)
    return place / "out"


def keys(document: object) -> set[str]:
    """Keys at any depth, without names of channels, inputs, settings, parameters, packages and numbers of a prior."""
    if isinstance(document, list):
        return set().union(*map(keys, document))
    if not isinstance(document, dict):
        return set()
    own = set(document)
    for key, value in document.items():
        if key in ("channels", "parameters"):
            own |= keys(list(value.values()))
        elif key == "prior":
            own |= {"family", "source"}
        elif key not in ("units", "declared_units", "versions", "settings"):
            own |= keys(value)
    return own


def test_the_reference_names_every_key_of_gap_json(folder: Path) -> None:
    found = json.loads((folder / "gap.json").read_text(encoding="utf-8"))
    assert found["effects"], "a study without effects has fewer keys"
    text = (DOCS / "reference" / "files.md").read_text(encoding="utf-8").partition("## By gap")[2]
    text += "`content_sha256` `kind` `message` `file` `rows` `count` `dropped` `column` `severity`"  # as for a fit
    assert {k for k in keys(found) if f"`{k}`" not in text} == set()


def test_the_reference_names_every_file_and_every_column_of_the_series(folder: Path) -> None:
    text = (DOCS / "reference" / "files.md").read_text(encoding="utf-8").partition("## By gap")[2]
    for path in folder.rglob("*"):
        assert path.is_dir() or str(path.relative_to(folder)) in text, path
    header = (folder / "series.csv").read_text(encoding="utf-8").splitlines()[0].split(",")
    named = [re.sub(r"^training_drift_", "ID_", column) for column in header]
    assert {c for c in named if f"`{c}`" not in text} == set()
