"""Tables of a simulation."""

from __future__ import annotations

from sma_bayes.report.content import Estimate, Number
from sma_bayes.report.notation import unit_label
from sma_bayes.report.tables import Column, Table, table_of, words
from sma_bayes.studies.simulate.schema import SimulationDocument, StoredSimulation
from sma_bayes.studies.simulate.terminal import shown_parameters, with_starts


def simulation_tables(stored: StoredSimulation) -> dict[str, Table]:
    """All tables of a simulation, by name; those without rows are left out."""
    found = stored.found
    tables = [_balance(found), _ends(found), _reach(found)]
    return {t.name: t for t in tables if t.rows}


def _balance(found: SimulationDocument) -> Table:
    return Table(
        "balance",
        "Heat balance",
        "Fitted to the measured temperatures; median and 90 % credible interval.",
        (
            Column("parameter", "parameter"),
            Column("value", "value", "unit"),
            *words("unit", "meaning"),
        ),
        tuple(
            (name, Estimate.of(p, p.unit), unit_label(p.unit), p.meaning)
            for name, p in shown_parameters(found).items()
        ),
    )


def _ends(found: SimulationDocument) -> Table:
    rows = []
    for r, start in with_starts(found.runs):
        for c, v in r.shown.items():
            rows.append((r.condition, start, v.name, v))
            if c == "temperature":
                rows.append(
                    (r.condition, start, "hottest temperature", r.hottest.shown_in(r.temperature_unit))
                )
    return table_of(
        "end",
        "At the end of the profile",
        "Median and equal-tailed 90 % intervals: of the curve, and of another run, in which the temperature is off as "
        "measured ones were and readings have their noise.",
        rows,
        (Column("condition", "condition"), lambda condition, start, name, v: condition),
        (Column("start", "start"), lambda condition, start, name, v: start),
        (Column("quantity", "quantity"), lambda condition, start, name, v: name),
        (Column("value", "value", "unit"), lambda condition, start, name, v: Estimate.of(v, v.unit)),
        (
            Column("another run", "another_run", "unit"),
            lambda condition, start, name, v: Estimate(v.median, v.pred_q05, v.pred_q95, v.unit),
        ),
        (Column("unit", "unit"), lambda condition, start, name, v: unit_label(v.unit) or "1"),
        grouped=2,
    )


def _reach(found: SimulationDocument) -> Table:
    reach = found.reach
    return table_of(
        "reach",
        "Steady currents",
        "Heated from cold until the temperature no longer changes: where the value is passed, median and 90 % "
        "interval, and the current that meets it within the tolerance most surely.",
        [(c, p) for c in (() if reach is None else reach.conditions) for p in c.passages],
        (Column("condition", "condition"), lambda c, p: c.condition),
        (Column("direction", "direction"), lambda c, p: p.direction),
        (Column("current", "current", "A"), lambda c, p: Estimate.of(p, "A")),
        (Column("in a share of the draws", "share", "1"), lambda c, p: _share(p.probability)),
        (Column("reachable with probability", "reachable", "1"), lambda c, p: _share(c.reachable)),
        (
            Column("best current", "best_current", "A"),
            lambda c, p: None if c.best is None else Number(c.best.current, "A", 0.01 * c.best.current),
        ),
        (
            Column("probability there", "best_probability", "1"),
            lambda c, p: None if c.best is None else _share(c.best.probability),
        ),
    )


def _share(value: float) -> Number:
    return Number(value, "1", 0.01)
