"""The guide to handing a fit on: its commands, Python and C run as printed."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

GUIDE = Path(__file__).resolve().parents[2] / "docs" / "howto" / "hand_a_fit_on.md"


def blocks(language: str) -> list[str]:
    return re.findall(
        rf"^```{language}\n(.*?)^```", GUIDE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE
    )


def card() -> str:
    (line,) = (line for block in blocks("console") for line in block.splitlines() if " card " in line)
    return line


def run(place: Path, script: str) -> str:
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", script], cwd=place, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_solver_gets_what_the_guide_names(
    loaded_fit: Path, tmp_path: Path, command: Callable[..., str]
) -> None:
    (tmp_path / "results").symlink_to(loaded_fit, target_is_directory=True)
    command(tmp_path, card(), "--no-figures")
    text = GUIDE.read_text(encoding="utf-8")
    written = {p.name for p in (tmp_path / "card").iterdir()}
    for name in ("simcoon.json", "sma_react.json", "constitutive-draws.csv", "constitutive-covariance.csv",
                 "constitutive-curves.csv", "card.json"):  # fmt: skip
        assert f"`{name}`" in text
        assert name in written
    (in_simcoon, _) = blocks("python")
    assert run(tmp_path, in_simcoon).startswith("SMADI {'flagT': 0.0, 'E_A': ")


def test_the_controller_gets_what_the_guide_names(
    heated_fit: Path, tmp_path: Path, command: Callable[..., str]
) -> None:
    (tmp_path / "results").symlink_to(heated_fit, target_is_directory=True)
    command(tmp_path, card(), "--no-figures")
    (_, again) = blocks("python")
    assert len(run(tmp_path, again).splitlines()) == 4
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler: the header can't be tried")
    (program,) = blocks("c")
    (tmp_path / "look.c").write_text(program, encoding="utf-8")
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Icard", "-c"]
    subprocess.run([compiler, *flags, "look.c"], cwd=tmp_path, check=True)
