"""Tables of a study of sensitivity."""

from __future__ import annotations

from sma_bayes.report.content import INTERVAL, Estimate, Number
from sma_bayes.report.notation import unit_label
from sma_bayes.report.tables import UNIT_OF_ROW, Cell, Column, Table, table_of, words
from sma_bayes.studies.sensitivity.schema import (
    NONE,
    RecordSensitivity,
    StoredSensitivity,
)
from sma_bayes.studies.sensitivity.words import called, reported, worst_sweep

_OF_RECORD = (Column("condition", "condition"), Column("branch", "branch"))
SD = "sd"
"""Unit of changes: posterior standard deviations of the number itself."""


def sensitivity_tables(stored: StoredSensitivity) -> dict[str, Table]:
    """All tables, by name."""
    records = stored.found.records
    tables = [_powers(records, stored.found.thresholds.sensitivity), _readings(records)]
    if any(r.left_out_sweeps for r in records):
        tables += [_sweeps(records, stored.found.thresholds.pareto_k), _bootstrap(records)]
    return {table.name: table for table in tables if table.rows}


def _number(value: float | None, unit: str = "1", digits: float = 0.001) -> Number:
    return Number(value, unit, digits)


def _powers(records: tuple[RecordSensitivity, ...], threshold: float) -> Table:
    return table_of(
        "sensitivity",
        "Prior and data",
        f"Median and {INTERVAL}. Sensitivity: gradient of the cumulative Jensen-Shannon distance with the "
        f"binary logarithm "
        f"of the power of prior or likelihood; from {threshold:g} on it counts. Without prior: what the mean does "
        f"without any prior, to first order; shift: where that power is doubled; both in posterior standard "
        f"deviations (sd).",
        [(r, q) for r in records for q in r.quantities],
        (_OF_RECORD[0], lambda r, q: r.condition),
        (_OF_RECORD[1], lambda r, q: r.branch),
        (Column("number", "number"), lambda r, q: q.name),
        (Column("kind", "kind", brief=False), lambda r, q: q.kind),
        (Column("unit", "unit"), lambda r, q: unit_label(q.unit) or "1"),
        (Column("posterior", "posterior", UNIT_OF_ROW), lambda r, q: Estimate.of(q, q.unit)),
        (Column("prior", "prior", "1"), lambda r, q: _number(q.prior)),
        (Column("likelihood", "likelihood", "1"), lambda r, q: _number(q.likelihood)),
        (Column("without prior", "without_prior", SD), lambda r, q: _number(q.without_prior, SD, 0.01)),
        (
            Column("shift, prior", "prior_shift", SD, brief=False),
            lambda r, q: _number(q.prior_shift, SD, 0.01),
        ),
        (
            Column("shift, likelihood", "likelihood_shift", SD, brief=False),
            lambda r, q: _number(q.likelihood_shift, SD, 0.01),
        ),
        (Column("diagnosis", "diagnosis"), lambda r, q: "" if q.diagnosis == NONE else q.diagnosis),
        (
            Column("leading prior", "leading_prior"),
            lambda r, q: q.leading_prior.parameter if q.leading_prior else "",
        ),
        grouped=2,
    )


def _readings(records: tuple[RecordSensitivity, ...]) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for r in records:
        for q in r.quantities:
            one = q.reading
            if one is not None:
                rows.append((
                    r.condition, r.branch, q.name, one.row, one.sweep, called(r, one.channel),
                    _number(one.temperature, r.temperature_unit, 0.01), unit_label(r.temperature_unit),
                    _number(one.change, SD), _number(one.change_by_weights, SD), _number(one.pareto_k, "1", 0.01),
                    _number(one.readings_in_effect, "1", 1.0),
                ))  # fmt: skip
    return Table(
        "readings",
        "Which reading decides a number",
        "The reading without which the posterior mean changes most. First order: less the posterior covariance "
        "with the log "
        "density of the reading; by weights: draws weighted by one over that density. Readings in effect: over "
        "how many the influence is spread; sd is that of the posterior.",
        (
            *_OF_RECORD,
            *words("number", "row", "sweep", "channel"),
            Column("temperature", "temperature", UNIT_OF_ROW),
            Column("unit", "unit", brief=False),
            Column("change, first order", "change", SD),
            Column("change, by weights", "change_by_weights", SD),
            Column("Pareto k", "pareto_k", "1", brief=False),
            Column("readings in effect", "readings_in_effect", "1"),
        ),
        tuple(rows),
        grouped=2,
    )


def _sweeps(records: tuple[RecordSensitivity, ...], reliable: float) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for r in records:
        for one in r.left_out_sweeps:
            told = [(q.name, s.change) for q in reported(r) for s in q.sweeps if s.sweep == one.sweep]
            known = [(name, change) for name, change in told if change is not None]
            name, change = max(known, key=lambda x: abs(x[1]), default=("", None))
            rows.append((
                r.condition, r.branch, one.sweep, one.first_row, one.readings, _number(one.pareto_k, "1", 0.01),
                "yes" if one.refitted else "no", name, _number(change, SD, 0.01),
            ))  # fmt: skip
    return Table(
        "sweeps",
        "Without a sweep",
        f"Each sweep left out, by weights of the draws; where their Pareto k exceeds {reliable:g}, by a fit of "
        f"the others. "
        "Shown is the number that changes most, in its posterior standard deviations (sd).",
        (
            *_OF_RECORD,
            *words("sweep", "first row", "readings"),
            Column("Pareto k", "pareto_k", "1"),
            Column("fitted again", "refitted"),
            Column("changes most", "number"),
            Column("change", "change", SD),
        ),
        tuple(rows),
        grouped=2,
    )


def _bootstrap(records: tuple[RecordSensitivity, ...]) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for r in records:
        for q in r.quantities:
            b, sweep = q.bootstrap, worst_sweep(q)
            if b is not None:
                rows.append((
                    r.condition, r.branch, q.name, unit_label(q.unit) or "1", Estimate.of(q, q.unit),
                    Estimate.of(b, q.unit), _number(b.width, "1", 0.01),
                    None if sweep is None else sweep[0], _number(None if sweep is None else sweep[1], SD, 0.01),
                ))  # fmt: skip
    return Table(
        "bootstrap",
        "A second opinion from the scatter of sweeps",
        f"Median and {INTERVAL}. Bootstrap: the curve fitted by penalised least squares to sweeps weighted at random "
        "(Dirichlet), which asks no noise model how far sweeps differ. With few sweeps it is rough and a little "
        "narrow. The change is in posterior standard deviations (sd).",
        (
            *_OF_RECORD,
            *words("number", "unit"),
            Column("posterior", "posterior", UNIT_OF_ROW),
            Column("bootstrap", "bootstrap", UNIT_OF_ROW),
            Column("width, over the posterior's", "width", "1"),
            Column("worst sweep", "sweep"),
            Column("change without it", "change", SD),
        ),
        tuple(rows),
        grouped=2,
    )
