"""The page of a simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from sma_bayes.report.notation import unit_label
from sma_bayes.report.tables import Table
from sma_bayes.runs.declared_units import shown_product, units_of
from sma_bayes.studies.simulate.schema import StoredSimulation
from sma_bayes.studies.simulate.terminal import balance_text, closing, reach_lines


def page_words(
    stored: StoredSimulation, tables: Mapping[str, Table], figures: Sequence[str]
) -> dict[str, Any]:
    """What the page of a simulation names, besides what was found and its tables; `figures` are stems."""
    found = stored.found
    kelvins = shown_product("K", units_of(found))
    return {
        "kelvins": {"factor": kelvins.factor, "label": unit_label(kelvins.shown)},
        "balance": balance_text(found),
        "reach": [] if found.reach is None else [line.strip() for line in reach_lines(found.reach)],
        "closing": closing(found),
        "slopes": list(dict.fromkeys(f"{r.condition}: {r.caution}" for r in found.runs if r.caution)),
    }
