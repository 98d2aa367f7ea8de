"""Cooling that changes with the air of the room."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sma_bayes.effects.types import EffectParameter, Inputs, Response, Scales, either_sign
from sma_bayes.parameters.distributions import LogNormal, Uniform
from sma_bayes.quantities import Floats


@dataclass(frozen=True)
class AmbientDraught:
    """The heat transfer swings: ``h -> h exp(e sin(2 pi t/P + phi))``, as ventilation comes and goes.

    A period longer than the record is a drift, a shorter one a ventilation that switches. The ambient temperature is
    in the Joule-heating balance where it was recorded, and loss absorbs the mean of h. What is left follows the time
    and not the share transformed.
    """

    id = "ambient_draught"
    title = "cooling changes with the air of the room"
    equation = "h -> h exp(e sin(2 pi t/P + phi))"
    reference = (
        "heat transfer of thin wires in air, 20-100 W/(m2 K) from still air to a light draught: Incropera and DeWitt, "
        "Fundamentals of Heat and Mass Transfer (Wiley)"
    )
    needs = ("temperature_response", "ambient")

    def parameters(self, scales: Scales) -> tuple[EffectParameter, ...]:
        half = 0.5 * np.pi
        return (
            EffectParameter(
                "e", "1", "swing of ln h", either_sign(0.3), "h between 20 and 100 W/(m2 K) at most: 0.8"
            ),
            EffectParameter(
                "P",
                "s",
                "period of the swing",
                LogNormal(scales.span["time"], 0.7),
                "of the length of the record",
            ),
            EffectParameter("phi", "rad", "phase", Uniform(-half, half), "any, as the swing has a sign"),
        )

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        swing, period, phase = (theta[..., i, None] for i in range(3))
        factor = np.exp(swing * np.sin(2.0 * np.pi * inputs["time"] / period + phase))
        return response({**inputs, "loss_factor": factor * inputs.get("loss_factor", np.ones(1))})
