"""Every candidate of a plan: as `plan.json` states it, and as a row of `candidates.csv`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from sma_bayes.runs.store import or_nan, write_csv
from sma_bayes.studies.plan.candidates import CandidateExperiment
from sma_bayes.studies.plan.schema import ExpectedQuantity, PlanFindings, PlannedCandidate, TellingApart
from sma_bayes.studies.plan.shown import in_declared_units
from sma_bayes.studies.plan.words import advice, pair_name, quantity_name

CANDIDATES: Final = "candidates.csv"
SETTINGS: Final = (
    "rank", "name", "condition", "lowest", "peak", "rate", "load", "cycles", "samples", "setup", "hours",
)  # fmt: skip


def planned(
    rank: int,
    c: CandidateExperiment,
    available: float | None,
    *,
    branches: Sequence[str],
    other_load: bool = False,
    nats: float | None = None,
    probability: float | None = None,
    expected: Sequence[ExpectedQuantity] = (),
    pairs: Sequence[TellingApart] = (),
) -> PlannedCandidate:
    """A candidate with what is expected of it.

    Parameters
    ----------
    rank : int
    c : CandidateExperiment
    available : float or None
        Time that there is on the rig [h].
    branches, other_load, nats, probability, expected, pairs
        See `PlannedCandidate`.
    """
    return PlannedCandidate.about(
        c,
        rank=rank,
        other_load=other_load,
        branches=tuple(branches),
        fits=available is None or c.hours <= available * (1.0 + 1e-9),
        nats=nats,
        nats_per_hour=None if nats is None else nats / c.hours,
        probability=probability,
        expected=tuple(expected),
        pairs=tuple(pairs),
    )


def with_advice(found: PlanFindings, folder: Path | None) -> PlanFindings:
    """What `plan.json` holds, advice included; the candidates are written to the folder, if there is one."""
    found = found.but(advice=advice(in_declared_units(found)))
    if folder is not None:
        write_csv(folder / CANDIDATES, columns(found))
    return found


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
