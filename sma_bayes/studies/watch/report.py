"""The report of a watch: its figures, and what its page says in words."""

from __future__ import annotations

from pathlib import Path

from sma_bayes.report.assembly import assemble
from sma_bayes.report.choice import ReportOptions
from sma_bayes.runs.documents import WATCH
from sma_bayes.runs.finished_run import read_finished
from sma_bayes.runs.shown import in_declared_units
from sma_bayes.studies.watch.figures.watched import evidence_figure, numbers_figure
from sma_bayes.studies.watch.remaining import NOT_YET
from sma_bayes.studies.watch.schema import WatchDocument
from sma_bayes.studies.watch.tables import watch_tables


def build_report(folder: Path, wanted: ReportOptions) -> None:
    """Write the report of a watch; see `sma_bayes.report.choice.ReportBuilder`."""
    stored = read_finished(WATCH, WatchDocument, folder, in_declared_units)
    drawings = [evidence_figure, numbers_figure] if wanted.drawn != "none" and stored.found.cycles else []
    assemble(
        __package__, stored, wanted, drawings, watch_tables, command=command(stored.found), not_yet=NOT_YET
    )


def command(found: WatchDocument) -> str:
    """The command that counts further cycles."""
    limits = "".join(f' --limit "{text}"' for text in found.asked)
    fixed = f"--out DIR --condition {found.condition} --alpha {found.alpha:g} --seed {found.seed}"
    campaign = f' --campaign "{found.declared_in}"' if found.declared_in else ""
    return f'sma-bayes watch "{found.fit}" NEW.csv {fixed}{campaign}{limits}'
