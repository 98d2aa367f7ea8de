"""Transformation temperatures that rise with the load."""

from __future__ import annotations

from dataclasses import dataclass

from sma_bayes.arrays import Floats
from sma_bayes.effects.stress import REFERENCE, coefficient
from sma_bayes.effects.transformation import moved
from sma_bayes.effects.types import Inputs, Response, Scales
from sma_bayes.parameters.space import Parameter


@dataclass(frozen=True)
class StressShift:
    """Clausius-Clapeyron: under a greater load martensite is stable up to a higher temperature.

    Each condition's own midpoints absorb it completely; it shows where one set of parameters serves several loads,
    or where the load changes within a condition. What is left of it then resembles nothing else in the catalogue.
    """

    id = "stress_shift"
    title = "load raises the transformation temperatures"
    equation = "Tc = T0 + c load"
    reference = REFERENCE
    needs = ("channel", "several_loads")

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        return (coefficient(scales, "load"),)

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        return moved(response, inputs, -theta[..., :1] * inputs["load"])
