"""The guide to effects: its example works from another package, and is named where it was hidden."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
GUIDE = ROOT / "docs" / "howto" / "add_an_effect.md"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.DOTALL | re.MULTILINE)
ERROR, SHIFT = 1.5e-4, 0.1
"""Hidden run-out [m] and phase [turns] of the pulley."""


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with the guide's module, and the metadata that an installed package has."""
    folder = tmp_path_factory.mktemp("package")
    found = dict(BLOCK.findall(GUIDE.read_text(encoding="utf-8")))
    assert found["python"].count("\n") < 60
    name = found["python"].splitlines()[0].removeprefix("# ")
    (folder / name).write_text(found["python"], encoding="utf-8")
    metadata = folder / "pulley-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: pulley\nVersion: 1.0\n", encoding="utf-8"
    )
    points = re.sub(r'\[project\.entry-points\."(.+)"\]', r"[\1]", found["toml"]).replace('"', "")
    (metadata / "entry_points.txt").write_text(points, encoding="utf-8")
    return folder


def measure(path: Path, *, run_out: float) -> None:
    """A spring in three cycles, its displacement read off a turning drum whose centre is off its axis."""
    rng = np.random.default_rng(5)
    share = np.linspace(0.0, 1.0, 60)
    lines, clock = ["time_s,temperature_C,displacement_mm"], 0
    for _ in range(3):
        for rising in (True, False):
            for s in share if rising else share[::-1]:
                temperature = 25.0 + 50.0 * s
                true = 0.01 + 0.02 / (1.0 + np.exp(-0.32 * (temperature - (52.0 if rising else 46.0))))
                angle = (
                    2.0 * np.pi * (true / 0.008 + SHIFT)
                )  # the rope leaves the drum where the drum has turned to
                read = true + run_out * np.sin(angle) + 3e-5 * rng.standard_normal()
                lines.append(f"{clock},{temperature:.5g},{1e3 * read:.6g}")
                clock += 1
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def test_the_effect_keeps_the_contract_that_the_reader_is_told_to_ask(
    package: Path, contract_tests: Callable[[Path, Path], int]
) -> None:
    assert contract_tests(GUIDE, package) >= 8


@pytest.mark.parametrize("run_out", [ERROR, 0.0], ids=["hidden", "absent"])
def test_the_effect_is_ranked_refitted_drawn_and_named_only_where_it_is(
    package: Path, tmp_path: Path, run_out: float
) -> None:
    measure(tmp_path / "run.csv", run_out=run_out)
    tool = str(Path(sys.executable).with_name("sma-bayes"))
    figures = "--figures=all" if run_out else "--no-figures"
    command = [tool, "gap", "run.csv", "--out", "out", "--jobs", "1", "--quiet", figures]
    environment = os.environ | {"PYTHONPATH": str(package)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "out" / "gap.json").read_text(encoding="utf-8"))
    assert "eccentric_pulley" in {c["id"] for c in found["candidates"]}
    if not run_out:
        assert found["verdict"] == "none"
        return
    assert [e["id"] for e in found["effects"]] == ["eccentric_pulley"], found["candidates"]
    error = found["effects"][0]["parameters"]["e"]
    assert error["q05"] < ERROR < error["q95"]
    assert found["gap"]["shrink"] > 0.9
    assert (tmp_path / "out" / "figures" / "effect-eccentric_pulley.pdf").is_file()
