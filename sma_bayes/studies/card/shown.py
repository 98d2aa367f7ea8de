"""A card in the units in which the measurements were declared, for people; its files for programs name their own."""

from __future__ import annotations

from typing import TypeVar

from sma_bayes.runs.declared_units import Shown, ShownUnit, shown_as, units_of
from sma_bayes.studies.card.schema import CardFindings, StiffnessTable

C = TypeVar("C", bound=CardFindings)


def in_declared_units(found: C) -> C:
    """What is handed on, with the tables of stiffness as people see them; the constants of the law are in MPa and K."""
    units = units_of(found)
    if not units:
        return found
    return found.but(stiffness=tuple(_shown(t, units) for t in found.stiffness))


def units_of_table(t: StiffnessTable, units: Shown) -> tuple[ShownUnit, ShownUnit]:
    """How the stiffness and the temperatures of a table are shown."""
    return shown_as(t.unit, units, t.quantity), shown_as(t.temperature_unit, units)


def _shown(t: StiffnessTable, units: Shown) -> StiffnessTable:
    stiffness, degrees = units_of_table(t, units)
    return t.but(
        unit=stiffness.shown,
        interpolation_error=t.interpolation_error * stiffness.factor,
        temperature_unit=degrees.shown,
        first=degrees.value(t.first),
        step=t.step * degrees.factor,
    )
