"""Tables of a simulation."""

from __future__ import annotations

from sma_bayes.report.content import Estimate
from sma_bayes.report.notation import unit_label
from sma_bayes.report.tables import Column, Table, table_of, words
from sma_bayes.studies.simulate.schema import SimulationDocument, StoredSimulation
from sma_bayes.studies.simulate.terminal import shown_parameters, start_text


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
    for r in found.runs:
        for c, v in r.shown.items():
            rows.append((r, v.name, v))
            if c == "temperature":
                rows.append((r, "hottest temperature", r.hottest.shown_in(r.temperature_unit)))
    return table_of(
        "end",
        "At the end of the profile",
        "Median and equal-tailed 90 % intervals: of the curve, and of another run, in which the temperature is off as "
        "measured ones were and readings have their noise.",
        rows,
        (Column("condition", "condition"), lambda r, name, v: r.condition),
        (Column("start", "start"), lambda r, name, v: start_text(r)),
        (Column("quantity", "quantity"), lambda r, name, v: name),
        (Column("value", "value", "unit"), lambda r, name, v: Estimate.of(v, v.unit)),
        (
            Column("another run", "another_run", "unit"),
            lambda r, name, v: Estimate(v.median, v.pred_q05, v.pred_q95, v.unit),
        ),
        (Column("unit", "unit"), lambda r, name, v: unit_label(v.unit) or "1"),
        grouped=2,
    )


def _reach(found: SimulationDocument) -> Table:
    rows = []
    reach = found.reach
    for c in () if reach is None else reach.conditions:
        for p in c.passages:
            rows.append(
                (
                    c.condition,
                    p.direction,
                    Estimate.of(p, "A"),
                    p.probability,
                    c.reachable,
                    None if c.best is None else c.best.current,
                    None if c.best is None else c.best.probability,
                )
            )
    cells = tuple(tuple(f"{x:.3g}" if isinstance(x, float) else x for x in row) for row in rows)
    return Table(
        "reach",
        "Steady currents",
        "Heated from cold until the temperature no longer changes. The best current meets the value within the "
        "tolerance most surely.",
        (
            *words("condition", "direction"),
            Column("current", "current", "A"),
            Column("in a share of the draws", "share"),
            Column("reachable with probability", "reachable"),
            Column("best current in A", "best_current"),
            Column("probability there", "best_probability"),
        ),
        cells,
    )
