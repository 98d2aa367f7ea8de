"""How temperatures and parameters of a study of moduli are shown; moduli are converted where they are shown."""

from __future__ import annotations

from sma_bayes.quantities import TEMPERATURE
from sma_bayes.runs.declared_units import ShownUnit, shown_as, units_of
from sma_bayes.runs.schema import DeclaredUnits
from sma_bayes.studies.modulus.schema import CurveParameter


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
