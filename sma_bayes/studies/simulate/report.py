"""The report of a simulation: its figures, tables and page."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from sma_bayes.report.assembly import assemble
from sma_bayes.report.choice import ReportOptions
from sma_bayes.runs.documents import SIMULATION
from sma_bayes.runs.finished_run import read_finished
from sma_bayes.studies.simulate.figures.course import course_figure
from sma_bayes.studies.simulate.page import page_words
from sma_bayes.studies.simulate.schema import SimulationDocument
from sma_bayes.studies.simulate.tables import simulation_tables


def build_report(folder: Path, wanted: ReportOptions) -> None:
    """Write the report of a simulation; see `sma_bayes.report.choice.ReportBuilder`."""
    stored = read_finished(SIMULATION, SimulationDocument, folder)
    conditions = dict.fromkeys(r.condition for r in stored.found.runs)
    drawings = [partial(course_figure, condition=condition) for condition in conditions]
    assemble(__package__, stored, wanted, drawings, simulation_tables, page_words)
