"""Heat that the transformation takes up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.types import Inputs, Response, Scales
from sma_bayes.parameters.distributions import LogNormal
from sma_bayes.parameters.space import Parameter

SPECIFIC_HEAT: Final = 500.0
"""Specific heat of NiTi [J/(kg K)]; only L over c shows, so L means this number of times that ratio."""


@dataclass(frozen=True)
class LatentHeat:
    """What transforms takes up ``L ds``, and gives it back on the way down, s the share of austenite.

    The share is that of the model's displacement, or of its force where there is no displacement, along the measured
    history. Gain and loss of the Joule-heating balance absorb the mean slowing; what is left is a shoulder of the
    temperature within the transformation, on both branches. Nothing else in the catalogue makes one; a step of power
    settles it. From sweep to sweep nothing is counted, since each branch has a curve of its own.
    """

    id = "latent_heat"
    title = "the transformation takes up heat"
    equation = "m c dT/dt = I^2 R - h A (T - Ta) - m L ds/dt"
    reference = (
        "Wang, Jiang and Nikanpour, Measurement of specific heat, latent heat and phase transformation temperatures "
        "of shape memory alloys, High Temp.-High Press. 37 (2008) 91-107; 24 kJ/kg on data sheets of nitinol"
    )
    needs = ("temperature_response", "share")

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        prior = LogNormal(1e4, 0.55)
        return (Parameter("L", "J/kg", "latent heat", prior, "90 % between 4 and 25 kJ/kg"),)

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        share = inputs["share"]
        same = np.diff(inputs["segment"], prepend=-1.0) == 0
        risen = np.cumsum(np.where(same, np.diff(share, axis=-1, prepend=share[..., :1]), 0.0), axis=-1)
        return response(taking(inputs, theta[..., :1] / SPECIFIC_HEAT * risen))


def taking(inputs: Inputs, heat: Floats) -> dict[str, Floats]:
    """Inputs with something that takes up heat.

    Parameters
    ----------
    inputs : mapping of str to ndarray
    heat : ndarray, shape (..., n)
        That it has taken up at each sample, over the heat capacity of the alloy [K].
    """
    return {**inputs, "heat_taken": inputs.get("heat_taken", np.zeros(1)) + heat}
