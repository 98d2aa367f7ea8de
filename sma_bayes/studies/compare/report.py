"""The report of a comparison of models: which figures it has."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from sma_bayes.report.assembly import assemble
from sma_bayes.report.choice import MANY, REPORT, Drawn, ReportOptions
from sma_bayes.report.figures.sheet import Drawing
from sma_bayes.runs.documents import COMPARISON
from sma_bayes.runs.finished_run import read_finished
from sma_bayes.studies.compare.figures.averages import model_average_figure
from sma_bayes.studies.compare.figures.models import curves_figure, differences_figure, pages
from sma_bayes.studies.compare.page import page_words
from sma_bayes.studies.compare.schema import ComparisonDocument, StoredComparison
from sma_bayes.studies.compare.shown import in_declared_units
from sma_bayes.studies.compare.tables import comparison_tables, model_averages


def build_report(folder: Path, wanted: ReportOptions) -> None:
    """Write the report of a comparison; see `sma_bayes.report.choice.ReportBuilder`."""
    stored = read_finished(COMPARISON, ComparisonDocument, folder, in_declared_units)
    assemble(__package__, stored, wanted, _drawings(stored, wanted.drawn), comparison_tables, page_words)


def _drawings(stored: StoredComparison, drawn: Drawn) -> list[Callable[[StoredComparison], Drawing]]:
    drawings: list[Callable[[StoredComparison], Drawing]] = []
    records = stored.found.records
    if drawn == "all" or (drawn == REPORT and len(records) <= MANY):
        drawings += [partial(curves_figure, record=record) for record in records]
    drawings += [partial(differences_figure, number=n + 1) for n in range(pages(stored))]
    return [*drawings, model_average_figure] if model_averages(stored) else drawings
