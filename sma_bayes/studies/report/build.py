"""Build figures, tables and the report of a finished run from what its output folder holds.

What only another kind of run needs is not imported: it takes as long as a figure.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from sma_bayes.account import Account
from sma_bayes.errors import OutputError
from sma_bayes.progress import Progress, silent
from sma_bayes.report.choice import REPORT, Wanted, figures_for, formats_for
from sma_bayes.runs.documents import COMPARISON, CONDITIONS, FIT, GAP, MARK
from sma_bayes.runs.store import nothing_unfinished


def build_report(
    folder: Path,
    *,
    figures: str | bool = REPORT,
    formats: Iterable[str] = ("pdf", "png"),
    workbook: bool = False,
    jobs: int | None = None,
    progress: Progress | None = None,
    account: Account | None = None,
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
    account : Account, optional
        Told how long figures and report took.

    Raises
    ------
    OutputError
        If the folder holds no run, an unfinished one, or can't be written.
    """
    folder = Path(folder).absolute()
    drawn = Wanted(figures_for(figures), formats_for(formats), workbook)
    with nothing_unfinished(folder):
        _build(folder, drawn, jobs, progress or silent, account)


def _build(folder: Path, wanted: Wanted, jobs: int | None, tell: Progress, account: Account | None) -> None:
    spent = account or Account()
    if any(document.is_in(folder) for document in (GAP, COMPARISON, CONDITIONS)):
        from sma_bayes.studies.report.build_study import build_study_report

        build_study_report(folder, wanted, jobs, tell, spent, known=account is not None)
        return
    if not any((folder / name).is_file() for name in (FIT.file, MARK)):
        raise OutputError(
            "holds no run of sma_bayes" if folder.is_dir() else "is not a folder",
            file=folder,
            expected="a folder with summary.json, gap.json, comparison.json or conditions.json: what fit, gap, compare "
            "and conditions write",
            remedy="name the folder that was given as --out; of a study one of its folders",
        )
    from sma_bayes.studies.fit.report import build_fit_report

    build_fit_report(folder, wanted, jobs, tell, spent, known=account is not None)
