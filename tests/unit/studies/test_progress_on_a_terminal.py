"""The bar that a command shows on a terminal."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from sma_bayes.studies.command_execution import progress_shown, time_left


class Screen(io.StringIO):
    """A terminal that keeps what was written."""

    def isatty(self) -> bool:
        return True


def test_the_rest_is_told_only_where_it_is_known() -> None:
    assert time_left(None) == ""
    assert time_left(3725.4) == "1:02:05 left"


def test_nothing_is_left_of_a_task_whose_length_is_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Screen()
    monkeypatch.setattr("sys.stderr", screen)
    monkeypatch.setattr(
        "rich.console.Console", lambda **_: Console(file=screen, force_terminal=True, width=80)
    )
    with progress_shown(False, False) as tell:
        assert tell is not None
    shown = screen.getvalue()
    assert "reading" in shown
    assert "left" not in shown
