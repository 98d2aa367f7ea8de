"""Log lines: none of a short run, one from time to time of a long one, and what the rest will take."""

from __future__ import annotations

import io
import time
from collections.abc import Callable

import pytest

from sma_bayes.progress import (
    CLEAR_LINE,
    LINE_S,
    Bar,
    LogLines,
    StepProgress,
    announce,
    lines_about,
    lines_inside,
    log_lines,
    silent,
)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    now = [1000.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])

    def go_on(seconds: float) -> None:
        now[0] += seconds

    return go_on


def test_a_short_run_prints_nothing(clock: Callable[[float], None]) -> None:
    out = io.StringIO()
    lines = LogLines(file=out)
    for done in range(1, 9):
        clock(3.0)
        lines(done, 8, "sampled")
        lines.still()
    assert out.getvalue() == ""


def test_what_is_left_is_not_told_before_as_many_are_done_as_run_at_once(
    clock: Callable[[float], None],
) -> None:
    """Of two that run side by side the second is nearly done, too, when the first is."""
    out = io.StringIO()
    lines = LogLines(file=out, at_once=2)
    for passed, done in ((75.0, 1), (5.0, 2), (70.0, 3)):
        clock(passed)
        lines(done, 4, f"sampled r{done}")
    assert out.getvalue().splitlines() == [
        "[75 s] 1 of 4: sampled r1",
        "[80 s] 2 of 4: sampled r2; the rest takes about 80 s more",
        "[2 min 30 s] 3 of 4: sampled r3",
    ]


def test_a_long_run_says_what_the_rest_takes_and_then_a_line_each_half_minute(
    clock: Callable[[float], None],
) -> None:
    out = io.StringIO()
    lines = LogLines(file=out, at_once=1)
    for done in range(1, 41):
        clock(10.0)
        lines(done, 40, f"sampled r{done}")
    told = out.getvalue().splitlines()
    assert told[0] == "[10 s] 1 of 40: sampled r1; the rest takes about 6 min more"
    assert told[1] == "[40 s] 4 of 40: sampled r4"
    assert len(told) == 14


def test_stages_do_not_tell_what_the_rest_takes(clock: Callable[[float], None]) -> None:
    out = io.StringIO()
    lines = LogLines(tasks=False, file=out)
    clock(40.0)
    lines(1, 40, "looking for disagreements")
    assert out.getvalue() == "[40 s] 1 of 40: looking for disagreements\n"
    clock(29.0)
    lines.still()
    clock(1.0)
    lines.still()
    assert out.getvalue().splitlines()[1:] == ["[70 s] still at 1 of 40: looking for disagreements"]


def test_every_step_is_a_line_where_that_is_wanted(clock: Callable[[float], None]) -> None:
    out = io.StringIO()
    lines = LogLines(every=0.0, file=out)
    for done in range(3):
        lines(done, 3, "step")
    assert len(out.getvalue().splitlines()) == 3


def test_a_long_record_tells_of_its_own_steps(
    clock: Callable[[float], None], capsys: pytest.CaptureFixture[str]
) -> None:
    tell = lines_about("2A-heating", 30.0)
    for _ in range(10):
        clock(10.0)
        tell("independence moves")
    assert capsys.readouterr().err.splitlines() == [
        f"2A-heating, after {n} s: independence moves" for n in (30, 60, 90)
    ]


class Terminal(io.StringIO):
    """What a task of another process writes to where a bar stands."""

    def isatty(self) -> bool:
        return True


def test_a_long_record_writes_over_the_bar_and_not_behind_it(clock: Callable[[float], None]) -> None:
    terminal = Terminal()
    lines = LogLines(tasks=False, file=terminal)
    clock(30.0)
    lines.inside("2A-heating", "independence moves")
    assert terminal.getvalue() == f"{CLEAR_LINE}2A-heating, after 30 s: independence moves\n"


def test_what_a_long_run_takes_is_told_before_it(clock: Callable[[float], None]) -> None:
    out, above = io.StringIO(), list[str]()
    for progress in (LogLines(file=out), Bar(silent, above.append), silent):
        announce(progress, 59.0, "8 records")
        announce(progress, 600.0, "8 records")
    assert out.getvalue() == "[0 s] 8 records: about 10 min, give or take a factor of three\n"
    assert above == ["8 records: about 10 min, give or take a factor of three"]


def test_a_step_of_a_study_says_what_it_takes_as_the_verb_alone_does(clock: Callable[[float], None]) -> None:
    out = io.StringIO()
    lines = LogLines(5.0, False, out)
    step = StepProgress(lines, "fit")
    announce(step, 600.0, "8 records")
    clock(6.0)
    step(1, 8, "fitted 100g")
    assert out.getvalue() == (
        "[0 s] fit: 8 records: about 10 min, give or take a factor of three\n[6 s] 1 of 8: fit: fitted 100g\n"
    )
    assert lines_inside(step) == 5.0
    assert lines_inside(StepProgress(silent, "fit")) is None
    told: list[str] = []
    announce(StepProgress(Bar(silent, told.append), "fit"), 600.0, "8 records")
    assert told == ["fit: 8 records: about 10 min, give or take a factor of three"]


def test_a_bar_shortens_what_it_shows_of_a_step() -> None:
    shown: list[tuple[int, int, str]] = []
    Bar(lambda *step: shown.append(step), print)(1, 2, "x" * 100)
    assert shown == [(1, 2, "x" * 60)]


def test_tasks_tell_of_themselves_wherever_somebody_reads() -> None:
    assert lines_inside(silent) is None
    assert lines_inside(Bar(silent, print)) == LINE_S
    with log_lines(5.0) as lines:
        assert lines_inside(lines) == 5.0


def test_the_watch_is_over_at_the_end() -> None:
    import threading

    before = threading.active_count()
    with log_lines():
        assert threading.active_count() == before + 1
    assert threading.active_count() == before


def test_a_run_that_went_on_unseen_is_not_said_to_be_still_there(clock: Callable[[float], None]) -> None:
    """Steps between two lines are told by the next, whoever prints it."""
    out = io.StringIO()
    lines = LogLines(file=out, tasks=False)
    clock(LINE_S)
    lines(1, 9, "checking")
    clock(0.9 * LINE_S)
    lines(4, 9, "checking")
    clock(0.1 * LINE_S)
    lines.still()
    clock(LINE_S)
    lines.still()
    assert out.getvalue().splitlines() == [
        "[30 s] 1 of 9: checking",
        "[60 s] 4 of 9: checking",
        "[90 s] still at 4 of 9: checking",
    ]
