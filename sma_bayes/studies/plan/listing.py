"""`candidates.csv`: every candidate of a plan, a row each."""

from __future__ import annotations

import math
from typing import Any, Final

from sma_bayes.runs.store import or_nan
from sma_bayes.studies.plan.schema import PlanFindings
from sma_bayes.studies.plan.words import pair_name, quantity_name

CANDIDATES: Final = "candidates.csv"
SETTINGS: Final = (
    "rank", "name", "condition", "lowest", "peak", "rate", "load", "cycles", "samples", "setup", "hours",
)  # fmt: skip


def columns(found: PlanFindings) -> dict[str, list[Any]]:
    """Columns of `candidates.csv`: settings, what is expected, and of each quantity the expected standard deviation."""
    c = found.candidates
    out: dict[str, list[Any]] = {n: [getattr(x, n) for x in c] for n in SETTINGS}
    out["load"] = [or_nan(x) for x in out["load"]]
    out["branches"] = [" ".join(x.branches) for x in c]
    out["beyond"] = ["; ".join(x.beyond) for x in c]
    out["fits"] = [x.fits for x in c]
    for name in ("nats", "nats_per_hour", "probability"):
        out[name] = [or_nan(getattr(x, name)) for x in c]
    for known in found.quantities:
        told = [
            next((e.sd for e in x.expected if (e.key, e.name) == (known.key, known.name)), math.nan)
            for x in c
        ]
        out[f"sd of {quantity_name(known, found)} [{known.unit}]"] = told
    for number, pair in enumerate(found.rivals):
        out[pair_name(pair)] = [x.pairs[number].probability for x in c]
    return out
