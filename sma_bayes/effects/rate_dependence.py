"""A transformation that lags behind the temperature."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.transformation import moved
from sma_bayes.effects.types import Inputs, Response, Scales
from sma_bayes.parameters.distributions import LogNormal, Uniform
from sma_bayes.parameters.space import Parameter

EXPONENTS: Final = (0.3, 1.0)
"""Range of the exponent."""


@dataclass(frozen=True)
class RateDependence:
    """The faster the sweep, the later the transformation: ``Tc -> Tc +/- k (abs(dT/dt)/r)**m``.

    The shift is told at the typical rate r of the measurements, which determine it there; the literature tells it
    at 1 K/s. A constant rate on each branch goes into the midpoints; it shows where the rate differs at the same
    temperature. A lagging sensor moves the curves the other way, and in proportion to the rate; rates against the
    direction of the branch are taken as rest.
    """

    id = "rate_dependence"
    title = "transformation lags behind the temperature"
    equation = "Tc -> Tc +/- k (abs(dT/dt)/r)^m, r the typical rate measured"
    reference = (
        "shift of NiTi transformations with the rate of heating and cooling: Nurveren, Akdogan and Huang, "
        "J. Mater. Process. Technol. 196 (2008) 129-134; self-heating: Shaw and Kyriakides, J. Mech. Phys. Solids "
        "43 (1995) 1243-1281"
    )
    needs = ("channel", "several_rates")

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        return (
            Parameter(
                "k", "K", f"shift at {scales.level['typical_rate']:.3g} K/s", shift(scales),
                "at 1 K/s 90 % between 0.12 and 3.1 K, carried over to this rate",
            ),
            Parameter("m", "1", "exponent of the rate", Uniform(*EXPONENTS), "any from 0.3 to 1"),
        )  # fmt: skip

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        branch = inputs["branch"]
        relative = np.maximum(branch * inputs["rate"], 0.0) / inputs["typical_rate"]
        lag = theta[..., :1] * relative ** theta[..., 1:2]
        return moved(response, inputs, -branch * lag)


def shift(scales: Scales) -> LogNormal:
    """Prior of the shift at the typical rate: ``k r**m``, with k that at 1 K/s and both as the literature has them.

    Its logarithm has the mean and the standard deviation of ``ln k + m ln r``.
    """
    log_rate = math.log(max(scales.level["typical_rate"], 1e-9))
    low, high = EXPONENTS
    spread = math.hypot(1.0, (high - low) / math.sqrt(12.0) * log_rate)
    return LogNormal(0.6 * math.exp(0.5 * (low + high) * log_rate), spread)
