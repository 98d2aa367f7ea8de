"""A sensor that reads between the metal and the air."""

from __future__ import annotations

from dataclasses import dataclass

from sma_bayes.arrays import Floats
from sma_bayes.effects.transformation import at
from sma_bayes.effects.types import Inputs, Place, Response, Scales
from sma_bayes.parameters.distributions import LogNormal
from sma_bayes.parameters.space import Parameter


@dataclass(frozen=True)
class ContactError:
    """Poor contact: ``Tm = T - beta (T - Ta)``, so the metal is at ``Tm + b (Tm - Ta)`` with ``b = beta/(1 - beta)``.

    While the ambient temperature stays the same this stretches the axis of temperature, which rate and midpoint of
    the curves absorb completely. It shows only where the ambient temperature changes: the curve then moves against
    it. A temperature gradient also smears the curve; an infrared line along the spring separates the two.
    """

    id = "contact_error"
    title = "sensor reads between the metal and the air"
    equation = "T = Tm + b (Tm - Ta)"
    reference = (
        "conduction along the wires of thermocouples on surfaces: Boelter and Lockhart, NACA TN 2427 (1951); "
        "ASTM MNL12, Manual on the Use of Thermocouples in Temperature Measurement (1993)"
    )
    needs = ("outcome", "ambient_varies")
    place = Place.SENSOR

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        prior = LogNormal(0.07, 0.9)
        source = "90 % between 1.6 and 31 %, so that 2-24 % of the excess of the metal over ambient is lost"
        return (Parameter("b", "1", "error over the excess of the reading", prior, source),)

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        b, ambient = theta[..., :1], inputs["ambient_temperature"]
        given = at(inputs, inputs["temperature"] + b * (inputs["temperature"] - ambient))
        if "read" in inputs:
            given["read"] = inputs["read"] + b * (inputs["read"] - ambient)
        out = response(given)
        if "temperature" in out:
            out = {**out, "temperature": (out["temperature"] + b * ambient) / (1.0 + b)}
        return out
