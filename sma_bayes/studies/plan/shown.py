"""A plan in the units in which the measurements were declared, for people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from sma_bayes.quantities import QUANTITIES, can_convert, quantity_of, unit_text
from sma_bayes.runs.declared_units import Shown, ShownUnit, units_of
from sma_bayes.runs.shown import in_unit, shown_part
from sma_bayes.studies.plan.schema import (
    DesignOutcome,
    KnownQuantity,
    PlanFindings,
    PlannedCandidate,
    PlannedDesign,
    ScatterOfSweeps,
)

P = TypeVar("P", bound=PlanFindings)
S = TypeVar("S", PlannedCandidate, DesignOutcome, PlannedDesign)
Names = Mapping[tuple[str, str], tuple[str, float]]
"""By record and name of a quantity: the name that is shown, and shown units in one of its own."""


def in_declared_units(found: P) -> P:
    """What a plan says, with numbers and units as people see them; times, nats and shrinkages have none."""
    specimen = _of_specimen(found)
    units = units_of(found, specimen=specimen)
    shown = shown_part(found, units, specimen=specimen)
    quantities = tuple(_known(k, shown.temperature_unit) for k in shown.quantities)
    names: Names = {
        (k.key, k.name): (s.name, k.shown_factor) for k, s in zip(found.quantities, quantities, strict=True)
    }
    design = shown.design
    return shown.but(
        quantities=quantities,
        scatter=tuple(_scatter(s, units, specimen=specimen) for s in shown.scatter),
        candidates=tuple(_expecting(c, names) for c in shown.candidates),
        design=design and _expecting(design, names).but(even=_expecting(design.even, names)),
    )


def load_unit(found: PlanFindings) -> str:
    """Unit in which a plan that is shown has its loads."""
    return found.declared_units.get("load", "Pa" if _of_specimen(found) else QUANTITIES["force"].unit)


def _of_specimen(found: PlanFindings) -> bool:
    """Whether loads are stresses."""
    declared = found.declared_units
    return bool({"stress", "strain", "modulus"} & set(declared)) or can_convert(
        declared.get("load", "N"), "Pa"
    )


def _known(k: KnownQuantity, degrees: str) -> KnownQuantity:
    u = ShownUnit(k.unit, k.shown_unit, k.shown_factor, k.shown_zero)
    name = k.name if k.at is None else f"{k.name.partition(' at ')[0]} at {k.at:.6g} {unit_text(degrees)}"
    return in_unit(k, u, name=name, unit=u.shown, sd=u.factor * k.sd, shown_factor=1.0, shown_zero=0.0)


def _expecting(outcome: S, names: Names) -> S:
    expected = []
    for e in outcome.expected:
        name, factor = names[(e.key, e.name)]
        expected.append(e.but(name=name, sd=factor * e.sd))
    return outcome.but(expected=tuple(expected))


def _scatter(s: ScatterOfSweeps, units: Shown, *, specimen: bool) -> ScatterOfSweeps:
    u = units.get(quantity_of(s.channel, specimen=specimen))
    return s.but(offset=s.offset * (1.0 if u is None else u.factor))
