"""The guide to simulating a current: its profile, commands and Python run as printed."""

from __future__ import annotations

import re
from collections.abc import Callable
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


def test_the_commands_run_and_leave_what_the_guide_names(place: Path, command: Callable[..., str]) -> None:
    commands = [line for block in blocks("console") for line in block.splitlines() if " simulate " in line]
    assert len(commands) == 3
    for line in commands:
        command(place, line)
    assert (place / "course" / "report.html").is_file()
    assert {p.name for p in (place / "course" / "bands").iterdir()} == {
        f"{c}-{s}.csv" for c in ("1.0A", "1.2A") for s in ("cold", "hot")
    }


def test_the_python_runs(place: Path, python: Callable[[Path, str], str]) -> None:
    (script,) = blocks("python")
    assert len(python(place, script).splitlines()) == 6
