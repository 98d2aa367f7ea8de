"""A study of sensitivity in the units in which the measurements were declared, for people."""

from __future__ import annotations

from typing import TypeVar

from sma_bayes.arrays import Floats
from sma_bayes.quantities import unit_text
from sma_bayes.runs.declared_units import Shown, in_unit, shown_as, units_of
from sma_bayes.runs.outputs import floats
from sma_bayes.studies.sensitivity.schema import (
    QuantitySensitivity,
    RecordSensitivity,
    SensitivityFindings,
    StoredSensitivity,
)

S = TypeVar("S", bound=SensitivityFindings)


def in_declared_units(found: S) -> S:
    """What a study found, with numbers and units as people see them; sensitivities and changes have none."""
    units = units_of(found)
    if not units:
        return found
    return found.but(records=tuple(record_shown(r, units) for r in found.records))


def reading_columns(
    stored: StoredSensitivity, record: RecordSensitivity
) -> tuple[tuple[str, ...], Floats, dict[str, Floats]]:
    """Channel and temperature of each reading of a record, and its influence on each number, by the name shown."""
    cells = stored.cells(f"readings/{record.key}.csv")
    label, warm = next(item for item in cells.items() if item[0].startswith("temperature_"))
    degrees = shown_as(label.removeprefix("temperature_"), units_of(stored.found))
    influences = list(cells.values())[-len(record.quantities) :]
    names = [q.name for q in record.quantities]
    return (
        cells["channel"],
        degrees.values(floats(warm)),
        dict(zip(names, map(floats, influences), strict=True)),
    )


def record_shown(r: RecordSensitivity, units: Shown) -> RecordSensitivity:
    """The same of one record."""
    return r.but(
        temperature_unit=shown_as(r.temperature_unit, units).shown,
        quantities=tuple(_quantity(q, r.temperature_unit, units) for q in r.quantities),
    )


def _name(q: QuantitySensitivity, temperature_unit: str, units: Shown) -> str:
    """Name of a number; the temperature that is part of it is shown as the others are."""
    if q.temperature is None:
        return q.name
    u = shown_as(temperature_unit, units)
    return f"{q.quantity} at {u.value(q.temperature):g} {unit_text(u.shown)}"


def _quantity(q: QuantitySensitivity, temperature_unit: str, units: Shown) -> QuantitySensitivity:
    u = shown_as(q.unit, units, q.quantity, difference=q.difference)
    spread = shown_as(q.unit, units, q.quantity, difference=True)
    degrees = shown_as(temperature_unit, units)
    return in_unit(
        q,
        u,
        "q05",
        "median",
        "q95",
        "mean",
        sd=spread.value(q.sd),
        name=_name(q, temperature_unit, units),
        temperature=degrees.value(q.temperature),
        bootstrap=in_unit(q.bootstrap, u),
        reading=in_unit(q.reading, degrees, "temperature"),
    )
