"""The report of a comparison of models: its figures, and what its page says in words."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from sma_bayes.report.assembly import assemble
from sma_bayes.report.choice import CAMPAIGN_REPORT_ABOVE, REPORT, Drawn, ReportOptions
from sma_bayes.report.content import PAPER_CORRELATION
from sma_bayes.report.figures.sheet import Drawing
from sma_bayes.response import DEFAULT_MODEL
from sma_bayes.runs.documents import COMPARISON
from sma_bayes.runs.finished_run import read_finished
from sma_bayes.runs.shown import in_declared_units
from sma_bayes.studies.compare.figures.averages import model_average_figure
from sma_bayes.studies.compare.figures.models import curves_figure, differences_figure, pages
from sma_bayes.studies.compare.schema import ComparisonDocument, Overall, StoredComparison
from sma_bayes.studies.compare.tables import comparison_tables, model_averages
from sma_bayes.studies.compare.verdict import CANNOT_TELL
from sma_bayes.studies.compare.words import spoken


def build_report(folder: Path, wanted: ReportOptions) -> None:
    """Write the report of a comparison; see `sma_bayes.report.choice.ReportBuilder`."""
    stored = read_finished(COMPARISON, ComparisonDocument, folder, in_declared_units)
    assemble(
        __package__,
        stored,
        wanted,
        _drawings(stored, wanted.drawn),
        comparison_tables,
        headlines=[headline(group) for group in stored.found.overall],
        command=command(stored.found),
        paper_correlation=PAPER_CORRELATION,
        spoken=spoken,
    )


def _drawings(stored: StoredComparison, drawn: Drawn) -> list[Callable[[StoredComparison], Drawing]]:
    drawings: list[Callable[[StoredComparison], Drawing]] = []
    records = stored.found.records
    if drawn == "all" or (drawn == REPORT and len(records) <= CAMPAIGN_REPORT_ABOVE):
        drawings += [partial(curves_figure, record=record) for record in records]
    drawings += [partial(differences_figure, number=n + 1) for n in range(pages(stored))]
    return [*drawings, model_average_figure] if model_averages(stored) else drawings


def headline(group: Overall) -> str:
    """The verdict over all records of a channel, as a sentence."""
    counts = ", ".join(f"{n} {spoken(name)}" for name, n in group.verdicts.items())
    if group.verdict == CANNOT_TELL:
        outcome = f"the data do not tell: {group.why}"
    else:
        outcome = f"the {spoken(group.verdict)} wins ({spoken(group.preferred)}): {group.why}"
    count = len(group.records)
    together = f"{count} records together" if count > 1 else "one record"
    return f"{group.quantity}, {together}: {outcome}. Record by record: {counts}."


def command(found: ComparisonDocument) -> str:
    """The command that gives the same comparison again."""
    options = found.options
    more = "".join(
        f" --{name} {value}"
        for name, value, usual in (
            ("model", options.model, DEFAULT_MODEL),
            ("noise", options.noise, "auto"),
            ("pool", options.pool, "none"),
        )
        if value != usual
    )
    return f'sma-bayes compare "{found.source}" --out DIR --seed {found.seed} --priors priors.toml{more}'
