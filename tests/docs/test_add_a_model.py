"""The guide to response models: its Gompertz curve goes through every verb, from another package."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
GUIDE = ROOT / "docs" / "howto" / "add_a_model.md"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.DOTALL | re.MULTILINE)
TOOL = str(Path(sys.executable).with_name("sma-bayes"))
CAMPAIGN = """\
[campaign]
name = "bench"
[columns]
time = { name = "time_s", unit = "s" }
temperature = { name = "temperature_C", unit = "degC" }
force = { name = "force_N", unit = "N" }
displacement = { name = "displacement_m", unit = "m" }
"""
CONDITION = """\
[[condition]]
id = "{name}"
file = "{name}.csv"
current_A = {current}
"""
STUDY = """\
[study]
campaign = "one"
out = "study"
model = "gompertz"
figures = "none"
noise = "independent"
[fit]
[[ask]]
force = "1.5 N"
"""
RATE = {"force": 0.30, "displacement": 0.25}


def curve(temperature: np.ndarray, span: float, rate: float, midpoint: float, offset: float) -> np.ndarray:
    return offset + span * np.exp(-np.exp(-rate * (temperature - midpoint)))


def sweep(path: Path, shift: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    up = np.linspace(30.0, 80.0, 45)
    temperature = np.concatenate([up, up[::-1]])
    falls = np.repeat([0.0, 6.0], up.size)
    force = curve(temperature + falls - shift, 2.5, RATE["force"], 50.0, 0.4)
    displacement = curve(temperature + falls - shift, 0.02, RATE["displacement"], 47.0, 0.001)
    table = np.column_stack([
        np.arange(temperature.size), temperature, force + 0.02 * rng.standard_normal(force.size),
        displacement + 2e-4 * rng.standard_normal(force.size),
    ])  # fmt: skip
    header = "time_s,temperature_C,force_N,displacement_m"
    np.savetxt(path, table, delimiter=",", header=header, comments="")


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with the guide's module, the metadata of an installed package, and a campaign of three conditions."""
    folder = tmp_path_factory.mktemp("gompertz")
    found = BLOCK.findall(GUIDE.read_text(encoding="utf-8"))
    (module,) = (text for kind, text in found if kind == "python")
    (folder / module.splitlines()[0].removeprefix("# ")).write_text(module, encoding="utf-8")
    metadata = folder / "extension-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: extension\nVersion: 1.0\n", encoding="utf-8"
    )
    (points,) = (text for kind, text in found if kind == "toml")
    points = re.sub(r'\[project\.entry-points\."(.+)"\]', r"[\1]", points).replace('"', "")
    (metadata / "entry_points.txt").write_text(points, encoding="utf-8")
    for name, currents in (("bench", (1.0, 1.5, 2.0)), ("one", (1.0,))):
        bench = folder / name
        bench.mkdir()
        text = CAMPAIGN
        for i, current in enumerate(currents):
            sweep(bench / f"c{i}.csv", 2.0 * i, i)
            text += CONDITION.format(name=f"c{i}", current=current)
        (bench / "campaign.toml").write_text(text, encoding="utf-8")
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    return folder


def run(place: Path, *arguments: str) -> str:
    path = os.pathsep.join(filter(None, (str(place), os.environ.get("PYTHONPATH", ""))))
    done = subprocess.run(
        [TOOL, *arguments],
        cwd=place,
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr
    return done.stdout


def told(place: Path, *arguments: str) -> dict[str, Any]:
    found = json.loads(run(place, *arguments, "--json"))
    assert isinstance(found, dict)
    return found


@pytest.fixture(scope="module")
def fitted(place: Path) -> dict[str, Any]:
    return told(place, "fit", "bench", "--model", "gompertz", "--noise", "independent", "--out", "results",
                "--figures", "report")  # fmt: skip


def test_it_is_listed_and_its_priors_are_shown(place: Path) -> None:
    run(place, "inspect", "bench")
    assert "gompertz: Gompertz curve" in run(place, "priors", "--list")
    (place / "mine.toml").write_text(run(place, "priors", "gompertz"), encoding="utf-8")
    assert "[both.midpoint]" in (place / "mine.toml").read_text(encoding="utf-8")


def test_it_keeps_the_contract_that_the_reader_is_told_to_ask(
    place: Path, contract_tests: Callable[[Path, Path], int]
) -> None:
    assert contract_tests(GUIDE, place) > 20


def test_a_fit_finds_the_parameters_that_made_the_data(fitted: dict[str, Any]) -> None:
    assert fitted["options"]["model"] == "gompertz"
    assert fitted["converged"]
    for record in fitted["records"]:
        assert record["model"] == "gompertz"
        for channel, rate in RATE.items():
            p = record["parameters"][f"{channel}_rate"]
            assert (p["channel"], p["role"]) == (channel, "rate")
            assert abs(p["mean"] - rate) < 4.0 * p["sd"]
    widths = {q["channel"]: q["median"] for q in fitted["loops"] if q["name"] == "hysteresis_width"}
    assert widths["force"] == pytest.approx(6.0, abs=1.5)


def test_its_priors_can_be_edited_and_given_back(place: Path, fitted: dict[str, Any]) -> None:
    text = run(place, "priors", "gompertz").replace("median = 15.0", "median = 14.0")
    (place / "mine.toml").write_text(text, encoding="utf-8")
    again = told(place, "fit", "one", "--model", "gompertz", "--priors", "mine.toml", "--noise", "independent",
                 "--out", "again", "--figures", "none")  # fmt: skip
    first, second = (f["records"][0]["parameters"]["force_rate"] for f in (fitted, again))
    assert first["prior"] != second["prior"]
    assert second["mean"] == pytest.approx(first["mean"], abs=first["sd"])


def test_a_finished_fit_answers_and_tells_what_the_current_does(place: Path, fitted: dict[str, Any]) -> None:
    answers = told(place, "ask", "results", "--force", "1.5 N")["answers"]
    assert len(answers) == len(fitted["records"])
    found = told(place, "conditions", "results", "--model", "gompertz", "--out", "conditions", "--figures", "none",
                 "--at", "current_A=1.75")  # fmt: skip
    assert found["predictions"]
    run(place, "report", "results")
    page = (place / "results" / "report.html").read_text(encoding="utf-8")
    assert "force_midpoint" in page


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_a_mistake_in_it_is_told_as_that_of_its_package(place: Path, tmp_path: Path, jobs: str) -> None:
    """A worker hands on its traceback as text."""
    shutil.copytree(
        place, tmp_path, dirs_exist_ok=True, ignore=shutil.ignore_patterns("results", "__pycache__")
    )
    module = tmp_path / "sma_model_gompertz.py"
    module.write_text(
        module.read_text(encoding="utf-8").replace("out[channel] =", "out[channle] ="), encoding="utf-8"
    )
    command = [
        TOOL,
        "fit",
        "bench",
        "--model",
        "gompertz",
        "--out",
        "failed",
        "--jobs",
        jobs,
        "--noise",
        "independent",
    ]
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    failed = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert failed.returncode == 70
    assert "NameError: name 'channle'" in failed.stderr
    assert failed.stderr.splitlines()[-1].startswith("error: this is a mistake in sma_model_gompertz, please")


def test_it_takes_part_in_a_comparison(place: Path) -> None:
    found = told(place, "compare", "one", "--model", "gompertz", "--noise", "independent", "--out", "comparison",
                 "--figures", "report")  # fmt: skip
    best = {m for g in found["overall"] for m in (g["preferred"],)}
    assert best == {"gompertz"}


def test_a_gap_study_finds_nothing_missing_of_it(place: Path) -> None:
    found = told(place, "gap", "bench", "--model", "gompertz", "--out", "gap", "--figures", "none")
    assert found["model"] == "gompertz"
    assert found["verdict"] == "none"


def test_a_study_file_runs_it(place: Path) -> None:
    found = told(place, "run", "study.toml")
    assert found["exit_status"] == 0
    stored = json.loads((place / "study" / "fit" / "summary.json").read_text(encoding="utf-8"))
    assert {r["model"] for r in stored["records"]} == {"gompertz"}
