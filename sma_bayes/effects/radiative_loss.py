"""Losses by radiation."""

from __future__ import annotations

from dataclasses import dataclass

from sma_bayes.arrays import Floats
from sma_bayes.effects.types import Inputs, Response, Scales
from sma_bayes.parameters.distributions import LogNormal
from sma_bayes.parameters.space import Parameter


@dataclass(frozen=True)
class RadiativeLoss:
    """Radiation beside convection: ``h -> h (1 + w (T^2 + Ta^2) (T + Ta)/(4 T0^3))``, T in kelvin, T0 = 293.15 K.

    Times the excess that is ``h (T - Ta) + w h (T^4 - Ta^4)/(4 T0^3)``, so w is the radiative over the convective
    coefficient near room temperature. What gain and loss do not absorb of it is small, unless the alloy is hot or in a
    vacuum.
    """

    id = "radiative_loss"
    title = "the alloy radiates"
    equation = "h -> h (1 + w (T^2 + Ta^2) (T + Ta)/(4 T0^3))"
    reference = (
        "Stefan and Boltzmann's law: 4 sigma T0^3 = 5.7 W/(m2 K) of a black body; emissivities of 0.1 (polished) to "
        "0.8 (oxidised) and 20-100 W/(m2 K) of thin wires in air: Incropera and DeWitt, Fundamentals of Heat and Mass "
        "Transfer (Wiley)"
    )
    needs = ("temperature_response",)

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        source = "90 % between 0.0077 and 0.21; 0.006 to 0.23 by the reference"
        meaning = "radiative over convective coefficient at 20 degC"
        return (Parameter("w", "1", meaning, LogNormal(0.04, 1.0), source),)

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        return response({**inputs, "radiated": theta[..., :1]})
