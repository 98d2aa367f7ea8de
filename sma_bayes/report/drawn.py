"""Drawing figures, one task after the other or side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Protocol

from sma_bayes.account import Account
from sma_bayes.progress import Progress
from sma_bayes.report.figures.sheet import Drawing, FigureFiles, save
from sma_bayes.runs.jobs import run


class FigureTask(Protocol):
    """Figures that are drawn by one process, from what a folder holds."""

    @property
    def folder(self) -> Path: ...
    @property
    def title(self) -> str: ...
    def drawings(self) -> Iterator[Callable[[], Drawing]]:
        """What draws each of them."""
        ...


@dataclass(frozen=True, slots=True)
class OneFigure:
    """A figure by itself."""

    folder: Path
    draw: Callable[[], Drawing]
    title: str = ""

    def drawings(self) -> Iterator[Callable[[], Drawing]]:
        yield self.draw


def draw_all(
    tasks: Sequence[FigureTask], formats: Sequence[str], jobs: int | None, tell: Progress, account: Account
) -> dict[str, FigureFiles]:
    """Draw the figures of all tasks into ``figures/``; by stem.

    Parameters
    ----------
    tasks : sequence of FigureTask
    formats : sequence of str
        See `save`.
    jobs : int or None
        See `run`.
    tell : callable
        Told of each task; one more is announced, the report.
    account : Account
    """
    total = len(tasks) + 1  # the report itself comes last
    tell(0, total, "drawing figures")
    figures: dict[str, FigureFiles] = {}
    for done, files in enumerate(
        run(partial(_draw, tuple(formats)), tasks, jobs, account=account, stage="figures", light=True), 1
    ):
        figures |= {f.stem: f for f in files}
        tell(done, total, f"drew {tasks[done - 1].title or files[0].stem}")
    return figures


def _draw(formats: tuple[str, ...], task: FigureTask) -> list[FigureFiles]:
    return [save(draw, task.folder / "figures", formats) for draw in task.drawings()]
