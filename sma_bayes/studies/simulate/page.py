"""The page of a simulation."""

from __future__ import annotations

from collections.abc import Mapping

from sma_bayes.report.figures.sheet import FigureFiles
from sma_bayes.report.html import write_page
from sma_bayes.report.notation import unit_label
from sma_bayes.report.tables import Table
from sma_bayes.runs.declared_units import shown_product, units_of
from sma_bayes.studies.simulate.outputs import StoredSimulation
from sma_bayes.studies.simulate.terminal import balance_text, closing, reach_lines


def write_simulation_report(
    stored: StoredSimulation, tables: Mapping[str, Table], figures: Mapping[str, FigureFiles]
) -> None:
    """Write ``report.html`` of a simulation.

    Parameters
    ----------
    stored : StoredSimulation
    tables : mapping of str to Table
    figures : mapping of str to FigureFiles
        By stem; their PNG files are in ``figures/``.

    Raises
    ------
    OutputError
        If it can't be written, or a figure can't be read.
    """
    found = stored.found
    kelvins = shown_product("K", units_of(found))
    write_page(
        stored.folder,
        "sma_bayes.studies.simulate",
        figures,
        found=found,
        tables=tables,
        kelvins={"factor": kelvins.factor, "label": unit_label(kelvins.shown)},
        balance=balance_text(found),
        reach=[] if found.reach is None else [line.strip() for line in reach_lines(found.reach)],
        closing=closing(found),
        slopes=list(dict.fromkeys(f"{r.condition}: {r.caution}" for r in found.runs if r.caution)),
    )
