"""Drawing figures, one task after the other or side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from sma_bayes.account import Account
from sma_bayes.progress import Progress
from sma_bayes.report.figures.sheet import Drawing, FigureFiles, save
from sma_bayes.runs.jobs import run


@dataclass(frozen=True, slots=True)
class FigureTask:
    """Figures that are drawn by one process; named by the stem of the first without a title."""

    drawings: Callable[[], Iterable[Callable[[], Drawing]]]
    title: str = ""


def draw_all(
    folder: Path,
    tasks: Sequence[FigureTask],
    formats: Sequence[str],
    jobs: int | None,
    tell: Progress,
    account: Account,
) -> dict[str, FigureFiles]:
    """Draw the figures of all tasks into ``figures/`` of a folder; by stem.

    Parameters
    ----------
    folder : Path
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
        run(
            partial(_draw, folder / "figures", tuple(formats)),
            tasks,
            jobs,
            account=account,
            stage="figures",
            light=True,
        ),
        1,
    ):
        figures |= {f.stem: f for f in files}
        tell(done, total, f"drew {tasks[done - 1].title or files[0].stem}")
    return figures


def _draw(folder: Path, formats: tuple[str, ...], task: FigureTask) -> list[FigureFiles]:
    return [save(draw, folder, formats) for draw in task.drawings()]
