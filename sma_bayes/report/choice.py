"""Which figures are drawn: those that the report shows, unless all are asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from sma_bayes.account import Account
from sma_bayes.errors import UnknownNameError, near_matches, require_known
from sma_bayes.progress import Progress, silent

Drawn = Literal["all", "report", "none"]
"""``report``: those that the report shows; ``all``: diagnostics of each condition and record too; ``none``: no figures
and no report."""

REPORT: Drawn = "report"
CAMPAIGN_REPORT_ABOVE = 100
"""Number of records above which the report tells of the campaign, and each record has a page of its own."""
MAX_CONDITIONS_SHOWN = 3
"""Number of conditions up to which the report shows each by itself, and of records whose misfit it shows."""
FORMATS = ("pdf", "svg", "png")
"""File formats of figures; the report itself shows PNG."""


@dataclass(frozen=True, slots=True)
class ReportOptions:
    """What a report is to be written with.

    Attributes
    ----------
    drawn : str
        See `figures_for`.
    formats : tuple of str
        Of the figures, see `formats_for`.
    workbook : bool
        Whether all tables are written as ``tables/results.xlsx`` too.
    jobs : int or None
        See `sma_bayes.runs.jobs.run`.
    tell : callable
    account : Account or None
        Of a run under way: holds what it took until now, and is told what figures and report take. Without it the
        report states what the results do.
    """

    drawn: Drawn = REPORT
    formats: tuple[str, ...] = ("pdf", "png")
    workbook: bool = False
    jobs: int | None = None
    tell: Progress = silent
    account: Account | None = None


ReportBuilder = Callable[[Path, ReportOptions], None]
"""Writes ``figures/``, ``tables/`` and ``report.html`` of a finished run, from what its folder holds."""


def formats_for(choice: Iterable[str]) -> tuple[str, ...]:
    """File formats of figures, checked; PNG among them, which the report shows.

    Raises
    ------
    UnknownNameError
        If one is none of `FORMATS`.

    Examples
    --------
    >>> formats_for(["svg", "pdf"])
    ('pdf', 'svg', 'png')
    """
    wanted = {name.strip() for name in choice}
    for name in sorted(wanted):
        require_known(name, FORMATS, f"there is no format of figures {name!r}")
    return tuple(name for name in FORMATS if name in wanted or name == "png")


def figures_for(choice: str | bool) -> Drawn:
    """What is drawn.

    Parameters
    ----------
    choice : str or bool
        ``report``, ``all`` or ``none``. True stands for ``report``, False for ``none``.

    Raises
    ------
    UnknownNameError
        If it is none of them.

    Examples
    --------
    >>> figures_for("report"), figures_for(True), figures_for(False)
    ('report', 'report', 'none')
    """
    if choice is True or choice == REPORT:
        return REPORT
    if choice == "all":
        return "all"
    if choice is False or choice == "none":
        return "none"
    raise UnknownNameError(
        f"there is no choice of figures {choice!r}",
        expected=near_matches(str(choice), (REPORT, "all", "none")),
    )
