"""A verb is a folder and a line: that of the guide joins from another package, and within this one."""

from __future__ import annotations

import json
import os
import pkgutil
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sma_bayes.studies
from sma_bayes.studies.registry import VERBS, command_of

ROOT = Path(__file__).resolve().parents[2]
GUIDE = ROOT / "docs" / "howto" / "add_a_verb.md"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.DOTALL | re.MULTILINE)
WIDTH = 12.0
"""Width of the loop that is measured [K]."""
NARROW, WIDE = ("--most", "14"), ("--most", "11")


def test_every_folder_of_studies_is_a_verb() -> None:
    folders = {m.name for m in pkgutil.iter_modules(sma_bayes.studies.__path__) if m.ispkg}
    assert {name for name, package in VERBS.items() if package.__name__.startswith("sma_bayes.")} == folders


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_says_what_it_does_in_a_line(verb: str) -> None:
    first = (command_of(verb).__doc__ or "").split("\n")[0]
    assert first.endswith(".")
    assert len(first) <= 120


def write_verb(folder: Path, package: str) -> None:
    """The files of the guide, of a package of this name."""
    folder.mkdir()
    (folder / "__init__.py").write_text('"""Widths of hysteresis."""\n', encoding="utf-8")
    for kind, text in BLOCK.findall(GUIDE.read_text(encoding="utf-8")):
        if kind in ("python", "jinja"):
            name = text.splitlines()[0].strip("{}# ").removeprefix("sma_hysteresis/")
            (folder / name).write_text(text.replace("sma_hysteresis", package), encoding="utf-8")


def beside(place: Path) -> None:
    """The verb as another package, and the metadata that it has once it is installed."""
    write_verb(place / "sma_hysteresis", "sma_hysteresis")
    metadata = place / "sma_hysteresis-1.0.dist-info"
    metadata.mkdir()
    about = "Metadata-Version: 2.1\nName: sma_hysteresis\nVersion: 1.0\n"
    (metadata / "METADATA").write_text(about, encoding="utf-8")
    (points,) = (t for kind, t in BLOCK.findall(GUIDE.read_text(encoding="utf-8")) if kind == "toml")
    points = re.sub(r'\[project\.entry-points\."(.+)"\]', r"[\1]", points).replace('"', "")
    (metadata / "entry_points.txt").write_text(points, encoding="utf-8")


def within(place: Path) -> None:
    """The verb as a folder of this package, and its line in the registry, between two others."""
    ignored = shutil.ignore_patterns("__pycache__")
    for name in ("sma_bayes", "priors"):
        shutil.copytree(ROOT / name, place / name, ignore=ignored)
    studies = place / "sma_bayes" / "studies"
    write_verb(studies / "hysteresis", "sma_bayes.studies.hysteresis")
    registry = studies / "registry.py"
    text = registry.read_text(encoding="utf-8")
    assert text.count('    "diff",\n') == 1
    text = text.replace('    "diff",\n', '    "diff",\n    "hysteresis",\n')
    registry.write_text(text, encoding="utf-8")


@pytest.fixture(scope="module")
def fitted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a fit of one loop."""
    folder = tmp_path_factory.mktemp("loop")
    rng = np.random.default_rng(0)
    up = np.linspace(25.0, 95.0, 60)
    temperature = np.concatenate([up, up[::-1]])
    middle = np.repeat([64.0, 64.0 - WIDTH], up.size)
    stroke = 14.0 + 26.0 / (1.0 + np.exp((temperature - middle) / 4.0)) + rng.normal(0.0, 0.2, middle.size)
    table = np.column_stack([0.5 * np.arange(middle.size), temperature, stroke])
    header = "time_s,temperature_C,displacement_mm"
    np.savetxt(folder / "run.csv", table, delimiter=",", header=header, comments="")
    options = ("--noise", "independent", "--figures", "none", "--jobs", "1", "--quiet")
    done = call(ROOT, "fit", str(folder / "run.csv"), "--out", str(folder / "fit"), *options)
    assert done.returncode == 0, done.stderr
    return folder / "fit"


@pytest.fixture(params=[beside, within], ids=["another package", "a folder and a line"])
def place(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    request.param(tmp_path)
    return tmp_path


def call(place: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the command line as it is found from a place."""
    path = os.pathsep.join(dict.fromkeys((str(place), str(ROOT))))
    return subprocess.run(
        (sys.executable, "-m", "sma_bayes", *arguments), cwd=place, env=os.environ | {"PYTHONPATH": path},
        capture_output=True, text=True, check=False,
    )  # fmt: skip


def verbs_listed(place: Path) -> list[str]:
    told = call(place, "--help").stdout.partition("Commands:\n")[2]
    return re.findall(r"^  (\w+)", told, re.MULTILINE)


def test_it_is_in_the_help_and_its_call_is_checked(place: Path) -> None:
    listed, shipped = verbs_listed(place), verbs_listed(ROOT)
    assert [verb for verb in listed if verb != "hysteresis"] == shipped
    at = listed.index("hysteresis")
    last = [verb for verb, package in VERBS.items() if package.__name__.startswith("sma_bayes.")][-1]
    assert at == listed.index("diff") + 1 if (place / "sma_bayes").is_dir() else at > listed.index(last)
    assert "--most" in call(place, "hysteresis", "--help").stdout
    assert call(place, "hysteresis", ".").returncode == 2
    nothing = call(place, "hysteresis", ".", *NARROW)
    assert nothing.returncode == 2
    assert nothing.stderr.startswith("error: ")


def test_it_runs_with_its_exit_status_and_json(place: Path, fitted: Path) -> None:
    narrow = call(place, "hysteresis", str(fitted), *NARROW, "--json")
    assert narrow.returncode == 0, narrow.stderr
    found: dict[str, Any] = json.loads(narrow.stdout)
    (width,) = found["widths"]
    sd = (width["q95"] - width["q05"]) / 3.29
    assert abs(width["median"] - WIDTH) < 4.0 * sd  # of 16,000 seeds one would fail
    assert width["narrow"]
    wide = call(place, "hysteresis", str(fitted), *WIDE)
    assert wide.returncode == 1, wide.stderr
    assert "may be wider than allowed" in wide.stdout


def test_its_folder_has_a_report_that_is_built_again(place: Path, fitted: Path) -> None:
    out = place / "widths"
    done = call(place, "hysteresis", str(fitted), *NARROW, "--out", str(out), "--quiet")
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "Widths of hysteresis" in page
    (out / "report.html").unlink()
    again = call(place, "report", str(out))
    assert again.returncode == 0, again.stderr
    assert (out / "report.html").read_text(encoding="utf-8") == page
    assert (out / "tables" / "widths.csv").is_file()
    another = call(place, "hysteresis", str(fitted), *NARROW, "--out", str(out))
    assert another.returncode == 2


def test_what_its_document_does_not_state_leaves_the_exit_status_0(place: Path, fitted: Path) -> None:
    for name in ("schema.py", "workflow.py"):
        (file,) = place.rglob(f"*hysteresis/{name}")
        lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
        left = [line for line in lines if not re.match(r"\s+(converged|exit_status)\b", line)]
        assert len(left) == len(lines) - 2
        file.write_text("".join(left), encoding="utf-8")
    wide = call(place, "hysteresis", str(fitted), *WIDE)
    assert wide.returncode == 0, wide.stderr
    assert "may be wider than allowed" in wide.stdout


def test_a_mistake_in_it_is_told_as_that_of_its_package(place: Path, fitted: Path) -> None:
    (file,) = place.rglob("*hysteresis/workflow.py")
    text = file.read_text(encoding="utf-8")
    assert "fit.loops" in text
    file.write_text(text.replace("fit.loops", "fit.hoops"), encoding="utf-8")
    failed = call(place, "hysteresis", str(fitted), *NARROW)
    whose = "sma_bayes" if (place / "sma_bayes").is_dir() else "sma_hysteresis"
    assert failed.returncode == 70
    assert f"this is a mistake in {whose}, please report" in failed.stderr


@pytest.mark.parametrize(
    ("verb", "package", "said"),
    [
        ("fit", "missing_package", "two packages provide the verb 'fit'"),
        ("broken", "missing_package", "the verb 'broken' of another package can't be loaded"),
        (
            "empty",
            "empty_package",
            "the verb 'empty' can't be loaded: No module named 'empty_package.command'",
        ),
    ],
)
def test_a_verb_that_can_not_be_had_is_one_error(tmp_path: Path, verb: str, package: str, said: str) -> None:
    (tmp_path / "empty_package.py").touch()
    metadata = tmp_path / "other-1.0.dist-info"
    metadata.mkdir()
    about = "Metadata-Version: 2.1\nName: other\nVersion: 1.0\n"
    (metadata / "METADATA").write_text(about, encoding="utf-8")
    point = f"[sma_bayes.studies]\n{verb} = {package}\n"
    (metadata / "entry_points.txt").write_text(point, encoding="utf-8")
    called = call(tmp_path, verb)
    assert called.returncode == 2
    assert called.stderr.startswith(f"error: {said}")
    assert package in called.stderr
    assert call(tmp_path, "--help").returncode == 2
    if verb == "empty":  # only what is called is made
        assert call(tmp_path, "priors", "--list").returncode == 0
