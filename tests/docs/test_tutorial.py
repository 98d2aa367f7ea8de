"""The tutorial: its commands and its Python run in the order in which they stand."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

TUTORIAL = Path(__file__).resolve().parents[2] / "docs" / "tutorial.md"
BLOCK = re.compile(r"^```(python|console)\n(.*?)^```", re.DOTALL | re.MULTILINE)


@pytest.fixture(scope="module")
def after(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    """Folder in which the whole tutorial has been gone through, and what each step printed."""
    folder = tmp_path_factory.mktemp("tutorial")
    beside = Path(sys.executable).parent  # `sma-bayes` of the environment that runs the tests
    environment = os.environ | {"PATH": f"{beside}{os.pathsep}{os.environ['PATH']}", "COLUMNS": "160"}
    said = {}
    for language, text in BLOCK.findall(TUTORIAL.read_text(encoding="utf-8")):
        steps = [text] if language == "python" else text.splitlines()
        for step in steps:
            command = [sys.executable, "-c", step] if language == "python" else ["bash", "-c", step]
            done = subprocess.run(
                command, cwd=folder, env=environment, capture_output=True, text=True, check=False
            )
            assert done.returncode == 0, f"{step}\n{done.stdout}\n{done.stderr}"
            said[step] = done.stdout
    return folder, said


def printed(said: dict[str, str], word: str) -> str:
    (out,) = [text for step, text in said.items() if word in step]
    return out


def test_inspect_shows_both_records_and_the_drop_out(after):
    out = printed(after[1], "inspect")
    assert "bench-heating" in out
    assert "bench-cooling" in out
    assert re.search(r"displacement\s.*\b202\b.*\b1\b.*kept out", out)


def test_fit_converges_with_the_noise_that_was_made_and_identifies_everything(after):
    summary = json.loads((after[0] / "results" / "summary.json").read_text(encoding="utf-8"))
    assert summary["converged"]
    for record in summary["records"]:
        assert record["noise"]["name"] == "independent"
        assert record["segments"] == 2
        assert all(p["identified"] for p in record["parameters"].values())
        assert record["parameters"]["B3"]["median"] == pytest.approx(
            55.0 if record["branch"] == "heating" else 47.0, abs=0.2
        )


def test_report_is_there_and_needs_no_network(after):
    report = (after[0] / "results" / "report.html").read_text(encoding="utf-8")
    assert not re.search(r'(src|href)="https?:', report)
    places = [report.index(f'<h2 id="{name}"') for name in ("answer", "conclusions", "diagnostics")]
    assert places == sorted(places)


def test_the_derived_stiffness_is_least_certain_where_force_and_displacement_are_flat(after):
    lines = (
        (after[0] / "results" / "bands" / "bench-heating-stiffness.csv").read_text(encoding="utf-8").split()
    )
    header, *rows = (line.split(",") for line in lines)
    at = {name: i for i, name in enumerate(header)}
    relative = [(float(r[at["q95"]]) - float(r[at["q05"]])) / float(r[at["q50"]]) for r in rows]
    middle = min(relative)
    assert relative[0] > 2.0 * middle
    assert relative[-1] > 2.0 * middle


def test_python_prints_the_midpoint_of_both_branches(after):
    out = printed(after[1], "open_posterior")
    assert re.search(r"^bench-heating B3 5[45]\.\d+ to 55\.\d+ degC$", out, re.MULTILINE)
    assert re.search(r"^bench-cooling B3 4[67]\.\d+ to 47\.\d+ degC$", out, re.MULTILINE)


def test_priors_and_resume_leave_what_the_page_says(after):
    folder, _ = after
    assert (folder / "mine.toml").read_text(encoding="utf-8") == (
        folder / "results-mine" / "priors.toml"
    ).read_text(encoding="utf-8")
    assert not (folder / "results-mine" / "report.html").exists()
    assert (folder / "results" / "report.html").exists()


REFERENCE = TUTORIAL.parent / "reference" / "files.md"


def keys(document: object) -> set[str]:
    """Keys of a JSON document at any depth, names of records' own things left out."""
    if isinstance(document, list):
        return set().union(*map(keys, document)) if document else set()
    if not isinstance(document, dict):
        return set()
    named = {
        "parameters",
        "fit",
        "correlation",
        "correlation_replicated",
        "quantities",
        "lag1",
        "ln_evidence",
        "held_out",
        "nearest",
        "discrepancy",
        "versions",
    }
    found = set(document)
    for key, value in document.items():
        if key in named and isinstance(value, dict):
            found |= (
                set()
                if key in ("lag1", "ln_evidence", "held_out", "versions")
                else keys(list(value.values()))
            )
        elif key in ("shape", "stages_s", "stages_cpu_s"):
            continue
        else:
            found |= keys(value)
    return found


def test_the_reference_names_every_key_of_the_summary(after):
    summary = json.loads((after[0] / "results" / "summary.json").read_text(encoding="utf-8"))
    text = REFERENCE.read_text(encoding="utf-8")
    family_numbers = {"family", "median", "sigma", "sign", "mean", "sd", "low", "high", "shape", "scale"}
    unnamed = {k for k in keys(summary) - family_numbers if f"`{k}`" not in text}
    assert not unnamed


def test_the_reference_names_every_column_of_a_band_and_every_file(after):
    folder = after[0] / "results"
    text = REFERENCE.read_text(encoding="utf-8")
    header = (folder / "bands" / "bench-heating-force.csv").read_text(encoding="utf-8").splitlines()[0]
    assert all(re.search(rf"\b{column}\b", text) for column in header.split(","))
    for entry in folder.iterdir():
        assert f"`{entry.name}" in text, entry.name
    groups = "posterior sample_stats log_likelihood posterior_predictive log_prior prior prior_predictive "
    assert all(f"`{group}`" in text for group in (groups + "observed_data constant_data").split())
