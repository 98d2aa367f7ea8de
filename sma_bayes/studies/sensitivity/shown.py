"""A study of sensitivity in the units in which the measurements were declared, for people."""

from __future__ import annotations

from typing import TypeVar

from sma_bayes.quantities import unit_text
from sma_bayes.runs.declared_units import Shown, units_of
from sma_bayes.runs.shown import shown_part
from sma_bayes.studies.sensitivity.schema import QuantitySensitivity, RecordSensitivity, SensitivityFindings

S = TypeVar("S", bound=SensitivityFindings)


def in_declared_units(found: S) -> S:
    """What a study found, with numbers and units as people see them."""
    units = units_of(found)
    return found.but(records=tuple(record_shown(r, units) for r in found.records)) if units else found


def record_shown(r: RecordSensitivity, units: Shown) -> RecordSensitivity:
    """The same of one record; a temperature that is part of a name is shown as the others are."""
    shown = shown_part(r, units)

    def named(q: QuantitySensitivity) -> QuantitySensitivity:
        if q.temperature is None:
            return q
        return q.but(name=f"{q.quantity} at {q.temperature:g} {unit_text(shown.temperature_unit)}")

    return shown.but(quantities=tuple(map(named, shown.quantities)))
