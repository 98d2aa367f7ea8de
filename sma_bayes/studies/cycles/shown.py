"""A study of cycles in the units in which the measurements were declared, for people."""

from __future__ import annotations

from sma_bayes.arrays import Floats
from sma_bayes.quantities import quantity_of
from sma_bayes.runs.declared_units import Shown, in_unit, shown_as, shown_columns, units_of
from sma_bayes.studies.cycles.schema import (
    ChangeOfNumber,
    CommonCurve,
    ConditionCycles,
    CyclesDocument,
    QuantityByCycle,
    StoredCycles,
)

RATIO = "width"
"""A number that is a ratio whatever the unit of the channel."""


def in_declared_units(found: CyclesDocument) -> CyclesDocument:
    """What was found, with numbers and units as people see them; parameters, which nobody is shown, stay."""
    units = units_of(found, specimen=found.specimen)
    if not units:
        return found
    specimen = found.specimen
    return found.but(
        temperature_unit=shown_as(found.temperature_unit, units).shown,
        conditions=tuple(_condition(c, units, found.temperature_unit, specimen) for c in found.conditions),
    )


def curve_columns(stored: StoredCycles, condition: str, branch: str, channel: str) -> dict[str, Floats]:
    """Columns of the curves of a channel, cycle by cycle, as people see them."""
    specimen = stored.found.specimen
    columns = stored.columns(f"curves/{condition}-{branch}-{channel}.csv")
    units = units_of(stored.found, specimen=specimen)
    return shown_columns(columns, units, quantity_of(channel, specimen=specimen), kept=("cycle",))


def _condition(c: ConditionCycles, units: Shown, temperature_unit: str, specimen: bool) -> ConditionCycles:
    return c.but(
        curves=tuple(_curve(k, units, temperature_unit, specimen) for k in c.curves),
        changes=tuple(_change(n, units) for n in c.changes),
        quantities=tuple(_quantity(q, units, temperature_unit, specimen) for q in c.quantities),
    )


def _curve(k: CommonCurve, units: Shown, temperature_unit: str, specimen: bool) -> CommonCurve:
    u = shown_as(k.unit, units, quantity_of(k.channel, specimen=specimen))
    midpoint = shown_as(temperature_unit, units).value(k.midpoint)
    return in_unit(k, u, "level", "span", "noise", midpoint=midpoint)


def _change(n: ChangeOfNumber, units: Shown) -> ChangeOfNumber:
    u = shown_as(n.unit, units, difference=True)
    parts = {"scatter": in_unit(n.scatter, u), "step": in_unit(n.step, u)}
    return in_unit(n, u).model_copy(update=parts)


def _quantity(q: QuantityByCycle, units: Shown, temperature_unit: str, specimen: bool) -> QuantityByCycle:
    quantity = quantity_of("stiffness" if q.name == "stiffness" else q.channel, specimen=specimen)
    u, spread = (
        shown_as(q.unit, units, "" if q.name == RATIO else quantity, difference=d) for d in (False, True)
    )
    return q.but(
        unit=u.shown,
        at=shown_as(temperature_unit, units).value(q.at),
        own_sd=tuple(map(spread.value, q.own_sd)),
        **{k: tuple(map(u.value, getattr(q, k))) for k in ("own", "q05", "median", "q95")},
    )
