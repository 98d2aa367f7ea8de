"""The report of a simulation: its figures, and what its page says in words."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from sma_bayes.report.assembly import assemble
from sma_bayes.report.choice import ReportOptions
from sma_bayes.report.notation import unit_label
from sma_bayes.runs.declared_units import shown_product, units_of
from sma_bayes.runs.documents import SIMULATION
from sma_bayes.runs.finished_run import read_finished
from sma_bayes.studies.gap.words import p_text
from sma_bayes.studies.simulate.figures.course import course_figure
from sma_bayes.studies.simulate.schema import ReachDocument, SimulationDocument
from sma_bayes.studies.simulate.tables import simulation_tables
from sma_bayes.studies.simulate.terminal import balance_text, closing, reach_texts, reach_title


def build_report(folder: Path, wanted: ReportOptions) -> None:
    """Write the report of a simulation; see `sma_bayes.report.choice.ReportBuilder`."""
    stored = read_finished(SIMULATION, SimulationDocument, folder)
    conditions = dict.fromkeys(r.condition for r in stored.found.runs)
    drawings = [partial(course_figure, condition=condition) for condition in conditions]
    found = stored.found
    kelvins = shown_product("K", units_of(found))
    assemble(
        __package__,
        stored,
        wanted,
        drawings,
        simulation_tables,
        kelvins={"factor": kelvins.factor, "label": unit_label(kelvins.shown)},
        balance=balance_text(found),
        p_text=p_text,
        reach=None if found.reach is None else _reach(found.reach),
        closing=closing(found),
        slopes=list(dict.fromkeys(f"{r.condition}: {r.caution}" for r in found.runs if r.caution)),
    )


def _reach(reach: ReachDocument) -> dict[str, Any]:
    """What the page says of steady currents: one item for each condition."""
    return {
        "title": reach_title(reach),
        "conditions": [". ".join(texts) + "." for texts in reach_texts(reach)],
    }
