"""Build figures, tables and the report of a finished run from what its output folder holds."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol, TypeVar

from sma_bayes.account import Account
from sma_bayes.errors import OutputError
from sma_bayes.inference.jobs import run
from sma_bayes.progress import Progress, silent
from sma_bayes.report.choice import Drawn, figures_for
from sma_bayes.report.comparison_outputs import StoredComparison, read_comparison
from sma_bayes.report.comparison_page import write_comparison_report
from sma_bayes.report.comparison_tables import comparison_tables, model_averages
from sma_bayes.report.conditions_outputs import StoredConditions, read_conditions
from sma_bayes.report.conditions_page import write_conditions_report
from sma_bayes.report.conditions_tables import conditions_tables
from sma_bayes.report.content import Content, RecordContent
from sma_bayes.report.figures import (
    BranchData,
    Drawing,
    FigureFiles,
    average_figure,
    corner_figure,
    correlation_figure,
    correlation_of_many,
    curves_figure,
    diagnostics_figure,
    diagnostics_of_many,
    differences_figure,
    disagreement_loops,
    discrepancy_figure,
    effect_figure,
    effect_parameter_figure,
    effects_figure,
    held_out_figure,
    ladder_figure,
    loop_figure,
    measured_figure,
    model_average_figure,
    overview_figure,
    pages,
    parameter_figure,
    parameters_of_many,
    predicted_figure,
    predictive_figure,
    printed_figure,
    residual_figure,
    residual_maps,
    save,
    trace_figure,
)
from sma_bayes.report.fit_page import write_record_page, write_report
from sma_bayes.report.gap_outputs import StoredStudy, read_study
from sma_bayes.report.gap_page import write_gap_report
from sma_bayes.report.gap_tables import gap_tables
from sma_bayes.report.gather import report_content
from sma_bayes.report.outputs import band_path, posterior_path, read_band, read_record, read_run
from sma_bayes.report.residuals import median_curves, standardised_residuals
from sma_bayes.report.stored_draws import draws_of
from sma_bayes.report.tables import Table, report_tables, write_tables
from sma_bayes.report.took import account_table
from sma_bayes.results.documents import COMPARISON, CONDITIONS, FIT, GAP, MARK
from sma_bayes.results.store import nothing_unfinished


def build_report(
    folder: Path,
    *,
    figures: str | bool = "auto",
    jobs: int | None = None,
    progress: Progress | None = None,
    account: Account | None = None,
) -> None:
    """Write ``figures/``, ``tables/`` and ``report.html`` of a run.

    Parameters
    ----------
    folder : Path
        Output folder of a finished `fit`, `gap`, `compare` or `conditions`. Nothing but the three outputs is changed.
    figures : str or bool
        ``all``, ``campaign`` or ``auto``, see `figures_for`; with ``none`` the report goes without.
    jobs : int, optional
        Processes that draw figures; by default one for each core.
    progress : callable, optional
    account : Account, optional
        Told how long figures and report took.

    Raises
    ------
    OutputError
        If the folder holds no run, an unfinished one, or can't be written.
    """
    folder = Path(folder).absolute()
    with nothing_unfinished(folder):
        _build(folder, figures, jobs, progress or silent, account)


def _build(
    folder: Path, figures: str | bool, jobs: int | None, tell: Progress, account: Account | None
) -> None:
    if GAP.is_in(folder):
        study = read_study(folder)
        _build_report(study, _gap_drawings(study), gap_tables, write_gap_report, jobs, tell, account)
    elif COMPARISON.is_in(folder):
        compared = read_comparison(folder)
        drawings = _comparison_drawings(compared, figures)
        _build_report(compared, drawings, comparison_tables, write_comparison_report, jobs, tell, account)
    elif CONDITIONS.is_in(folder):
        conditions = read_conditions(folder)
        drawn = _conditions_drawings(conditions, figures)
        _build_report(conditions, drawn, conditions_tables, write_conditions_report, jobs, tell, account)
    else:
        _build_fit_report(folder, figures, jobs, tell, account)


def _build_fit_report(
    folder: Path, figures: str | bool, jobs: int | None, tell: Progress, account: Account | None
) -> None:
    if not any((folder / name).is_file() for name in (FIT.file, MARK)):
        raise OutputError(
            "holds no run of sma_bayes" if folder.is_dir() else "is not a folder",
            file=folder,
            expected="a folder with summary.json, gap.json, comparison.json or conditions.json: what fit, gap, compare "
            "and conditions write",
            remedy="name the folder that was given as --out; of a study one of its folders",
        )
    spent = account or Account()
    with spent.timed("report"):
        stored = read_run(folder)
        content = report_content(stored)
    tasks = _tasks(folder, content, figures_for(figures, len(content.records)))
    pictures = _drawn(tasks, jobs, tell, spent)
    with spent.timed("report"):
        tables = report_tables(content) | _took(stored.summary, account)
        write_tables(tables, folder / "tables")
        write_report(folder, content, tables, pictures)
    if content.paged:
        pages = _page_tasks(folder, content, pictures)
        for done, _ in enumerate(run(_write_page, pages, jobs, account=spent, stage="report"), 1):
            tell(done, len(pages), "writing pages of records")
    tell(len(tasks) + 1, len(tasks) + 1, "wrote report.html")


def _drawn(
    tasks: Sequence[_Task], jobs: int | None, tell: Progress, account: Account
) -> dict[str, FigureFiles]:
    """Draw the figures of all tasks; by stem."""
    total = len(tasks) + 1  # the report itself comes last
    tell(0, total, "drawing figures")
    figures: dict[str, FigureFiles] = {}
    for done, files in enumerate(run(_draw, tasks, jobs, account=account, stage="figures"), 1):
        figures |= {f.stem: f for f in files}
        tell(done, total, f"drew {tasks[done - 1].title or files[0].stem}")
    return figures


def _took(found: Mapping[str, Any], account: Account | None) -> dict[str, Table]:
    """What the run took: as stored, or as known by now where the report is part of the run."""
    return {"account": account_table(found, account or Account())}


class _Stored(Protocol):
    """A finished run of another kind than a fit."""

    @property
    def folder(self) -> Path: ...
    @property
    def found(self) -> Mapping[str, Any]: ...


S = TypeVar("S", bound=_Stored)


def _build_report(
    stored: S,
    drawings: Sequence[Callable[[S], Drawing]],
    tabled: Callable[[S], dict[str, Table]],
    write: Callable[[S, Mapping[str, Table], Mapping[str, FigureFiles]], None],
    jobs: int | None,
    tell: Progress,
    account: Account | None,
) -> None:
    spent = account or Account()
    tasks = [_FigureTask(stored.folder, partial(draw, stored)) for draw in drawings]
    figures = _drawn(tasks, jobs, tell, spent)
    with spent.timed("report"):
        tables = tabled(stored) | _took(stored.found, account)
        write_tables(tables, stored.folder / "tables")
        write(stored, tables, figures)
    tell(len(tasks) + 1, len(tasks) + 1, "wrote report.html")


def _gap_drawings(study: StoredStudy) -> list[Callable[[StoredStudy], Drawing]]:
    drawings: list[Callable[[StoredStudy], Drawing]] = [disagreement_loops, residual_maps, ladder_figure]
    drawings += [partial(effect_figure, effect=e) for e in study.effects]
    return [*drawings, effect_parameter_figure] if study.effects else drawings


def _comparison_drawings(
    stored: StoredComparison, choice: str | bool
) -> list[Callable[[StoredComparison], Drawing]]:
    drawings: list[Callable[[StoredComparison], Drawing]] = []
    if figures_for(choice, len(stored.found["records"])) == "all":
        drawings += [partial(curves_figure, record=record) for record in stored.found["records"]]
    drawings += [partial(differences_figure, number=n + 1) for n in range(pages(stored))]
    return [*drawings, model_average_figure] if model_averages(stored) else drawings


def _conditions_drawings(
    stored: StoredConditions, choice: str | bool
) -> list[Callable[[StoredConditions], Drawing]]:
    found = stored.found
    drawings: list[Callable[[StoredConditions], Drawing]] = []
    for number, group in enumerate(found["groups"], 1):
        drawings.append(partial(measured_figure, number=number))
        told = {
            e["setting"] for e in found["effects"] if e["conditions"] == group["conditions"] and e["tested"]
        }
        drawings += [partial(effects_figure, number=number, setting=s) for s in group["varied"] if s in told]
    if figures_for(choice, len(found["features"])) != "none":
        asked = dict.fromkeys(p["condition"] for p in found["predictions"])
        drawings += [partial(predicted_figure, condition=c) for c in asked]
        left_out = dict.fromkeys(h["condition"] for h in found["held_out"])
        drawings += [partial(held_out_figure, condition=c) for c in left_out]
    return drawings


@dataclass(frozen=True, slots=True)
class _PageTask:
    """The page of a record, in a report of many."""

    folder: Path
    content: Content
    record: RecordContent
    figures: Mapping[str, FigureFiles]


def _write_page(task: _PageTask) -> None:
    write_record_page(task.folder, task.content, task.record, task.figures)


def _page_tasks(folder: Path, content: Content, figures: Mapping[str, FigureFiles]) -> list[_PageTask]:
    def of(r: RecordContent) -> dict[str, FigureFiles]:
        kinds = ("corner", "trace", "predictive", "residuals", "discrepancy")
        stems = (f"loop-{r.condition}", *(f"{kind}-{r.key}" for kind in kinds))
        return {stem: figures[stem] for stem in stems if stem in figures}

    return [_PageTask(folder, content.only(r), r, of(r)) for r in content.records]


@dataclass(frozen=True, slots=True)
class _RecordTask:
    """Figures of one record."""

    folder: Path
    record: RecordContent

    @property
    def title(self) -> str:
        return self.record.key

    def drawings(self) -> Iterator[Callable[[], Drawing]]:
        branch = _branch_data(self.folder, self.record)
        yield partial(corner_figure, branch)
        yield partial(trace_figure, branch)
        yield partial(predictive_figure, branch)
        residuals = standardised_residuals(self.record, branch.stored, branch.curve)
        yield partial(residual_figure, branch, residuals)
        if self.record.missed:
            stored = read_run(self.folder)
            summary = next(r for r in stored.summary["records"] if r["key"] == self.record.key)
            yield partial(discrepancy_figure, self.record, draws_of(stored, summary))


@dataclass(frozen=True, slots=True)
class _ConditionTask:
    """Figure of the loop of one condition."""

    folder: Path
    condition: str
    records: tuple[RecordContent, ...]

    @property
    def title(self) -> str:
        return self.condition

    def drawings(self) -> Iterator[Callable[[], Drawing]]:
        yield partial(loop_figure, self.condition, [_branch_data(self.folder, r) for r in self.records])


@dataclass(frozen=True, slots=True)
class _CampaignTask:
    """Figures of the whole campaign."""

    folder: Path
    content: Content
    title: str = "the campaign"

    def drawings(self) -> Iterator[Callable[[], Drawing]]:
        many = self.content.paged
        yield partial(diagnostics_of_many if many else diagnostics_figure, self.content)
        yield partial(correlation_of_many if many else correlation_figure, self.content)
        if self.content.averages:
            yield partial(average_figure, self.content)
        if self.content.printed:
            yield partial(printed_figure, self.content)
        for number, part in enumerate(self.content.by_units(), 1):
            yield partial(parameters_of_many if many else parameter_figure, part, number)
            if many:
                continue
            branches = {c: [_branch_data(self.folder, r) for r in part.branches(c)] for c in part.conditions}
            for channel in part.channels:
                yield partial(overview_figure, channel.channel, branches, number)


@dataclass(frozen=True, slots=True)
class _FigureTask:
    """One figure of a run of another kind than a fit."""

    folder: Path
    draw: Callable[[], Drawing]
    title: str = ""

    def drawings(self) -> Iterator[Callable[[], Drawing]]:
        yield self.draw


_Task = _RecordTask | _ConditionTask | _CampaignTask | _FigureTask


def _tasks(folder: Path, content: Content, drawn: Drawn) -> list[_Task]:
    tasks: list[_Task] = []
    if drawn == "all":
        tasks += [_RecordTask(folder, r) for r in content.records]
        tasks += [_ConditionTask(folder, c, content.branches(c)) for c in content.conditions]
    if drawn != "none":
        tasks.append(_CampaignTask(folder, content))
    return tasks


def _draw(task: _Task) -> list[FigureFiles]:
    return [save(draw, task.folder / "figures") for draw in task.drawings()]


def _branch_data(folder: Path, record: RecordContent) -> BranchData:
    stored = read_record(posterior_path(folder, record.key))
    bands = {c.channel: read_band(band_path(folder, record.key, c.channel)) for c in record.channels}
    return BranchData(record, stored, bands, median_curves(stored))
