"""A plan in the units in which the measurements were declared, for people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from sma_bayes.quantities import QUANTITIES, can_convert, quantity_of, unit_text
from sma_bayes.runs.declared_units import Shown, ShownUnit, in_unit, shown_as, units_of
from sma_bayes.studies.plan.schema import (
    DesignOutcome,
    DesignStep,
    ExpectedQuantity,
    KnownQuantity,
    PlanFindings,
    PlannedCandidate,
    ScatterOfSweeps,
)

P = TypeVar("P", bound=PlanFindings)
S = TypeVar("S", DesignStep, PlannedCandidate)
Names = Mapping[tuple[str, str], tuple[str, float]]
"""By record and name of a quantity: the name that is shown, and shown units in one of its own."""


def in_declared_units(found: P) -> P:
    """What a plan says, with numbers and units as people see them; times, nats and shrinkages have none."""
    specimen = _of_specimen(found)
    units = units_of(found, specimen=specimen)
    degrees = shown_as(found.temperature_unit, units)
    apart = shown_as(found.temperature_unit, units, difference=True)
    quantities = tuple(_known(k, degrees) for k in found.quantities)
    names: Names = {
        (k.key, k.name): (shown.name, k.shown_factor)
        for k, shown in zip(found.quantities, quantities, strict=True)
    }
    design = found.design
    return found.but(
        temperature_unit=degrees.shown,
        quantities=quantities,
        scatter=tuple(_scatter(s, units, apart, specimen=specimen) for s in found.scatter),
        candidates=tuple(_candidate(c, units, degrees, names) for c in found.candidates),
        design=None
        if design is None
        else _outcome(design, names).but(
            steps=tuple(_step(s, degrees) for s in design.steps), even=_outcome(design.even, names)
        ),
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


def _known(k: KnownQuantity, degrees: ShownUnit) -> KnownQuantity:
    u = ShownUnit(k.unit, k.shown_unit, k.shown_factor, k.shown_zero)
    name = k.name
    if k.at is not None:
        name = f"{name.partition(' at ')[0]} at {degrees.value(k.at):.6g} {unit_text(degrees.shown)}"
    return in_unit(
        k,
        u,
        name=name,
        at=degrees.value(k.at),
        unit=u.shown,
        sd=u.factor * k.sd,
        shown_factor=1.0,
        shown_zero=0.0,
    )


def _expected(expected: tuple[ExpectedQuantity, ...], names: Names) -> tuple[ExpectedQuantity, ...]:
    out = []
    for e in expected:
        name, factor = names[(e.key, e.name)]
        out.append(e.but(name=name, sd=factor * e.sd))
    return tuple(out)


def _outcome(outcome: DesignOutcome, names: Names) -> DesignOutcome:
    return outcome.but(expected=_expected(outcome.expected, names))


def _step(step: S, degrees: ShownUnit) -> S:
    return in_unit(step, degrees, "lowest", "peak", rate=degrees.factor * step.rate)


def _candidate(c: PlannedCandidate, units: Shown, degrees: ShownUnit, names: Names) -> PlannedCandidate:
    load = units["load"].value(c.load) if "load" in units else c.load
    return _step(c, degrees).but(load=load, expected=_expected(c.expected, names))


def _scatter(s: ScatterOfSweeps, units: Shown, apart: ShownUnit, *, specimen: bool) -> ScatterOfSweeps:
    u = units.get(quantity_of(s.channel, specimen=specimen))
    return s.but(offset=s.offset * (1.0 if u is None else u.factor), shift=apart.value(s.shift))
