"""The report of a fit: which figures it has, and all that is written."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from sma_bayes.account import Account
from sma_bayes.arrays import Floats
from sma_bayes.report.assembly import written_tables
from sma_bayes.report.choice import FEW, Drawn, ReportOptions
from sma_bayes.report.content import Content, RecordContent
from sma_bayes.report.drawn import FigureTask, draw_all
from sma_bayes.report.figures.sheet import BranchData, Drawing, FigureFiles
from sma_bayes.report.tables import report_tables
from sma_bayes.runs.fit_document import RecordSummary
from sma_bayes.runs.jobs import run
from sma_bayes.runs.outputs import StoredRun, band_of, posterior_of, read_run
from sma_bayes.runs.store import write_text
from sma_bayes.runs.stored_draws import draws_of
from sma_bayes.studies.fit.answer import answer_tables
from sma_bayes.studies.fit.figures.averages import average_figure
from sma_bayes.studies.fit.figures.campaign import (
    correlation_figure,
    diagnostics_figure,
    parameter_figure,
    printed_figure,
)
from sma_bayes.studies.fit.figures.condition import loop_figure, overview_figure
from sma_bayes.studies.fit.figures.crowd import correlation_of_many, diagnostics_of_many, parameters_of_many
from sma_bayes.studies.fit.figures.discrepancy import discrepancy_figure
from sma_bayes.studies.fit.figures.marginals import corner_figure
from sma_bayes.studies.fit.figures.record import predictive_figure, residual_figure, trace_figure
from sma_bayes.studies.fit.figures.self_check import self_check_figure
from sma_bayes.studies.fit.figures.truth import truth_figure
from sma_bayes.studies.fit.methods import bibliography, methods_text
from sma_bayes.studies.fit.page import write_record_page, write_report
from sma_bayes.studies.fit.publication import publication_tex, supplement_tex
from sma_bayes.studies.fit.report_content import report_content
from sma_bayes.studies.fit.residuals import median_curves, standardised_residuals
from sma_bayes.studies.fit.self_check_tables import self_check_tables
from sma_bayes.studies.fit.truth import truth_table


def build_report(folder: Path, wanted: ReportOptions) -> None:
    """Write the report of a fit; see `sma_bayes.report.choice.ReportBuilder`."""
    spent = wanted.account or Account()
    with spent.timed("report"):
        stored = read_run(folder)
        content = report_content(stored)
    tasks = _tasks(stored, content, wanted.drawn)
    figures = draw_all(tasks, wanted.formats, wanted.jobs, wanted.tell, spent)
    with spent.timed("report"):
        tables = report_tables(content) | {t.name: t for t in answer_tables(content)}
        tables |= self_check_tables(stored.summary)
        if content.truth:
            tables["truth"] = truth_table(content)
        tables = written_tables(tables, stored.summary, folder, wanted)
        write_text(folder / "methods.md", methods_text(content))
        write_text(folder / "tables" / "publication.tex", publication_tex(content))
        write_text(
            folder / "tables" / "supplement.tex", supplement_tex([n for n, t in tables.items() if t.rows])
        )
        write_text(folder / "references.bib", bibliography(content))
        write_report(folder, content, tables, figures)
    if content.paged:
        pages = _page_tasks(folder, content, figures)
        written = run(_write_page, pages, wanted.jobs, account=spent, stage="report", light=True)
        for done, _ in enumerate(written, 1):
            wanted.tell(done, len(pages), "writing pages of records")
    wanted.tell(len(tasks) + 1, len(tasks) + 1, "wrote report.html")


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
        stored = _stored_branch(self.folder, self.record)
        branch = _in_shown_units(stored)
        yield partial(corner_figure, branch)
        yield partial(trace_figure, branch)
        yield partial(predictive_figure, branch)
        residuals = standardised_residuals(self.record, stored.stored, stored.curve)
        yield partial(residual_figure, branch, residuals)


@dataclass(frozen=True, slots=True)
class _DiscrepancyTask:
    """Figure of what the curve of one record misses."""

    folder: Path
    record: RecordContent
    summary: RecordSummary
    seed: int

    @property
    def title(self) -> str:
        return self.record.key

    def drawings(self) -> Iterator[Callable[[], Drawing]]:
        yield partial(discrepancy_figure, self.record, draws_of(self.folder, self.summary, self.seed))


@dataclass(frozen=True, slots=True)
class _SelfCheckTask:
    """Figure of the self-check of one record."""

    folder: Path
    summary: RecordSummary

    @property
    def title(self) -> str:
        return self.summary.key

    def drawings(self) -> Iterator[Callable[[], Drawing]]:
        if self.summary.self_check is not None:
            yield partial(self_check_figure, self.folder, self.summary, self.summary.self_check)


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
        yield partial(loop_figure, self.condition, [branch_data(self.folder, r) for r in self.records])


@dataclass(frozen=True, slots=True)
class _CampaignTask:
    """Figures of the whole campaign, without `diagnostics` those of the report."""

    folder: Path
    content: Content
    diagnostics: bool
    title: str = "the campaign"

    def drawings(self) -> Iterator[Callable[[], Drawing]]:
        many = self.content.paged
        if many or self.diagnostics:
            yield partial(diagnostics_of_many if many else diagnostics_figure, self.content)
            yield partial(correlation_of_many if many else correlation_figure, self.content)
        several = many or self.diagnostics or len(self.content.conditions) > 1
        if self.content.averages and several:
            yield partial(average_figure, self.content)
        if self.content.printed:
            yield partial(printed_figure, self.content)
        if self.content.truth:
            yield partial(
                truth_figure,
                self.content.truth,
                {
                    c: [branch_data(self.folder, r) for r in self.content.branches(c)]
                    for c in self.content.conditions
                },
            )
        for number, part in enumerate(self.content.by_units(), 1):
            if several:
                yield partial(parameters_of_many if many else parameter_figure, part, number)
            if many:
                continue
            branches = {c: [branch_data(self.folder, r) for r in part.branches(c)] for c in part.conditions}
            for channel in part.channels:
                if not several and channel.channel != "stiffness":
                    continue  # the loop of the only condition shows it
                yield partial(overview_figure, channel.channel, branches, number)


def _tasks(stored: StoredRun, content: Content, drawn: Drawn) -> list[FigureTask]:
    if drawn == "none":
        return []
    folder, summaries = stored.folder, {r.key: r for r in stored.summary.records}
    everything = drawn == "all"
    tasks: list[FigureTask] = [_CampaignTask(folder, content, everything)]
    if everything or (not content.paged and len(content.conditions) <= FEW):
        tasks += [_ConditionTask(folder, c, content.branches(c)) for c in content.conditions]
    missed = [r for r in content.records if r.document.discrepancy]
    if not everything:
        worst = sorted(
            missed, key=lambda r: max(m.share for m in r.document.discrepancy.values()), reverse=True
        )
        missed = [] if content.paged else worst[:FEW]
    tasks += [_DiscrepancyTask(folder, r, summaries[r.key], stored.summary.seed) for r in missed]
    checked = [r for r in summaries.values() if r.self_check is not None and r.self_check.quantities]
    if not everything:
        worst_first = sorted(checked, key=lambda r: r.self_check is not None and r.self_check.passed)
        checked = [] if content.paged else worst_first[:FEW]
    tasks += [_SelfCheckTask(folder, r) for r in checked]
    if everything:
        tasks += [_RecordTask(folder, r) for r in content.records]
    return tasks


def branch_data(folder: Path, record: RecordContent) -> BranchData:
    """What there is to draw of a record of a finished fit, in the units in which people see it."""
    return _in_shown_units(_stored_branch(folder, record))


def _in_shown_units(branch: BranchData) -> BranchData:
    """What is drawn of a record, from the units in which it is stored to those in which people see it."""
    record, stored = branch.content, branch.stored
    channels = {c.channel: c.scale for c in record.channels}
    parameters = {p.name: p.shown for p in record.parameters}
    degrees = record.degrees
    if all(u.shown == u.stored for u in (degrees, *parameters.values())) and set(channels.values()) <= {1.0}:
        return branch

    def scaled(values: Mapping[str, Floats], by: Mapping[str, float]) -> dict[str, Floats]:
        return {name: by.get(name, 1.0) * v for name, v in values.items()}

    return replace(
        branch,
        stored=replace(
            stored,
            inputs={n: degrees.values(v) if n == "temperature" else v for n, v in stored.inputs.items()},
            observed=scaled(stored.observed, channels),
            draws={n: parameters[n].values(v) if n in parameters else v for n, v in stored.draws.items()},
            prior_temperature=degrees.values(stored.prior_temperature),
            prior_curves=scaled(stored.prior_curves, channels),
        ),
        bands={
            c: replace(
                band,
                temperature=degrees.values(band.temperature),
                quantiles={n: channels[c] * q for n, q in band.quantiles.items()},
            )
            for c, band in branch.bands.items()
        },
        curve=scaled(branch.curve, channels),
    )


def _stored_branch(folder: Path, record: RecordContent) -> BranchData:
    stored = posterior_of(folder, record.key, record.document.posterior_sha256)
    bands = {
        c.channel: band_of(folder, record.key, c.channel, record.document.band_sha256.get(c.channel))
        for c in record.channels
    }
    return BranchData(record, stored, bands, median_curves(stored))
