"""The report of a gap study: which figures it has."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from sma_bayes.report.assembly import assemble
from sma_bayes.report.choice import ReportOptions
from sma_bayes.report.figures.sheet import Drawing
from sma_bayes.studies.gap.figures.disagreement import disagreement_loops, residual_maps
from sma_bayes.studies.gap.figures.missing import effect_figure, effect_parameter_figure, ladder_figure
from sma_bayes.studies.gap.outcome import HEATING
from sma_bayes.studies.gap.outputs import StoredStudy, read_study
from sma_bayes.studies.gap.page import page_words
from sma_bayes.studies.gap.shown import study_in_declared_units
from sma_bayes.studies.gap.tables import gap_tables


def build_report(folder: Path, wanted: ReportOptions) -> None:
    """Write the report of a gap study; see `sma_bayes.report.choice.ReportBuilder`."""
    study = study_in_declared_units(read_study(folder))
    assemble(__package__, study, wanted, _drawings(study), gap_tables, page_words)


def _drawings(study: StoredStudy) -> list[Callable[[StoredStudy], Drawing]]:
    drawings: list[Callable[[StoredStudy], Drawing]] = [disagreement_loops, residual_maps, ladder_figure]
    drawings += [partial(effect_figure, effect=e) for e in study.effects]
    drawings += [effect_parameter_figure] if study.effects else []
    if study.heating is not None:
        drawings += [partial(_of_heating, draw=draw) for draw in _drawings(study.heating)]
    return drawings


def _of_heating(study: StoredStudy, draw: Callable[[StoredStudy], Drawing]) -> Drawing:
    """A figure of the heat balance, by a name of its own."""
    drawn = draw(study.heating or study)
    return replace(drawn, stem=f"{HEATING}-{drawn.stem}", caption=f"Heat balance. {drawn.caption}")
