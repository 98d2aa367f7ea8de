"""The report of a study of cycles in plain words."""

from __future__ import annotations

from collections.abc import Mapping

from sma_bayes.report.figures.sheet import FigureFiles
from sma_bayes.report.html import write_page
from sma_bayes.report.tables import Table
from sma_bayes.response import DEFAULT_MODEL
from sma_bayes.studies.cycles.outputs import StoredCycles
from sma_bayes.studies.cycles.schema import CyclesDocument


def write_cycles_report(
    stored: StoredCycles, tables: Mapping[str, Table], figures: Mapping[str, FigureFiles]
) -> None:
    """Write ``report.html`` of a study of cycles.

    Parameters
    ----------
    stored : StoredCycles
    tables : mapping of str to Table
    figures : mapping of str to FigureFiles
        By stem; their PNG files are in ``figures/``.

    Raises
    ------
    OutputError
        If it can't be written, or a figure can't be read.
    """
    write_page(
        stored.folder,
        "sma_bayes.studies.cycles",
        figures,
        found=stored.found,
        command=command(stored.found),
        tables=tables,
        stems={part: [s for s in figures if s.startswith(part)] for part in ("curves", "numbers", "values")},
    )


def command(found: CyclesDocument) -> str:
    """The command that gives the same study again."""
    o = found.options
    more = "".join(f' --at "{text}"' for text in o.at)
    more += f" --model {o.model}" if o.model != DEFAULT_MODEL else ""
    fixed = f"--share {o.share:g} --probability {o.probability:g} --ahead {o.ahead}"
    return f'sma-bayes cycles "{found.source}" --out DIR --seed {found.seed} {fixed}{more}'
