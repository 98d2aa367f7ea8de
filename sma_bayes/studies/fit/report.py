"""The report of a fit: which figures it has, and all that is written."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from operator import call
from pathlib import Path

from sma_bayes.account import Account
from sma_bayes.arrays import Floats
from sma_bayes.report.assembly import written_tables
from sma_bayes.report.choice import MAX_CONDITIONS_SHOWN, Drawn, ReportOptions
from sma_bayes.report.content import Content, RecordContent
from sma_bayes.report.drawn import FigureTask, draw_all
from sma_bayes.report.figures.sheet import BranchData, Drawing, FigureFiles
from sma_bayes.report.tables import report_tables
from sma_bayes.runs.fit_document import RecordSummary
from sma_bayes.runs.jobs import run
from sma_bayes.runs.outputs import StoredRun, band_of, posterior_of, read_run
from sma_bayes.runs.store import write_text
from sma_bayes.runs.stored_draws import draws_of
from sma_bayes.studies.fit.answer import answer_tables, spread_tables
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
    figures = draw_all(folder, tasks, wanted.formats, wanted.jobs, wanted.tell, spent)
    with spent.timed("report"):
        tables = report_tables(content) | {t.name: t for t in answer_tables(content)}
        if content.paged:
            tables |= {t.name: t for t in spread_tables(content)}
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
        pages = _pages(folder, content, figures)
        written = run(call, pages, wanted.jobs, account=spent, stage="report", light=True)
        for done, _ in enumerate(written, 1):
            wanted.tell(done, len(pages), "writing pages of records")
    wanted.tell(len(tasks) + 1, len(tasks) + 1, "wrote report.html")


def _pages(folder: Path, content: Content, figures: Mapping[str, FigureFiles]) -> list[Callable[[], None]]:
    """What writes the page of each record, in a report of many."""

    def of(r: RecordContent) -> dict[str, FigureFiles]:
        kinds = ("corner", "trace", "predictive", "residuals", "discrepancy")
        stems = (f"loop-{r.condition}", *(f"{kind}-{r.key}" for kind in kinds))
        return {stem: figures[stem] for stem in stems if stem in figures}

    return [partial(write_record_page, folder, content.only(r), r, of(r)) for r in content.records]


Drawings = Iterator[Callable[[], Drawing]]


def _of_record(folder: Path, record: RecordContent) -> Drawings:
    stored = _stored_branch(folder, record)
    branch = _in_shown_units(stored)
    yield partial(corner_figure, branch)
    yield partial(trace_figure, branch)
    yield partial(predictive_figure, branch)
    residuals = standardised_residuals(record, stored.stored, stored.curve)
    yield partial(residual_figure, branch, residuals)


def _of_discrepancy(folder: Path, record: RecordContent, summary: RecordSummary, seed: int) -> Drawings:
    yield partial(discrepancy_figure, record, draws_of(folder, summary, seed))


def _of_self_check(folder: Path, summary: RecordSummary) -> Drawings:
    if summary.self_check is not None:
        yield partial(self_check_figure, folder, summary, summary.self_check)


def _of_condition(folder: Path, condition: str, records: Sequence[RecordContent], like: str) -> Drawings:
    yield partial(loop_figure, condition, [branch_data(folder, r) for r in records], like)


def _of_campaign(folder: Path, content: Content, diagnostics: bool) -> Drawings:
    """Figures of the whole campaign, without `diagnostics` those of the report."""
    many = content.paged
    if many or diagnostics:
        yield partial(diagnostics_of_many if many else diagnostics_figure, content)
        yield partial(correlation_of_many if many else correlation_figure, content)
    several = many or diagnostics or len(content.conditions) > 1
    if content.averages and several and (many or diagnostics or content.printed):
        yield partial(average_figure, content)
    if content.printed:
        yield partial(printed_figure, content)
    branches = _branches(folder, content) if content.truth or not many else {}
    if content.truth:
        yield partial(truth_figure, content.truth, branches)
    for number, part in enumerate(content.by_units(), 1):
        if several:
            yield partial(parameters_of_many if many else parameter_figure, part, number)
        if many:
            continue
        of_part = {condition: branches[condition] for condition in part.conditions}
        for channel in part.channels:
            loops_tell = channel.channel != "stiffness" or not several
            if loops_tell and _by_themselves(content) and not diagnostics:
                continue  # side by side, stiffness alone says more than the loops of the conditions
            yield partial(overview_figure, channel.channel, of_part, number)


def _by_themselves(content: Content) -> bool:
    """Whether the report shows the loop of each condition."""
    return not content.paged and len(content.conditions) <= MAX_CONDITIONS_SHOWN


def _branches(folder: Path, content: Content) -> dict[str, list[BranchData]]:
    return {c: [branch_data(folder, r) for r in content.branches(c)] for c in content.conditions}


def _tasks(stored: StoredRun, content: Content, drawn: Drawn) -> list[FigureTask]:
    if drawn == "none":
        return []
    folder, summaries = stored.folder, {r.key: r for r in stored.summary.records}
    everything = drawn == "all"
    tasks = [FigureTask(partial(_of_campaign, folder, content, everything), "the campaign")]
    if everything or _by_themselves(content):
        first = content.conditions[0]
        tasks += [
            FigureTask(
                partial(
                    _of_condition,
                    folder,
                    c,
                    content.branches(c),
                    "" if content.paged or c == first else first,
                ),
                c,
            )
            for c in content.conditions
        ]
    missed = [r for r in content.records if r.document.discrepancy]
    if not everything:
        worst = sorted(
            missed, key=lambda r: max(m.share for m in r.document.discrepancy.values()), reverse=True
        )
        missed = [] if content.paged else worst[:MAX_CONDITIONS_SHOWN]
    tasks += [
        FigureTask(partial(_of_discrepancy, folder, r, summaries[r.key], stored.summary.seed), r.key)
        for r in missed
    ]
    checked = [r for r in summaries.values() if r.self_check is not None and r.self_check.quantities]
    if not everything:
        worst_first = sorted(checked, key=lambda r: r.self_check is not None and r.self_check.passed)
        checked = [] if content.paged else worst_first[:MAX_CONDITIONS_SHOWN]
    tasks += [FigureTask(partial(_of_self_check, folder, r), r.key) for r in checked]
    if everything:
        tasks += [FigureTask(partial(_of_record, folder, r), r.key) for r in content.records]
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
