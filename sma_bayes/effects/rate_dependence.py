"""A transformation that lags behind the temperature."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sma_bayes.effects.transformation import moved
from sma_bayes.effects.types import EffectParameter, Inputs, Response, Scales
from sma_bayes.parameters.distributions import LogNormal, Uniform
from sma_bayes.quantities import Floats


@dataclass(frozen=True)
class RateDependence:
    """The faster the sweep, the later the transformation: ``Tc -> Tc +/- k (abs(dT/dt)/(1 K/s))**m``.

    A constant rate on each branch goes into the midpoints; it shows where the rate differs at the same temperature.
    A lagging sensor moves the curves the other way, and in proportion to the rate; rates against the direction of the
    branch are taken as rest.
    """

    id = "rate_dependence"
    title = "transformation lags behind the temperature"
    equation = "Tc -> Tc +/- k abs(dT/dt)^m"
    reference = (
        "shift of NiTi transformations with the rate of heating and cooling: Nurveren, Akdogan and Huang, "
        "J. Mater. Process. Technol. 196 (2008) 129-134; self-heating: Shaw and Kyriakides, J. Mech. Phys. Solids "
        "43 (1995) 1243-1281"
    )
    needs = ("channel", "several_rates")

    def parameters(self, scales: Scales) -> tuple[EffectParameter, ...]:
        size = LogNormal(0.6, 1.0)
        return (
            EffectParameter("k", "K", "shift at 1 K/s", size, "0.1-3 K; 90 % between 0.12 and 3.1 K"),
            EffectParameter("m", "1", "exponent of the rate", Uniform(0.3, 1.0), "0.3-1"),
        )

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        branch = inputs["branch"]
        lag = theta[..., :1] * np.maximum(branch * inputs["rate"], 0.0) ** theta[..., 1:2]
        return moved(response, inputs, -branch * lag)
