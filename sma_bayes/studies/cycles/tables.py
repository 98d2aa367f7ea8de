"""Tables of a study of cycles."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from sma_bayes.report.content import Estimate, Number
from sma_bayes.report.notation import unit_label
from sma_bayes.report.tables import UNIT_OF_ROW, Cell, Column, Table
from sma_bayes.studies.cycles.schema import ConditionCycles, StoredCycles

CONDITION = Column("condition", "condition")
CURVE = (CONDITION, Column("branch", "branch"), Column("channel", "channel"))


def cycles_tables(stored: StoredCycles) -> dict[str, Table]:
    """All tables of a study of cycles, by name."""
    conditions, unit = stored.found.conditions, stored.found.temperature_unit
    tables = (
        _law(conditions), _stable(conditions), _changes(conditions), _held_out(conditions),
        _quantities(conditions, unit), _curves(conditions, unit),
    )  # fmt: skip
    return {t.name: t for t in tables}


def _law(conditions: tuple[ConditionCycles, ...]) -> Table:
    columns = (
        CONDITION, Column("cycles", "cycles"), Column("law", "law"), Column("N0", "n0", "1"),
        Column("P(no law)", "p_none", "1"), Column("P(exponential)", "p_exponential", "1"),
        Column("P(stretched exponential)", "p_stretched", "1"),
        Column("P(logarithmic)", "p_logarithmic", "1"), Column("why", "why", brief=False),
    )  # fmt: skip
    rows = tuple(
        (
            c.condition,
            len(c.measured),
            c.law.chosen,
            None if c.law.n0 is None else Estimate.of(c.law.n0),
            *(
                _share(c.law.probability.get(law))
                for law in ("none", "exponential", "stretched", "logarithmic")
            ),
            c.law.reason,
        )
        for c in conditions
    )
    note = "N0 and 90 % interval are those of the law with the greatest evidence; no law means that each sweep is free."
    return Table("law", "Law of training", note, columns, rows)


def _share(p: float | None) -> Cell:
    return None if p is None else Number(p, "1", 0.01)


def _stable(conditions: tuple[ConditionCycles, ...]) -> Table:
    columns = (
        CONDITION, Column("cycle", "cycle"), Column("change to the next", "change", "1"),
        Column("stable from here on", "probability", "1"),
    )  # fmt: skip
    rows = tuple(
        (c.condition, cycle, Number(change, "1", 0.001), _share(p))
        for c in conditions
        for cycle, change, p in zip(c.stable.cycles, c.stable.change, c.stable.probability, strict=True)
    )
    note = (
        "Median of the greatest change of any curve to the next cycle, over its stroke, and "
        "probability that from here on "
        "none exceeds the share that was asked."
    )
    return Table("stable", "When the spring is stable", note, columns, rows, 1)


def _changes(conditions: tuple[ConditionCycles, ...]) -> Table:
    columns = (
        *CURVE, Column("number", "number"), Column("unit", "unit"), Column("P(trained)", "probability", "1"),
        Column("change", "change", UNIT_OF_ROW), Column("scatter", "scatter", UNIT_OF_ROW),
        Column("step", "step", UNIT_OF_ROW),
    )  # fmt: skip
    rows = tuple(
        (
            c.condition, n.branch, n.channel, n.number, unit_label(n.unit) or "1", _share(n.probability),
            *(Estimate.of(x, n.unit) for x in (n, n.scatter, n.step)),
        )
        for c in conditions for n in c.changes
    )  # fmt: skip
    note = (
        "Change by the law from the first to the last measured cycle: of offset and stroke over the span of the common "
        "curve (stroke and width: logarithms), of the shift as a temperature. P(trained): probability that the law "
        "moves the number. Scatter: standard deviation from sweep to sweep. Step: that of a walk from cycle to cycle."
    )
    return Table("changes", "What training changes", note, columns, rows, 3)


def _held_out(conditions: tuple[ConditionCycles, ...]) -> Table:
    columns = (
        *CURVE, Column("trained on", "trained"), Column("forecast", "held_out"),
        Column("RMSE of the forecast", "rmse", "1"),
        Column("RMSE of the last curve", "rmse_last", "1"), Column("samples within 90 %", "covered", "1"),
        Column("numbers within 90 %", "numbers_covered", "1"),
    )  # fmt: skip
    rows = tuple(
        (
            c.condition, h.branch, h.channel, span(h.trained), span(h.held_out), Number(h.rmse, "1", 1e-3),
            Number(h.rmse_last, "1", 1e-3), _share(h.covered), _share(h.numbers_covered),
        )
        for c in conditions for h in c.held_out
    )  # fmt: skip
    note = "RMSE: root mean square error of the forecast, and of the last curve before, over the range of the channel."
    return Table("held_out", "Later cycles, forecast from earlier ones", note, columns, rows, 1)


def span(cycles: tuple[float, ...]) -> str:
    """First and last of some cycles, or the only one."""
    return f"{cycles[0]:g}–{cycles[-1]:g}" if len(cycles) > 1 else f"{cycles[0]:g}"


def _quantities(conditions: tuple[ConditionCycles, ...], temperature_unit: str) -> Table:
    columns = (
        *CURVE, Column("quantity", "quantity"), Column("at", "at", temperature_unit), Column("unit", "unit"),
        Column("cycle", "cycle"), Column("measured", "measured"), Column("by itself", "own", UNIT_OF_ROW),
        Column("pooled", "pooled", UNIT_OF_ROW),
    )  # fmt: skip
    note = (
        "Each sweep by itself (median and 90 % interval), and pooled over cycles; of cycles that "
        "were not measured, the "
        "90 % predictive interval."
    )
    rows = tuple(row for c in conditions for row in _rows(c, temperature_unit))
    return Table("quantities", "Cycle by cycle", note, columns, rows, 5)


def _rows(c: ConditionCycles, temperature_unit: str) -> Iterator[tuple[Any, ...]]:
    for q in c.quantities:
        for i, cycle in enumerate(c.cycles):
            own, sd = q.own[i], q.own_sd[i]
            alone = (
                None
                if own is None or sd is None
                else Estimate(own, own - 1.645 * sd, own + 1.645 * sd, q.unit)
            )
            yield (
                c.condition, q.branch, q.channel, q.name, None if q.at is None else Number(q.at, temperature_unit, 1.0),
                unit_label(q.unit) or "1", cycle, "yes" if cycle in c.measured else "no", alone,
                Estimate(q.median[i], q.q05[i], q.q95[i], q.unit),
            )  # fmt: skip


def _curves(conditions: tuple[ConditionCycles, ...], temperature_unit: str) -> Table:
    columns = (
        *CURVE, Column("model", "model"), Column("unit", "unit"), Column("midpoint", "midpoint", temperature_unit),
        Column("level", "level", UNIT_OF_ROW), Column("span", "span", UNIT_OF_ROW), Column("misfit", "missed", "1"),
        Column("lag-1 correlation", "lag1_correlation", "1"), Column("own shape", "own_shape", "1"),
        Column("noise of readings", "reading_noise", UNIT_OF_ROW),
    )  # fmt: skip
    rows = tuple(
        (
            c.condition, k.branch, k.channel, k.model.replace("_", " "), unit_label(k.unit) or "1",
            Number(k.midpoint, temperature_unit, 0.01), Number(k.level, k.unit, k.noise),
            Number(k.span, k.unit, k.noise),
            Number(k.missed, "1", 1e-4), Number(k.lag1_correlation, "1", 0.01),
            Number(k.own_shape, "1", 1e-4), Number(k.reading_noise, k.unit, 0.1 * k.reading_noise),
        )
        for c in conditions for k in c.curves
    )  # fmt: skip
    note = (
        "Midpoint, level and span are those of the mean of the measured sweeps. Misfit: root mean square of what curve "
        "and numbers of the sweeps leave, over the range of the channel. Own shape: root mean square of the part of it "
        "that is slow within a sweep, which the sweep has of its own; the rest is the noise of readings."
    )
    return Table("curves", "Common curves", note, columns, rows, 1)
