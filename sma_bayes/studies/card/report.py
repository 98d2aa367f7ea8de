"""The report of a card: its figures, tables and page."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from sma_bayes.report.assembly import assemble
from sma_bayes.report.choice import CAMPAIGN_REPORT_ABOVE, REPORT, ReportOptions
from sma_bayes.report.figures.sheet import Drawing
from sma_bayes.runs.documents import CARD
from sma_bayes.runs.finished_run import read_finished
from sma_bayes.studies.card.figures.card import curves_figure, phase_figure, stiffness_figure, strain_figure
from sma_bayes.studies.card.schema import CardDocument, StoredCard
from sma_bayes.studies.card.tables import card_tables
from sma_bayes.studies.card.terminal import headline


def build_report(folder: Path, wanted: ReportOptions) -> None:
    """Write the report of a card; see `sma_bayes.report.choice.ReportBuilder`."""
    stored = read_finished(CARD, CardDocument, folder)
    drawings: list[Callable[[StoredCard], Drawing]] = []
    if stored.found.constitutive is not None:
        drawings += [phase_figure, strain_figure, curves_figure]
    conditions = list(dict.fromkeys(t.condition for t in stored.found.stiffness))
    if wanted.drawn != REPORT or len(conditions) <= CAMPAIGN_REPORT_ABOVE:
        drawings += [partial(stiffness_figure, condition=c) for c in conditions]
    assemble(__package__, stored, wanted, drawings, card_tables, headline=headline(stored.found))
