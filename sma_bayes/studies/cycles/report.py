"""The report of a study of cycles: its figures, and what its page says in words."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from sma_bayes.report.assembly import assemble
from sma_bayes.report.choice import CAMPAIGN_REPORT_ABOVE, REPORT, Drawn, ReportOptions
from sma_bayes.report.figures.sheet import Drawing
from sma_bayes.response import DEFAULT_MODEL
from sma_bayes.runs.documents import CYCLES
from sma_bayes.runs.finished_run import read_finished
from sma_bayes.runs.shown import in_declared_units
from sma_bayes.studies.cycles.figures.cycles import curves_figure, numbers_figure, values_figure
from sma_bayes.studies.cycles.schema import CyclesDocument, StoredCycles
from sma_bayes.studies.cycles.tables import cycles_tables


def build_report(folder: Path, wanted: ReportOptions) -> None:
    """Write the report of a study of cycles; see `sma_bayes.report.choice.ReportBuilder`."""
    stored = read_finished(CYCLES, CyclesDocument, folder, in_declared_units)
    assemble(
        __package__,
        stored,
        wanted,
        _drawings(stored, wanted.drawn),
        cycles_tables,
        command=command(stored.found),
    )


def _drawings(stored: StoredCycles, drawn: Drawn) -> list[Callable[[StoredCycles], Drawing]]:
    conditions = stored.found.conditions
    if not (drawn == "all" or (drawn == REPORT and len(conditions) <= CAMPAIGN_REPORT_ABOVE)):
        return []
    makers = (curves_figure, numbers_figure, values_figure)
    return [partial(make, number=n + 1) for n in range(len(conditions)) for make in makers]


def command(found: CyclesDocument) -> str:
    """The command that gives the same study again."""
    o = found.options
    more = "".join(f' --at "{text}"' for text in o.at)
    more += f" --model {o.model}" if o.model != DEFAULT_MODEL else ""
    fixed = f"--share {o.share:g} --probability {o.probability:g} --ahead {o.ahead}"
    return f'sma-bayes cycles "{found.source}" --out DIR --seed {found.seed} {fixed}{more}'
