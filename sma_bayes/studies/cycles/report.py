"""The report of a study of cycles: which figures it has."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from sma_bayes.report.assembly import assemble
from sma_bayes.report.choice import MANY, REPORT, Drawn, ReportOptions
from sma_bayes.report.figures.sheet import Drawing
from sma_bayes.runs.documents import CYCLES
from sma_bayes.runs.finished_run import read_finished
from sma_bayes.studies.cycles.figures.cycles import curves_figure, numbers_figure, values_figure
from sma_bayes.studies.cycles.page import page_words
from sma_bayes.studies.cycles.schema import CyclesDocument, StoredCycles
from sma_bayes.studies.cycles.shown import in_declared_units
from sma_bayes.studies.cycles.tables import cycles_tables


def build_report(folder: Path, wanted: ReportOptions) -> None:
    """Write the report of a study of cycles; see `sma_bayes.report.choice.ReportBuilder`."""
    stored = read_finished(CYCLES, CyclesDocument, folder, in_declared_units)
    assemble(__package__, stored, wanted, _drawings(stored, wanted.drawn), cycles_tables, page_words)


def _drawings(stored: StoredCycles, drawn: Drawn) -> list[Callable[[StoredCycles], Drawing]]:
    conditions = stored.found.conditions
    if not (drawn == "all" or (drawn == REPORT and len(conditions) <= MANY)):
        return []
    makers = (curves_figure, numbers_figure, values_figure)
    return [partial(make, number=n + 1) for n in range(len(conditions)) for make in makers]
