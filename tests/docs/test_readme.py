"""The README: its Python runs as printed, on a small campaign of the shape that it speaks of."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

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


def test_the_readme_is_about_ten_lines_of_python():
    (script,) = blocks(ROOT / "README.md", "python")
    assert len([line for line in script.splitlines() if line.strip()]) <= 12
