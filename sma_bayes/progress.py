"""Progress of a run: whom it tells, and how it is told where there is no terminal."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Final, TextIO

Progress = Callable[[int, int, str], None]
"""Told how many tasks are done, how many there are, and what is going on."""

LINE_S: Final = 30.0
"""Seconds between two log lines, and before the first: a short run prints none."""
BAR_CHARACTERS: Final = 60
"""Length of what a bar says of the step."""
CLEAR_LINE: Final = "\r\x1b[2K"
"""Takes the bar off the line on which a task of another process writes; it is drawn anew below."""
NOTED_S: Final = 60.0
"""What is expected to take longer than this is announced [s]."""


def silent(done: int, total: int, message: str) -> None:
    """Progress that nobody wants to know."""


@dataclass(slots=True)
class LogLines:
    """Progress as lines of a log, for where there is no terminal.

    Attributes
    ----------
    every : float
        Seconds between two lines and before the first; with 0 every message is a line.
    tasks : bool
        Whether what is counted are tasks that take about as long as one another, so that the first ones tell what the
        others will take.
    file : file
        Where lines go.
    at_once : int
        Tasks that may run at the same time, by default one for each core: until so many are done, those that are under
        way have taken time of which nobody knows how much is left.
    """

    every: float = LINE_S
    tasks: bool = True
    file: TextIO = field(default_factory=lambda: sys.stderr)
    at_once: int = field(default_factory=lambda: os.cpu_count() or 1)
    _begun: float = field(default_factory=lambda: time.monotonic(), init=False)
    _line: float = field(default=0.0, init=False)
    _last: str = field(default="", init=False)
    _told: str = field(default="", init=False)
    _announced: bool = field(default=False, init=False)

    def __call__(self, done: int, total: int, message: str) -> None:
        """Tell a step."""
        elapsed = self.elapsed
        self._last = f"{done} of {total}: {message}"
        if self.tasks and done >= self.at_once and not self._announced:
            self._announced = True
            left = elapsed / done * (total - done)
            if left > NOTED_S:
                self._print(f"{self._last}; the rest takes about {duration(left)} more")
                return
        if elapsed - self._line >= self.every:
            self._print(self._last)

    @property
    def elapsed(self) -> float:
        """Seconds since the beginning."""
        return time.monotonic() - self._begun

    def inside(self, name: str, message: str) -> None:
        """Tell a step of one task among others."""
        if self.elapsed - self._line >= self.every:
            self._line = self.elapsed
            over_a_bar = CLEAR_LINE if self.file.isatty() else ""
            print(f"{over_a_bar}{name}, after {elapsed(self._line)}: {message}", file=self.file, flush=True)

    def note(self, text: str) -> None:
        """Print a line now."""
        self._print(text)

    def still(self) -> None:
        """Tell that the run goes on, where nothing was told for long."""
        if self.elapsed - self._line >= max(self.every, LINE_S):
            moved = self._last != self._told
            self._print(self._last if moved else f"still at {self._last}" if self._last else "still reading")

    def _print(self, text: str) -> None:
        self._line, self._told = self.elapsed, self._last
        print(f"[{elapsed(self._line)}] {text}", file=self.file, flush=True)


@dataclass(slots=True)
class Bar:
    """Progress as a bar of one line on a terminal; what a task tells of itself, and what is announced, stands above it.

    Attributes
    ----------
    update : callable
        Told how many are done, how many there are and what is going on, as the bar shows it.
    write : callable
        Writes a line above the bar.
    every : float
        Seconds between two lines of a task.
    """

    update: Progress
    write: Callable[[str], None]
    every: float = LINE_S

    def __call__(self, done: int, total: int, message: str) -> None:
        """Tell a step."""
        self.update(done, total, message[:BAR_CHARACTERS])


@dataclass(frozen=True, slots=True)
class StepProgress:
    """Progress of one step of several, told with its name and in the way of the whole.

    Attributes
    ----------
    whole : callable
        Progress of all steps.
    name : str
    """

    whole: Progress
    name: str

    def __call__(self, done: int, total: int, message: str) -> None:
        """Tell what a step does."""
        self.whole(done, total, f"{self.name}: {message}")


def announce(progress: Progress, seconds: float, what: str) -> None:
    """Tell before a run what it is expected to take, where that is more than `NOTED_S`."""
    if seconds <= NOTED_S:
        return
    text = f"{what}: about {duration(seconds)}, give or take a factor of three"
    while isinstance(progress, StepProgress):
        text, progress = f"{progress.name}: {text}", progress.whole
    if isinstance(progress, LogLines):
        progress.note(text)
    elif isinstance(progress, Bar):
        progress.write(text)


def duration(seconds: float) -> str:
    """Time for people.

    Examples
    --------
    >>> duration(12.3), duration(600.0), duration(3 * 3600.0 + 120.0)
    ('12 s', '10 min', '3 h 2 min')
    """
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def elapsed(seconds: float) -> str:
    """Time that has passed, with its seconds up to ten minutes, so that lines that follow each other differ.

    Examples
    --------
    >>> elapsed(12.3), elapsed(155.0), elapsed(600.0)
    ('12 s', '2 min 35 s', '10 min')
    """
    if not 100.0 <= seconds < 600.0:
        return duration(seconds)
    return f"{int(seconds) // 60} min {int(seconds) % 60} s"


@contextmanager
def log_lines(every: float = LINE_S, *, tasks: bool = True) -> Iterator[LogLines]:
    """Progress as log lines on standard error, told from time to time also while nothing comes to an end."""
    lines, over = LogLines(every, tasks), threading.Event()

    def watch() -> None:
        while not over.wait(1.0):
            lines.still()

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield lines
    finally:
        over.set()
        watcher.join()


def lines_inside(progress: Progress) -> float | None:
    """How often a task tells of itself by log lines [s]; None where nobody is told."""
    while isinstance(progress, StepProgress):
        progress = progress.whole
    return progress.every if isinstance(progress, LogLines | Bar) else None


def lines_about(name: str, every: float) -> Callable[[str], None]:
    """What a long task tells of its own steps, by lines on standard error with its name."""
    return partial(LogLines(every, tasks=False).inside, name)
