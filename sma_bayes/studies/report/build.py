"""Build figures, tables and the report of a finished run from what its output folder holds.

What only another kind of run needs is not imported: it takes as long as a figure.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from sma_bayes.errors import OutputError
from sma_bayes.progress import Progress, silent
from sma_bayes.report.choice import REPORT, ReportOptions, figures_for, formats_for
from sma_bayes.runs.documents import COMPARISON, CONDITIONS, FIT, GAP, RUN_MARKER, SIMULATION, read_mark
from sma_bayes.runs.store import nothing_unfinished
from sma_bayes.studies.registry import VERBS, has_report, report_builder


def build_report(
    folder: Path,
    *,
    figures: str | bool = REPORT,
    formats: Iterable[str] = ("pdf", "png"),
    workbook: bool = False,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> None:
    """Write ``figures/``, ``tables/`` and ``report.html`` of a run.

    Parameters
    ----------
    folder : Path
        Output folder of a finished `fit`, `gap`, `compare` or `conditions`. Nothing but the three outputs is changed.
    figures : str or bool
        ``report`` or ``all``, see `figures_for`; with ``none`` the report goes without.
    formats : iterable of str
        Of the figures, see `FORMATS`.
    workbook : bool
        Whether to write all tables as ``tables/results.xlsx`` too.
    jobs : int, optional
        Processes that draw figures; by default one for each core.
    progress : callable, optional

    Raises
    ------
    OutputError
        If the folder holds no run, an unfinished one, or can't be written.
    """
    folder = Path(folder).absolute()
    wanted = ReportOptions(figures_for(figures), formats_for(formats), workbook, jobs, progress or silent)
    with nothing_unfinished(folder):
        report_builder(_verb_of(folder))(folder, wanted)


def _verb_of(folder: Path) -> str:
    """The verb that wrote a folder."""
    kind = (read_mark(folder) or {}).get("kind")
    verbs = [verb for verb in VERBS if verb == kind and has_report(verb)]
    verbs += [
        document.verb for document in (GAP, COMPARISON, CONDITIONS, SIMULATION) if document.is_in(folder)
    ]
    verbs += [FIT.verb for name in (FIT.file, RUN_MARKER) if (folder / name).is_file()]
    if verbs:
        return verbs[0]
    raise OutputError(
        "holds no run of sma_bayes" if folder.is_dir() else "is not a folder",
        file=folder,
        expected=f"a folder that one of these has written: {', '.join(filter(has_report, VERBS))}",
        remedy="name the folder that was given as --out; of a study one of its folders",
    )
