"""The guide to extensions: its two examples work from another package, found by their entry points."""

from __future__ import annotations

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


def run(package: Path, *command: str) -> str:
    environment = os.environ | {"PYTHONPATH": str(package)}
    done = subprocess.run(command, cwd=package, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_noise_model_is_a_density_and_agrees_with_its_draws(package):
    script = """
import numpy as np
from scipy import stats
from sma_bayes.noise import NOISE_MODELS, Steps
noise = NOISE_MODELS["laplace"]
steps = Steps(np.ones(4000, dtype=bool), np.ones(4000), False)
e = noise.draw(np.random.default_rng(0), np.empty((2, 0)), steps)
same = np.abs(noise.log_density(e, np.empty((2, 0)), steps) - stats.laplace.logpdf(e, scale=0.5**0.5)).max()
p = stats.kstest(e.ravel(), stats.laplace(scale=0.5**0.5).cdf).pvalue
print(same, p, e.var(), noise.estimate(3.0 * e[0], steps)[0])
"""
    same, p, variance, sd = map(float, run(package, sys.executable, "-c", script).split())
    assert same < 1e-12
    assert p > 0.001
    assert variance == pytest.approx(1.0, abs=0.06)
    assert sd == pytest.approx(3.0, abs=0.15)


def test_the_format_is_recognised_and_a_record_in_it_is_fitted_with_the_noise_model(package):
    rng = np.random.default_rng(0)
    temperature = np.linspace(25.0, 85.0, 80)
    force = 2.0 / (1.0 + np.exp(-0.3 * (temperature - 55.0))) + rng.laplace(scale=0.02, size=80)
    table = np.rec.fromarrays([temperature, force], names="temperature_C,force_N")
    np.save(package / "run.npy", np.asarray(table))
    tool = str(Path(sys.executable).with_name("sma-bayes"))
    out = run(
        package, tool, "fit", "run.npy", "--out", "results", "--noise", "laplace", "--no-figures", "--json"
    )
    assert '"name": "laplace"' in out
    assert '"converged": true' in out
