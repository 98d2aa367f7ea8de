"""Channels that are read at different instants."""

from __future__ import annotations

from dataclasses import dataclass

from sma_bayes.arrays import Floats
from sma_bayes.effects.transformation import moved
from sma_bayes.effects.types import Inputs, Place, Response, Scales, either_sign
from sma_bayes.parameters.space import Parameter


@dataclass(frozen=True)
class ClockSkew:
    """Force is read later than the rest: ``F(t + d)``, to first order the force at the temperature ``T + d dT/dt``.

    At a constant rate the midpoint of the force absorbs it; it shows where the rate differs at the same temperature,
    and only in the force. A lagging sensor moves every channel. Tapping the spring shows the skew by itself.
    """

    id = "clock_skew"
    title = "force and temperature are read at different instants"
    equation = "F(t) -> F(t + d)"
    reference = (
        "one converter serves all channels in turn (NI USB-6009 User Guide), and devices with clocks of their own "
        "differ by a reading: 1-100 ms"
    )
    needs = ("force", "displacement", "time")
    place = Place.SENSOR

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        prior = either_sign(0.1)
        return (Parameter("d", "s", "delay of the force", prior, "90 % within 100 ms"),)

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        out = response(inputs)
        later = moved(response, inputs, theta[..., :1] * inputs["rate"])
        return {**out, "force": later["force"]}
