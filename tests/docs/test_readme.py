"""The README: its Python runs as printed, on a small campaign of the shape that it speaks of."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sma_bayes import study_gap
from sma_bayes.effects import EFFECTS
from sma_bayes.records.campaign import read_campaign
from sma_bayes.simulated.campaign import course_of, measurement_files
from sma_bayes.simulated.rig import Setup

ROOT = Path(__file__).resolve().parents[2]


def blocks(file: Path, language: str) -> list[str]:
    """Fenced blocks of a language, in order."""
    return re.findall(
        rf"^```{language}\n(.*?)^```", file.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE
    )


@pytest.fixture
def bench(tmp_path: Path, python: Callable[[Path, str], str]) -> Path:
    """Folder that holds the campaign `bench`: the tutorial's record under the id 2A."""
    folder = tmp_path / "bench"
    folder.mkdir()
    script = blocks(ROOT / "docs" / "tutorial.md", "python")[0]
    python(folder, script)
    (folder / "bench.csv").rename(folder / "2A.csv")
    (folder / "campaign.toml").write_text('[[condition]]\nid = "2A"\nfile = "2A.csv"\n', encoding="utf-8")
    return tmp_path


def test_the_python_of_the_readme_runs_and_says_what_it_promises(bench, python):
    (script,) = blocks(ROOT / "README.md", "python")
    lines = python(bench, script).splitlines()
    assert lines[:2] == ["2A-heating converged", "2A-cooling converged"]
    unit, temperature, low, high = lines[2].split()
    assert unit == "N/m"
    assert 25.0 < float(temperature) < 85.0
    assert 0.0 < float(low) < float(high)
    widths = [line.split() for line in lines[3:] if line.startswith("hysteresis_width")]
    assert {w[1] for w in widths} == {"force", "displacement"}
    for _, _, low, median, high, unit in widths:
        assert unit == "degC"
        assert float(low) < float(median) < float(high)
        assert float(median) == pytest.approx(8.0, abs=0.2)  # the midpoints were put 8 degrees apart


@pytest.fixture(scope="module")
def gap_of_the_demo(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """`sma-bayes gap bench --out gap --pool campaign` on the measurements of `sma-bayes demo`."""
    folder = tmp_path_factory.mktemp("demo")
    (folder / "bench").mkdir()
    for name, text in measurement_files(seed=0).items():
        (folder / "bench" / name).write_text(text, encoding="utf-8", newline="\n")
    study_gap(read_campaign(folder / "bench"), folder / "gap", pool="campaign", jobs=1, figures=False)
    found: dict[str, Any] = json.loads((folder / "gap" / "gap.json").read_text(encoding="utf-8"))
    return found


def test_gap_says_of_the_demo_that_the_force_contains_the_load(gap_of_the_demo: dict[str, Any]) -> None:
    """Its rig bears the weight that preloads the spring: all of it cold, with a part of the stroke that it adds hot."""
    found = gap_of_the_demo
    assert found["verdict"] == "named"
    assert [e["id"] for e in found["effects"]] == [found["rounds"][0]["added"]] == ["dead_load"]
    share = found["effects"][0]["parameters"]["share"]
    light, heavy = (course_of(load).setup for load in ("100g", "200g"))

    def force(setup: Setup, martensite: float) -> float:
        return float(setup.force(setup.displacement(np.array(martensite))))

    cold, hot = ((force(heavy, m) - force(light, m)) / (heavy.preload - light.preload) for m in (1.0, 0.0))
    assert cold == pytest.approx(1.0)
    assert cold < share["q05"] < share["q95"] < hot


def test_gap_of_the_demo_closes_without_each_of_its_conditions(gap_of_the_demo: dict[str, Any]) -> None:
    """The same choice whichever condition is held out, and most of the gap is closed there: none passed for noise."""
    found = gap_of_the_demo
    assert found["gap"]["chosen_without"] == [["dead_load"]] * 3
    assert found["gap"]["after"] < 0.3 * found["gap"]["before"]
    assert all(n["lag1"] < 0.8 for n in found["noise"])
    assert not any("hardly changes from sample to sample" in c for c in found["cautions"])


def test_the_number_of_effects_in_the_readme_is_that_of_the_catalogue() -> None:
    (told,) = re.findall(r"tries (\d+) effects", (ROOT / "README.md").read_text(encoding="utf-8"))
    shipped = [e for e in EFFECTS.values() if type(e).__module__.startswith("sma_bayes.")]
    assert int(told) == len(shipped)


def test_the_readme_is_about_ten_lines_of_python():
    (script,) = blocks(ROOT / "README.md", "python")
    assert len([line for line in script.splitlines() if line.strip()]) <= 12
