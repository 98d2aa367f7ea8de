"""The guide to simulating a current: its profile, commands and Python run as printed."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

GUIDE = Path(__file__).resolve().parents[2] / "docs" / "howto" / "simulate_a_current.md"


def blocks(language: str) -> list[str]:
    return re.findall(
        rf"^```{language}\n(.*?)^```", GUIDE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE
    )


@pytest.fixture
def place(heated_fit: Path, tmp_path: Path) -> Path:
    """A folder with the fit under the name of the guide, and its profile."""
    (tmp_path / "results").symlink_to(heated_fit, target_is_directory=True)
    (profile,) = blocks("csv")
    (tmp_path / "profile.csv").write_text(profile, encoding="utf-8")
    return tmp_path


def test_the_commands_run_and_leave_what_the_guide_names(place: Path) -> None:
    commands = [line for block in blocks("console") for line in block.splitlines() if " simulate " in line]
    assert len(commands) == 3
    for line in commands:
        done = subprocess.run(
            [sys.executable, "-m", "sma_bayes", *shlex.split(line)[1:]],
            cwd=place, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
    assert (place / "course" / "report.html").is_file()
    assert {p.name for p in (place / "course" / "bands").iterdir()} == {
        f"{c}-{s}.csv" for c in ("1.0A", "1.2A") for s in ("cold", "hot")
    }


def test_the_python_runs(place: Path) -> None:
    (script,) = blocks("python")
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=place, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) == 6
