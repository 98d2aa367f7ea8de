"""The report of a plan: its figures, tables and page."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from sma_bayes.report.assembly import assemble
from sma_bayes.report.choice import ReportOptions
from sma_bayes.report.figures.sheet import Drawing
from sma_bayes.runs.documents import PLAN
from sma_bayes.runs.finished_run import read_finished
from sma_bayes.studies.plan.figures.plan import candidates_figure, narrowing_figure
from sma_bayes.studies.plan.schema import PlanDocument, StoredPlan
from sma_bayes.studies.plan.shown import in_declared_units
from sma_bayes.studies.plan.tables import plan_tables
from sma_bayes.studies.plan.words import asked_words


def build_report(folder: Path, wanted: ReportOptions) -> None:
    """Write the report of a plan; see `sma_bayes.report.choice.ReportBuilder`."""
    stored = read_finished(PLAN, PlanDocument, folder, in_declared_units)
    drawings: list[Callable[[StoredPlan], Drawing]] = [] if wanted.drawn == "none" else [candidates_figure]
    if drawings and stored.found.kind != "tell-apart":
        drawings.append(narrowing_figure)
    found = stored.found
    more = "" if found.available is None else f" --hours {found.available:g}"
    command = f'sma-bayes plan "{found.source}" --for "{found.asked}" --out DIR --seed {found.seed}{more}'
    assemble(__package__, stored, wanted, drawings, plan_tables, command=command, asked=asked_words(found))
