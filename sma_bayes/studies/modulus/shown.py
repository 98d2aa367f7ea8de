"""A study of moduli with temperatures in the unit in which the measurements were declared, for people."""

from __future__ import annotations

from typing import TypeVar

from sma_bayes.quantities import TEMPERATURE
from sma_bayes.runs.declared_units import ShownUnit, in_unit, shown_as, units_of
from sma_bayes.runs.schema import DeclaredUnits
from sma_bayes.studies.modulus.schema import (
    CurveParameter,
    FrequencyShift,
    ModulusFindings,
    ModulusSweep,
    TransitionTemperature,
)

F = TypeVar("F", bound=ModulusFindings)


def in_declared_units(found: F) -> F:
    """What a study found, with temperatures as people see them; moduli are converted where they are shown."""
    degrees, apart = degrees_of(found), degrees_of(found, difference=True)
    if (degrees.factor, degrees.zero) == (1.0, 0.0):
        return found
    return found.but(
        temperature_unit=degrees.shown,
        sweeps=tuple(_sweep(s, degrees, apart) for s in found.sweeps),
        shifts=tuple(_shift(s, degrees, apart) for s in found.shifts),
        by_frequency=tuple(in_unit(b, degrees, "at") for b in found.by_frequency),
    )


def degrees_of(found: DeclaredUnits, *, difference: bool = False) -> ShownUnit:
    """How temperatures are shown, or differences of two, which are stored in kelvins."""
    return shown_as("K" if difference else TEMPERATURE.unit, units_of(found), difference=difference)


def parameter_unit(
    name: str, p: CurveParameter, found: DeclaredUnits, modulus: ShownUnit | None
) -> ShownUnit:
    """How a parameter of a curve is shown; only a midpoint is a temperature and no difference of two."""
    units = {n: u for n, u in units_of(found).items() if n == TEMPERATURE.name}
    units |= {} if modulus is None else {"modulus": modulus}
    return shown_as(p.unit, units, "modulus", difference=name != "midpoint")


def _sweep(s: ModulusSweep, degrees: ShownUnit, apart: ShownUnit) -> ModulusSweep:
    return in_unit(
        s,
        degrees,
        "temperature_from",
        "temperature_to",
        temperatures=tuple(_temperature(t, degrees, apart) for t in s.temperatures),
        values=tuple(v.but(at=degrees.value(v.at)) for v in s.values),
    )


def _temperature(t: TransitionTemperature, degrees: ShownUnit, apart: ShownUnit) -> TransitionTemperature:
    return in_unit(t, degrees, "q05", "median", "q95", "mean", sd=apart.value(t.sd))


def _shift(s: FrequencyShift, degrees: ShownUnit, apart: ShownUnit) -> FrequencyShift:
    return s.but(
        points=tuple(in_unit(p, degrees, "temperature", sd=apart.value(p.sd)) for p in s.points),
        shift=in_unit(s.shift, apart),
        scatter=in_unit(s.scatter, apart),
    )
