"""Reports of the studies that are no fit: gap, comparison of models, conditions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol, TypeVar

from sma_bayes.account import Account
from sma_bayes.progress import Progress
from sma_bayes.report.choice import MANY, REPORT, Drawn, Wanted
from sma_bayes.report.drawn import OneFigure, draw_all
from sma_bayes.report.figures.sheet import Drawing, FigureFiles
from sma_bayes.report.tables import Table, write_tables
from sma_bayes.report.took import account_table
from sma_bayes.report.workbook import write_workbook
from sma_bayes.runs.documents import COMPARISON, GAP
from sma_bayes.studies.compare.figures.averages import model_average_figure
from sma_bayes.studies.compare.figures.models import curves_figure, differences_figure, pages
from sma_bayes.studies.compare.outputs import StoredComparison, read_comparison
from sma_bayes.studies.compare.page import write_comparison_report
from sma_bayes.studies.compare.tables import comparison_tables, model_averages
from sma_bayes.studies.conditions.figures.conditions import (
    effects_figure,
    held_out_figure,
    measured_figure,
    predicted_figure,
)
from sma_bayes.studies.conditions.outputs import StoredConditions, read_conditions
from sma_bayes.studies.conditions.page import write_conditions_report
from sma_bayes.studies.conditions.tables import conditions_tables
from sma_bayes.studies.gap.figures.disagreement import disagreement_loops, residual_maps
from sma_bayes.studies.gap.figures.missing import effect_figure, effect_parameter_figure, ladder_figure
from sma_bayes.studies.gap.outcome import HEATING
from sma_bayes.studies.gap.outputs import StoredStudy, read_study
from sma_bayes.studies.gap.page import write_gap_report
from sma_bayes.studies.gap.tables import gap_tables


def build_study_report(
    folder: Path, wanted: Wanted, jobs: int | None, tell: Progress, spent: Account, *, known: bool
) -> None:
    """Write the report of a gap study, a comparison or a study of conditions.

    Parameters
    ----------
    folder, jobs
        See `build_report`.
    wanted : Wanted
    tell : callable
    spent : Account
        Told what figures and report took.
    known : bool
        Whether it holds what the run took until now; else that is read from its results.
    """
    write = partial(_write, wanted=wanted, jobs=jobs, tell=tell, spent=spent, known=known)
    if GAP.is_in(folder):
        study = read_study(folder)
        write(study, _gap_drawings(study), gap_tables, write_gap_report)
    elif COMPARISON.is_in(folder):
        compared = read_comparison(folder)
        write(
            compared, _comparison_drawings(compared, wanted.drawn), comparison_tables, write_comparison_report
        )
    else:
        conditions = read_conditions(folder)
        write(
            conditions,
            _conditions_drawings(conditions, wanted.drawn),
            conditions_tables,
            write_conditions_report,
        )


class _Stored(Protocol):
    """A finished run of another kind than a fit."""

    @property
    def folder(self) -> Path: ...
    @property
    def found(self) -> Mapping[str, Any]: ...


S = TypeVar("S", bound=_Stored)


def _write(
    stored: S,
    drawings: Sequence[Callable[[S], Drawing]],
    tabled: Callable[[S], dict[str, Table]],
    write: Callable[[S, Mapping[str, Table], Mapping[str, FigureFiles]], None],
    *,
    wanted: Wanted,
    jobs: int | None,
    tell: Progress,
    spent: Account,
    known: bool,
) -> None:
    tasks = [OneFigure(stored.folder, partial(draw, stored)) for draw in drawings]
    figures = draw_all(tasks, wanted.formats, jobs, tell, spent)
    with spent.timed("report"):
        took = account_table(stored.found, spent if known else Account())
        tables = tabled(stored) | {"account": took}
        write_tables(tables, stored.folder / "tables")
        if wanted.workbook:
            write_workbook(tables, stored.folder / "tables" / "results.xlsx")
        write(stored, tables, figures)
    tell(len(tasks) + 1, len(tasks) + 1, "wrote report.html")


def _gap_drawings(study: StoredStudy) -> list[Callable[[StoredStudy], Drawing]]:
    drawings: list[Callable[[StoredStudy], Drawing]] = [disagreement_loops, residual_maps, ladder_figure]
    drawings += [partial(effect_figure, effect=e) for e in study.effects]
    drawings += [effect_parameter_figure] if study.effects else []
    if study.heating is not None:
        drawings += [partial(_of_heating, draw=draw) for draw in _gap_drawings(study.heating)]
    return drawings


def _of_heating(study: StoredStudy, draw: Callable[[StoredStudy], Drawing]) -> Drawing:
    """A figure of the heat balance, by a name of its own."""
    drawn = draw(study.heating or study)
    return replace(drawn, stem=f"{HEATING}-{drawn.stem}", caption=f"Heat balance. {drawn.caption}")


def _comparison_drawings(
    stored: StoredComparison, drawn: Drawn
) -> list[Callable[[StoredComparison], Drawing]]:
    drawings: list[Callable[[StoredComparison], Drawing]] = []
    records = stored.found["records"]
    if drawn == "all" or (drawn == REPORT and len(records) <= MANY):
        drawings += [partial(curves_figure, record=record) for record in records]
    drawings += [partial(differences_figure, number=n + 1) for n in range(pages(stored))]
    return [*drawings, model_average_figure] if model_averages(stored) else drawings


def _conditions_drawings(
    stored: StoredConditions, drawn: Drawn
) -> list[Callable[[StoredConditions], Drawing]]:
    found = stored.found
    drawings: list[Callable[[StoredConditions], Drawing]] = []
    for number, group in enumerate(found["groups"], 1):
        drawings.append(partial(measured_figure, number=number))
        told = {
            e["setting"] for e in found["effects"] if e["conditions"] == group["conditions"] and e["tested"]
        }
        drawings += [partial(effects_figure, number=number, setting=s) for s in group["varied"] if s in told]
    if drawn != "none":
        asked = dict.fromkeys(p["condition"] for p in found["predictions"])
        drawings += [partial(predicted_figure, condition=c) for c in asked]
        left_out = dict.fromkeys(h["condition"] for h in found["held_out"])
        drawings += [partial(held_out_figure, condition=c) for c in left_out]
    return drawings
