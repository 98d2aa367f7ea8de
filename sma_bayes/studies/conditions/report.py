"""The report of a study of conditions: which figures it has."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from sma_bayes.report.assembly import assemble
from sma_bayes.report.choice import Drawn, ReportOptions
from sma_bayes.report.figures.sheet import Drawing
from sma_bayes.runs.documents import CONDITIONS
from sma_bayes.runs.finished_run import read_finished
from sma_bayes.studies.conditions.figures.conditions import (
    effects_figure,
    held_out_figure,
    measured_figure,
    predicted_figure,
)
from sma_bayes.studies.conditions.page import page_words
from sma_bayes.studies.conditions.schema import ConditionsDocument, StoredConditions
from sma_bayes.studies.conditions.shown import in_declared_units
from sma_bayes.studies.conditions.tables import conditions_tables


def build_report(folder: Path, wanted: ReportOptions) -> None:
    """Write the report of a study of conditions; see `sma_bayes.report.choice.ReportBuilder`."""
    stored = read_finished(CONDITIONS, ConditionsDocument, folder, in_declared_units)
    assemble(__package__, stored, wanted, _drawings(stored, wanted.drawn), conditions_tables, page_words)


def _drawings(stored: StoredConditions, drawn: Drawn) -> list[Callable[[StoredConditions], Drawing]]:
    found = stored.found
    drawings: list[Callable[[StoredConditions], Drawing]] = []
    for number, group in enumerate(found.groups, 1):
        drawings.append(partial(measured_figure, number=number))
        told = {e.setting for e in found.effects if e.conditions == group.conditions and e.tested}
        drawings += [partial(effects_figure, number=number, setting=s) for s in group.varied if s in told]
    if drawn != "none":
        asked = dict.fromkeys(p.condition for p in found.predictions)
        drawings += [partial(predicted_figure, condition=c) for c in asked]
        left_out = dict.fromkeys(h.condition for h in found.held_out)
        drawings += [partial(held_out_figure, condition=c) for c in left_out]
    return drawings
