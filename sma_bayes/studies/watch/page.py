"""The report of a watch in plain words."""

from __future__ import annotations

from collections.abc import Mapping

from sma_bayes.report.figures.sheet import FigureFiles
from sma_bayes.report.html import write_page
from sma_bayes.report.tables import Table
from sma_bayes.studies.watch.outputs import StoredWatch
from sma_bayes.studies.watch.schema import WatchDocument


def write_watch_report(
    stored: StoredWatch, tables: Mapping[str, Table], figures: Mapping[str, FigureFiles]
) -> None:
    """Write ``report.html`` of a watch.

    Raises
    ------
    OutputError
        If it can't be written, or a figure can't be read.
    """
    write_page(
        stored.folder,
        "sma_bayes.studies.watch",
        figures,
        found=stored.found,
        command=command(stored.found),
        tables=tables,
    )


def command(found: WatchDocument) -> str:
    """The command that counts further cycles."""
    limits = "".join(f' --limit "{text}"' for text in dict.fromkeys(r.limit for r in found.limits))
    fixed = f"--out DIR --condition {found.condition} --alpha {found.alpha:g} --seed {found.seed}"
    return f'sma-bayes watch "{found.fit}" NEW.csv {fixed}{limits}'
