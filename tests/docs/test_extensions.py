"""The guide to extensions: its two examples work from another package, found by their entry points."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
GUIDE = ROOT / "docs" / "howto" / "add_a_noise_model_or_format.md"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.DOTALL | re.MULTILINE)


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """Folder with the guide's two modules, and the metadata that an installed package has."""
    found = BLOCK.findall(GUIDE.read_text(encoding="utf-8"))
    for module in (text for kind, text in found if kind == "python"):
        (tmp_path / module.splitlines()[0].removeprefix("# ")).write_text(module, encoding="utf-8")
    metadata = tmp_path / "extension-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: extension\nVersion: 1.0\n", encoding="utf-8"
    )
    points = "\n".join(text for kind, text in found if kind == "toml")
    points = re.sub(r'\[project\.entry-points\."(.+)"\]', r"[\1]", points).replace('"', "")
    (metadata / "entry_points.txt").write_text(points, encoding="utf-8")
    return tmp_path


def run(package: Path, *command: str, cwd: Path | None = None) -> str:
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(package), str(ROOT)])}
    done = subprocess.run(
        command, cwd=cwd or package, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def command_line(*arguments: str) -> tuple[str, ...]:
    return (sys.executable, "-m", "sma_bayes", *arguments)


def with_outliers(package: Path) -> str:
    """A run of 200 samples in the guide's format, one in ten scattered five times as far as the others."""
    rng = np.random.default_rng(0)
    temperature = np.linspace(25.0, 85.0, 200)
    scatter = np.where(rng.random(200) < 0.1, 5.0, 1.0) * rng.standard_normal(200)
    force = 2.0 / (1.0 + np.exp(-0.3 * (temperature - 55.0))) + 0.02 * scatter
    table = np.rec.fromarrays([temperature, force], names="temperature_C,force_N")
    np.save(package / "run.npy", np.asarray(table))
    return "run.npy"


def test_the_noise_model_keeps_the_contract_that_the_reader_is_told_to_ask(package):
    (command,) = [
        text for _, text in BLOCK.findall(GUIDE.read_text(encoding="utf-8")) if "test_noise" in text
    ]
    arguments = command.split()[1:]
    options = ("-q", "-p", "no:cacheprovider")
    said = run(package, sys.executable, "-m", "pytest", *options, *arguments, cwd=ROOT)
    passed = int(re.search(r"(\d+) passed", said)[1])
    assert passed > 80
    assert "contaminated+growing+temperature_error" in run(
        package, sys.executable, "-m", "pytest", *options, *arguments, "--collect-only", cwd=ROOT
    )


def test_the_format_keeps_the_contract_that_the_reader_is_told_to_ask(package):
    (command,) = [
        text for _, text in BLOCK.findall(GUIDE.read_text(encoding="utf-8")) if "test_formats" in text
    ]
    options = ("-q", "-p", "no:cacheprovider")
    said = run(package, sys.executable, "-m", "pytest", *options, *command.split()[1:], cwd=ROOT)
    assert int(re.search(r"(\d+) passed", said)[1]) > 10


def test_other_noise_models_keep_theirs_beside_it(package):
    said = run(
        package, sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "tests/contract/test_noise_models.py",
        "-k", "(parameters or name or feels) and not contaminated", cwd=ROOT,
    )  # fmt: skip
    assert "passed" in said


def test_the_format_is_recognised_and_a_record_in_it_is_fitted_with_the_noise_model(package):
    out = run(
        package,
        *command_line("fit", with_outliers(package), "--out", "results", "--noise", "contaminated"),
        "--no-figures", "--json",
    )  # fmt: skip
    (record,) = json.loads(out)["records"]
    assert record["noise"]["name"] == "contaminated"
    assert record["converged"]
    share = record["parameters"]["force_outliers"]
    assert share["q05"] < 0.1 < share["q95"]
    assert 0.015 < record["parameters"]["force_sd"]["median"] < 0.027
    assert share["prior"]["family"] == "beta"


def test_auto_considers_it(package):
    out = run(package, *command_line("inspect", with_outliers(package), "--json"))
    (record,) = json.loads(out)["records"]
    assert record["noise"]["name"] in ("contaminated", "student_t")
    assert "contaminated normal" in record["noise"]["reason"]


def test_a_priors_file_may_speak_of_its_parameter(package):
    text = 'schema = "sma-bayes/priors/1"\nextends = "modified_sigmoid"\n[noise.outliers]\nfixed = 0.2\n'
    (package / "priors.toml").write_text(text, encoding="utf-8")
    out = run(
        package,
        *command_line("fit", with_outliers(package), "--out", "results", "--noise", "contaminated"),
        "--priors", "priors.toml", "--no-figures", "--json",
    )  # fmt: skip
    (record,) = json.loads(out)["records"]
    assert record["parameters"]["force_outliers"]["median"] == 0.2
