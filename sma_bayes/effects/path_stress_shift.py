"""Transformation temperatures that rise as the force rises along a loop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.stress import REFERENCE, coefficient
from sma_bayes.effects.transformation import moved
from sma_bayes.effects.types import Inputs, Response, Scales
from sma_bayes.parameters.space import Parameter

STEEPEST, FLATTEST = -50.0, -0.2
"""Bounds of the slope that the secant method uses, which is -1 without the effect."""
RELATIVE_TOLERANCE = 1e-8
"""Relative error with which the shifted force is found, so that differences of it can be taken."""
MAX_STEPS = 12
"""Steps in which it is found, at most: some four for a usual shift, ten for one much wider than the transformation."""


@dataclass(frozen=True)
class PathStressShift:
    """The Clausius-Clapeyron shift within one loop: ``Tc = T0 + c (F - F0)`` with the model's own force.

    The curve bends: its upper shoulder comes later than its lower one. Constant ``c F0`` goes into the midpoints, and
    part of the bend into the rates. Compliance of the fixture also adds a share of the force, but to the displacement
    instead of the temperature: a blocked spring against a dead weight tells which.

    The force that shifts is the shifted force, so ``u = F(T - c u)`` is solved for ``u`` between both ends.
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

        return moved(response, inputs, -c * _root(excess, response(inputs)["force"]))


def _root(excess: Callable[[Floats], Floats], start: Floats) -> Floats:
    """Where a function that falls with the force is 0, by regula falsi with halved ends (Illinois) on every sample.

    Where the force rises with temperature the root lies between the start and the start plus the excess there. Where it
    falls there may be none or several, and steps are those of the secant method with a bounded slope.
    """
    near = RELATIVE_TOLERANCE * np.max(np.abs(start), axis=-1, keepdims=True)
    old, error = start, excess(start)
    u, new = start + error, excess(start + error)
    for _ in range(MAX_STEPS):
        far = np.abs(new) > near
        if not far.any():
            break
        slope = np.full(u.shape, -1.0)
        np.divide(new - error, u - old, out=slope, where=u != old)
        enclosed = new * error < 0.0
        step = -new / np.where(enclosed, slope, np.clip(slope, STEEPEST, FLATTEST))
        further = u + np.where(far, step, 0.0)
        left = excess(further)
        replaced = (left * new < 0.0) | ~enclosed
        old, error = np.where(replaced, u, old), np.where(replaced, new, 0.5 * error)
        u, new = further, left
    return u
