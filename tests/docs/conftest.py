"""Commands and Python of the guides, run as printed in the folder where their reader stands."""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from sma_bayes import cli

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def command() -> Callable[..., str]:
    """Run a line that begins with ``sma-bayes``, with options of its own, as the installed program does."""
    return _command


@pytest.fixture(scope="session")
def python() -> Callable[[Path, str], str]:
    """Run a script; what it prints."""
    return _python


@pytest.fixture(scope="session")
def contract_tests() -> Callable[[Path, Path], int]:
    """Run the contract tests that a guide names, with the package of its reader; how many passed."""
    return _contract_tests


def _contract_tests(guide: Path, package: Path) -> int:
    (arguments,) = re.findall(r"^pytest (.+)$", guide.read_text(encoding="utf-8"), re.MULTILINE)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(package), str(ROOT)])}
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments.split()]
    done = subprocess.run(words, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    (passed,) = re.findall(r"(\d+) passed", done.stdout)
    return int(passed)


def _command(place: Path, line: str | Sequence[str], *options: str) -> str:
    words = shlex.split(line) if isinstance(line, str) else list(line)
    assert words[0] == "sma-bayes"
    said, complaint = io.StringIO(), io.StringIO()
    with (
        contextlib.chdir(place),
        pytest.MonkeyPatch.context() as patch,
        contextlib.redirect_stdout(said),
        contextlib.redirect_stderr(complaint),
    ):
        patch.setattr(sys, "argv", [*words, *options])
        status: object = 0
        try:
            cli.main()
        except SystemExit as end:
            status = end.code or 0
    assert status == 0, complaint.getvalue()
    return said.getvalue()


def _python(place: Path, script: str) -> str:
    said = io.StringIO()
    with contextlib.chdir(place), contextlib.redirect_stdout(said):
        exec(compile(script, "<guide>", "exec"), {"__name__": "guide"})
    return said.getvalue()
