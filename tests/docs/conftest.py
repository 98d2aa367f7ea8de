"""Commands and Python of the guides, run as printed in the folder where their reader stands."""

from __future__ import annotations

import contextlib
import io
import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from sma_bayes import cli


@pytest.fixture(scope="session")
def command() -> Callable[..., str]:
    """Run a line that begins with ``sma-bayes``, with options of its own, as the installed program does."""
    return _command


@pytest.fixture(scope="session")
def python() -> Callable[[Path, str], str]:
    """Run a script; what it prints."""
    return _python


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
