"""Growth of the alloy with temperature."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from sma_bayes.arrays import Floats
from sma_bayes.effects.transformation import curves, measured
from sma_bayes.effects.types import Inputs, Response, Scales, either_sign
from sma_bayes.parameters.space import Parameter

MARTENSITE: Final = 6.6e-6
AUSTENITE: Final = 11e-6
"""Coefficients of linear expansion [1/K]."""
ROOM: Final = 22.0
"""Temperature from which the growth is counted; offset and span absorb any other [degC]."""
LENGTH: Final = 0.1
"""Length of a spring whose length is not known [m]."""


@dataclass(frozen=True)
class ThermalExpansion:
    """Linear growth of either phase: ``X -> X + e (0.6 + 0.4 s) (T - T0)`` with the share s of austenite.

    Rates and spans absorb most of it within the transformation; it shows as slopes of the plateaus, the same in every
    cycle, where creep keeps growing. The grips expand too, so the sign is free. A sweep within austenite alone settles
    it.
    """

    id = "thermal_expansion"
    title = "linear growth with temperature"
    equation = "X -> X + e (0.6 + 0.4 s) (T - T0)"
    reference = (
        "6.6e-6 1/K (martensite) and 11e-6 1/K (austenite): Selected Properties of NiTi, sma-inc.com; the same on "
        "data sheets of medicaldevicecomponents.com"
    )
    needs = ("displacement", "plateaus")

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        unit = scales.units["displacement"]
        length = {"1": 1.0, "m": LENGTH}.get(unit, 3.0 * scales.span["displacement"])
        over = {"1": "", "m": " over some 0.1 m"}.get(unit, " over some three strokes")
        source = f"twice that of austenite, as grips grow too: 90 % within 22e-6 1/K{over}"
        prior = either_sign(2.0 * AUSTENITE * length)
        return (Parameter("e", f"{unit}/K", "growth of austenite a kelvin", prior, source),)

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        out, found = curves(response, inputs)
        curve = found["displacement"]
        phases = MARTENSITE / AUSTENITE + (1.0 - MARTENSITE / AUSTENITE) * curve.share
        grown = theta[..., :1] * phases * (measured(inputs) - ROOM)
        return {**out, "displacement": curve.value + grown}
