"""Transformation temperatures that rise as the force rises along a loop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.stress import REFERENCE, coefficient
from sma_bayes.effects.transformation import moved
from sma_bayes.effects.types import Inputs, Response, Scales
from sma_bayes.parameters.space import Parameter

STEEPEST, FLATTEST = -50.0, -0.2
"""Bounds of the slope that the secant method uses, which is -1 without the effect."""


@dataclass(frozen=True)
class PathStressShift:
    """The Clausius-Clapeyron shift within one loop: ``Tc = T0 + c (F - F0)`` with the model's own force.

    The curve bends: its upper shoulder comes later than its lower one. Constant ``c F0`` goes into the midpoints, and
    part of the bend into the rates. Compliance of the fixture also adds a share of the force, but to the displacement
    instead of the temperature: a blocked spring against a dead weight tells which.

    The force that shifts is the shifted force, so ``u = F(T - c u)`` is solved for ``u`` by the secant method.
    """

    id = "path_stress_shift"
    title = "rising force raises the transformation temperatures within the loop"
    equation = "Tc = T0 + c (F - F0)"
    reference = REFERENCE
    needs = ("force",)

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        return (coefficient(scales, "force"),)

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        c = theta[..., :1]

        def excess(u: Floats) -> Floats:
            shifted = {**inputs, "temperature": inputs["temperature"] - c * u}
            return response(shifted)["force"] - u

        old = response(inputs)["force"]
        error = excess(old)
        u, slope = old + 0.5 * error, np.full(error.shape, -1.0)
        for _ in range(2):
            new = excess(u)
            change = u - old
            np.divide(new - error, change, out=slope, where=change != 0.0)
            old, error = u, new
            u = u - new / np.clip(slope, STEEPEST, FLATTEST)
        return moved(response, inputs, -c * u)
