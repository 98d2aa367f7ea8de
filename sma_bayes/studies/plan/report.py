"""The report of a plan: its figures, tables and page."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from sma_bayes.report.assembly import assemble
from sma_bayes.report.choice import ReportOptions
from sma_bayes.report.figures.sheet import Drawing, FigureFiles
from sma_bayes.report.html import write_page
from sma_bayes.report.tables import Table
from sma_bayes.studies.plan.figures.plan import candidates_figure, narrowing_figure
from sma_bayes.studies.plan.outputs import StoredPlan, read_plan
from sma_bayes.studies.plan.tables import plan_tables


def build_report(folder: Path, wanted: ReportOptions) -> None:
    """Write the report of a plan; see `sma_bayes.report.choice.ReportBuilder`."""
    stored = read_plan(folder)
    drawings: list[Callable[[StoredPlan], Drawing]] = [] if wanted.drawn == "none" else [candidates_figure]
    if drawings and stored.found.kind != "tell-apart":
        drawings.append(narrowing_figure)
    assemble(stored, wanted, drawings, plan_tables, write_plan_report)


def write_plan_report(
    stored: StoredPlan, tables: Mapping[str, Table], figures: Mapping[str, FigureFiles]
) -> None:
    """Write ``report.html`` of a plan.

    Parameters
    ----------
    stored : StoredPlan
    tables : mapping of str to Table
    figures : mapping of str to FigureFiles
        By stem; their PNG files are in ``figures/``.

    Raises
    ------
    OutputError
        If it can't be written, or a figure can't be read.
    """
    found = stored.found
    more = "" if found.available is None else f" --hours {found.available:g}"
    write_page(
        stored.folder,
        "sma_bayes.studies.plan",
        figures,
        found=found,
        tables=tables,
        command=f'sma-bayes plan "{found.source}" --for "{found.asked}" --out DIR --seed {found.seed}{more}',
    )
