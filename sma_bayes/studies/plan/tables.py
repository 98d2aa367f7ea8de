"""Tables of a plan."""

from __future__ import annotations

from collections.abc import Sequence

from sma_bayes.report.content import Estimate, Number
from sma_bayes.report.notation import unit_label
from sma_bayes.report.tables import UNIT_OF_ROW, Cell, Column, Table
from sma_bayes.studies.plan.schema import (
    DesignStep,
    ExpectedQuantity,
    PlanDocument,
    PlannedCandidate,
    StoredPlan,
)
from sma_bayes.studies.plan.words import (
    HALF_WIDTH_90,
    has_even,
    other_load,
    pair_name,
    quantity_name,
    rate_text,
)

SETTINGS = (
    Column("condition", "condition"), Column("lowest", "lowest"), Column("peak", "peak"), Column("rate", "rate"),
    Column("cycles", "cycles"), Column("samples", "samples"), Column("time", "hours", "h"),
)  # fmt: skip


def plan_tables(stored: StoredPlan) -> dict[str, Table]:
    """All tables of a plan, by name; those without rows are left out."""
    found = stored.found
    tables = [_candidates(found), _design(found), _quantities(found), _rivals(found), _scatter(found)]
    return {t.name: t for t in tables if t.rows}


def _settings(step: PlannedCandidate | DesignStep, unit: str) -> tuple[Cell, ...]:
    return (
        step.condition, f"{step.lowest:.1f} {unit_label(unit)}", f"{step.peak:.1f} {unit_label(unit)}",
        rate_text(step.rate, unit), step.cycles, step.samples, Number(step.hours, "h", 0.01 * step.hours),
    )  # fmt: skip


def _candidates(found: PlanDocument) -> Table:
    unit, apart = found.temperature_unit, found.kind == "tell-apart"
    several = any(c.name for c in found.candidates)
    loads = [other_load(c, found) for c in found.candidates]
    columns: list[Column] = [
        Column("rank", "rank"),
        *([Column("name", "name")] if several else []),
        *SETTINGS,
    ]
    if apart:
        columns += [Column(pair_name(p), pair_name(p).replace(" ", "_"), "1") for p in found.rivals]
    else:
        columns += [
            Column("information", "nats", "nats"), Column("per hour", "nats_per_hour", "nats/h"),
            Column("best shrinkage", "shrinkage", "1"),
        ]  # fmt: skip
    if any(loads):
        columns.append(Column("load", "load"))
    columns += [Column("branches", "branches"), Column("beyond the measured", "beyond", brief=False)]
    rows = []
    for c, load in zip(found.candidates, loads, strict=True):
        told: tuple[Cell, ...]
        if apart:
            told = tuple(Number(p.probability, "1", 0.01) for p in c.pairs)
        else:
            best = max((e.shrinkage for e in c.expected), default=0.0)
            told = (
                Number(c.nats, "nats", 0.01),
                Number(c.nats_per_hour, "nats/h", 0.01),
                Number(best, "1", 0.01),
            )
        name: tuple[Cell, ...] = (c.name,) if several else ()
        other: tuple[Cell, ...] = (load,) if any(loads) else ()
        where = " and ".join(c.branches), ", ".join(c.beyond)
        rows.append((c.rank, *name, *_settings(c, unit), *told, *other, *where))
    note = "The best first, by what they tell per hour on the rig. " + (
        "For each pair of explanations, the probability that the candidate tells them apart."
        if apart
        else "Shrinkage: 1 less the expected posterior variance over that of now, of the quantity that shrinks most."
    )
    return Table("candidates", "Candidates", note, tuple(columns), tuple(rows))


def _design(found: PlanDocument) -> Table:
    steps = () if found.design is None else found.design.steps
    note = "Cycles of candidates that fill the hours, at each step those that tell most per hour."
    return Table(
        "design", "Design", note, SETTINGS, tuple(_settings(s, found.temperature_unit) for s in steps)
    )


def _quantities(found: PlanDocument) -> Table:
    best = next((c for c in found.candidates if c.fits), None)
    design = found.design
    rows = []
    for k in found.quantities:
        f = k.shown_factor
        rows.append((
            quantity_name(k, found), unit_label(k.shown_unit) or "1", Estimate.of(k, k.shown_unit, f), _half(k.sd * f),
            _left(() if best is None else best.expected, k.key, k.name, f),
            _left(() if design is None else design.expected, k.key, k.name, f),
            _left(() if design is None or not has_even(design) else design.even.expected, k.key, k.name, f),
        ))  # fmt: skip
    return Table(
        "quantities",
        "What is known, and what is expected",
        "Median and equal-tailed 90 % interval now, and half the width of the interval: now, expected after the best "
        "candidate, after the design, and after the same hours divided evenly.",
        (
            Column("quantity", "quantity"), Column("unit", "unit"), Column("now", "now", UNIT_OF_ROW),
            Column("half width", "half_width", UNIT_OF_ROW),
            Column("after the best candidate", "after_best", UNIT_OF_ROW),
            Column("after the design", "after_design", UNIT_OF_ROW),
            Column("after an even division", "after_even", UNIT_OF_ROW),
        ),
        tuple(rows),
    )  # fmt: skip


def _half(sd: float) -> Number:
    return Number(HALF_WIDTH_90 * sd, UNIT_OF_ROW, 0.01 * HALF_WIDTH_90 * sd)


def _left(expected: Sequence[ExpectedQuantity], key: str, name: str, factor: float) -> Number | None:
    found = next((e for e in expected if (e.key, e.name) == (key, name)), None)
    return None if found is None else _half(found.sd * factor)


def _rivals(found: PlanDocument) -> Table:
    rows = tuple(
        (
            p.first or "no effect",
            p.second or "no effect",
            Number(p.ln_bayes_factor, "1", 0.1),
            "yes" if p.told_apart else "no",
        )
        for p in found.rivals
    )
    return Table(
        "rivals",
        "Explanations",
        "ln Bayes factor of the first over the second from the measurements there are.",
        (
            Column("first", "first"), Column("second", "second"), Column("ln Bayes factor", "ln_bayes_factor", "1"),
            Column("told apart", "told_apart"),
        ),
        rows,
    )  # fmt: skip


def _scatter(found: PlanDocument) -> Table:
    unit = "K" if found.temperature_unit == "degC" else found.temperature_unit
    rows = tuple(
        (
            s.key, s.channel, s.sweeps, Number(s.offset, UNIT_OF_ROW, 0.01 * s.offset or None),
            Number(s.stroke, "1", 1e-4), Number(s.shift, unit, 1e-3), Number(s.width, "1", 1e-4),
        )
        for s in found.scatter
    )  # fmt: skip
    return Table(
        "scatter",
        "Scatter from sweep to sweep",
        "Standard deviation of the offset, of the logarithm of the stroke, of the shift of temperature and of the "
        "logarithm of the width, beyond what noise makes; 0 sweeps: assumed. The offset is in the unit of the channel.",
        (
            Column("record", "record"), Column("channel", "channel"), Column("sweeps", "sweeps"),
            Column("offset", "offset", UNIT_OF_ROW), Column("stroke", "stroke", "1"), Column("shift", "shift", unit),
            Column("width", "width", "1"),
        ),
        rows,
    )  # fmt: skip
