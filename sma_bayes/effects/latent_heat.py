"""Heat that the transformation takes up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.effects.transformation import STEP, at, curves
from sma_bayes.effects.types import Inputs, Response, Scales
from sma_bayes.parameters.distributions import LogNormal
from sma_bayes.parameters.space import Parameter
from sma_bayes.quantities import Floats

SPECIFIC_HEAT: Final = 500.0
"""Specific heat of NiTi [J/(kg K)]; only L over c shows, so L means this number of times that ratio."""


@dataclass(frozen=True)
class LatentHeat:
    """The specific heat is ``c + L abs(ds/dT)`` while the share s transforms.

    The share is that of the model's displacement, or of its force where there is no displacement. Gain and loss of the
    Joule-heating balance absorb the mean slowing; what is left is a shoulder of the temperature within the
    transformation, on both branches. Nothing else in the catalogue makes one; a step of power settles it.
    """

    id = "latent_heat"
    title = "the transformation takes up heat"
    equation = "c -> c + L abs(ds/dT)"
    reference = (
        "Wang, Jiang and Nikanpour, Measurement of specific heat, latent heat and phase transformation temperatures "
        "of shape memory alloys, High Temp.-High Press. 37 (2008) 91-107; 24 kJ/kg on data sheets of nitinol"
    )
    needs = ("temperature_response", "curve")

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        prior = LogNormal(1e4, 0.55)
        return (Parameter("L", "J/kg", "latent heat", prior, "90 % between 4 and 25 kJ/kg"),)

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        up, down = (
            list(curves(response, at(inputs, inputs["temperature"] + by))[1].values())[-1].share
            for by in (STEP, -STEP)
        )
        steepness = np.abs(up - down) / (2.0 * STEP)
        factor = 1.0 + theta[..., :1] / SPECIFIC_HEAT * steepness
        return response(
            {**inputs, "heat_capacity_factor": factor * inputs.get("heat_capacity_factor", np.ones(1))}
        )
