"""A plan on the screen: the best candidates in a table, and one sentence of advice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from rich.table import Table

from sma_bayes.quantities import unit_text
from sma_bayes.report.notation import write
from sma_bayes.report.screen import NOT_CONVERGED, numbers, screen, show_end, titled
from sma_bayes.studies.plan.schema import PlanFindings, PlannedCandidate
from sma_bayes.studies.plan.shown import in_declared_units
from sma_bayes.studies.plan.words import (
    HALF_WIDTH_90,
    asked_words,
    half_width,
    known_of,
    other_load,
    pair_name,
    quantity_name,
    rate_unit,
)

CANDIDATES_SHOWN: Final = 8
"""Candidates on the screen; the report and `candidates.csv` have all of them."""


def show_plan(told: Mapping[str, Any], out: Path | None) -> None:
    """What `plan.json` says, for a terminal."""
    found = in_declared_units(PlanFindings.model_validate(told))
    console = screen()
    console.tell(f"{found.campaign}: what to measure next for {asked_words(found)}")
    for k in found.quantities if found.kind == "quantity" else ():
        if k.median is not None:
            unit = f" {unit_text(k.shown_unit)}".rstrip()
            sd = k.sd * k.shown_factor
            median, half = write([k.median * k.shown_factor, HALF_WIDTH_90 * sd], resolution=sd).plain
            console.tell(f"{quantity_name(k, found)}: {median} ±{half}{unit} now (half of the 90 % interval)")
    for p in found.rivals:
        state = "told apart already" if p.told_apart else "not told apart"
        console.tell(f"{pair_name(p)}: {state}, ln Bayes factor {p.ln_bayes_factor:.1f}")
    if any(c.fits for c in found.candidates):
        console.print(_table(found))
    console.tell(*(f"remark: {remark}" for remark in (*found.declared_differently, *found.remarks)))
    if not found.converged:
        console.tell(f"{NOT_CONVERGED}.")
    console.tell(found.advice)
    show_end(console, told, out)


def _table(found: PlanFindings) -> Table:
    gained = ["nats", "nats/h", "leaves" if found.kind == "quantity" else "shrinks variances by"]
    told = map(pair_name, found.rivals) if found.kind == "tell-apart" else gained
    shown = [c for c in found.candidates if c.fits][:CANDIDATES_SHOWN]
    loads = [other_load(c, found) for c in shown]
    table = titled(
        f"best of {len(found.candidates)} candidates, by what they tell per hour",
        *("condition", *(["load"] if any(loads) else []), "temperature", "rate"),
        *map(numbers, ("cycles", "samples", "time", *told)),
        "beyond",
    )
    degrees = unit_text(found.temperature_unit)
    lowest, peak = _alike([c.lowest for c in shown]), _alike([c.peak for c in shown])
    per_minute = rate_unit(found.temperature_unit)
    rates = _alike([60.0 * c.rate for c in shown])
    minutes = all(c.hours < 1.0 for c in shown)
    times = _alike([c.hours * (60.0 if minutes else 1.0) for c in shown])
    gains = _alike([c.nats_per_hour for c in shown])
    for i, c in enumerate(shown):
        table.add_row(
            c.condition, *([loads[i]] if any(loads) else []),
            f"{lowest[i]} to {peak[i]} {degrees}", f"{rates[i]} {per_minute}", str(c.cycles),
            str(c.samples), f"{times[i]} {'min' if minutes else 'h'}", *_told(c, found, gains[i]), ", ".join(c.beyond),
        )  # fmt: skip
    return table


def _alike(column: Sequence[float | None]) -> tuple[str, ...]:
    """Numbers of a column with as many decimals each."""
    return write(column, digits=3).plain


def _told(c: PlannedCandidate, found: PlanFindings, rate: str) -> list[str]:
    if found.kind == "tell-apart":
        return [f"{p.probability:.2f}" for p in c.pairs]
    if not c.expected:
        left = "-"
    elif found.kind == "parameters":
        left = f"{min(e.shrinkage for e in c.expected):.0%} to {max(e.shrinkage for e in c.expected):.0%}"
    else:
        best = max(c.expected, key=lambda e: e.shrinkage)
        known = known_of(best, found)
        left = f"{half_width(best.sd, known, known.sd)} {unit_text(known.shown_unit)}".rstrip()
        left += f" ({best.key.rpartition('-')[2]})"
    return [f"{c.nats or 0.0:.2f}", rate, left]
