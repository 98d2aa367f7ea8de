"""Losses that grow faster than the excess over the room."""

from __future__ import annotations

from dataclasses import dataclass

from sma_bayes.arrays import Floats
from sma_bayes.effects.types import Inputs, Response, Scales
from sma_bayes.parameters.distributions import LogNormal
from sma_bayes.parameters.space import Parameter


@dataclass(frozen=True)
class ConvectiveLoss:
    """Natural convection: what is hotter drives the air faster, ``h -> h (abs(T - Ta)/(40 K))^n``.

    Loss is then that at an excess of 40 K. Gain and loss absorb the mean; what is left follows the temperature on both
    branches alike: settled temperatures grow less than with the square of the current, and the cooling slows down
    towards the room. Radiation grows with the temperature, too, but hardly near the room; two currents apart, or a fan,
    which makes losses linear, tell the two.
    """

    id = "convective_loss"
    title = "natural convection grows with the excess over the room"
    equation = "h -> h (abs(T - Ta)/(40 K))^n"
    reference = (
        "Morgan, The overall convective heat transfer from smooth circular cylinders, Adv. Heat Transfer 11 (1975) "
        "199-264: exponents of the Rayleigh number 0.058 below 0.01, 0.148 up to 100, 0.188 up to 1e4, 0.25 beyond; "
        "thin wires in air are near 0.15"
    )
    needs = ("temperature_response",)

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        source = "90 % between 0.072 and 0.31; 0.06 of a hair, 0.25 of a thick rod"
        return (Parameter("n", "1", "exponent of the excess in h", LogNormal(0.15, 0.45), source),)

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        return response({**inputs, "loss_exponent": theta[..., :1]})
