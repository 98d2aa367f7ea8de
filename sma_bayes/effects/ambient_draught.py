"""Cooling that changes with the air of the room."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.types import Inputs, Response, Scales, either_sign
from sma_bayes.parameters.distributions import Normal
from sma_bayes.parameters.space import Parameter

LEAST: Final = 0.2
"""Least change of the ambient temperature that a size is reckoned with [K]."""
USUAL: Final = Normal(0.0, 1.0)
"""Prior of what is usual in a room, over the median of what was measured [K]."""


@dataclass(frozen=True)
class AmbientDraught:
    """Air that comes in moves, and is colder or warmer than the room: ``h -> h exp(-e (Ta - Ta0 - d))``.

    Ta0 is what is usual in a condition, since a room that is always cold has no more draught than another: its median,
    by and large, of one condition, whose loss absorbs the rest; where several share their loss, each may be off by d.
    The ambient temperature itself is in the Joule-heating balance where it was recorded, and loss absorbs the mean of
    h. What is left follows the changes of the room, most of all where the alloy is hottest, and not the share
    transformed.
    """

    id = "ambient_draught"
    title = "cooling changes with the air of the room"
    equation = "h -> h exp(-e (Ta - Ta0 - d_i)) in condition i, d_i = 0 of one alone"
    reference = (
        "heat transfer of thin wires in air, 20-100 W/(m2 K) from still air to a light draught: Incropera and DeWitt, "
        "Fundamentals of Heat and Mass Transfer (Wiley)"
    )
    needs = ("temperature_response", "ambient_varies")

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        swing = 0.5 * max(scales.span["ambient_temperature"], LEAST)
        size = either_sign(0.8 / swing)
        source = "h between 20 and 100 W/(m2 K): 90 % within 0.8 of ln h over half the swing of the room"
        runs = int(scales.level["run"]) + 1
        usual = "usual temperature of the room in condition {}, over its median"
        near = "a room that comes and goes about it: 90 % within 1.64 K"
        return (
            Parameter("e", "1/K", "growth of ln h for each kelvin below", size, source),
            *(
                Parameter(f"d{i + 1}", "K", usual.format(i + 1), USUAL, near, refines=True)
                for i in range(runs if runs > 1 else 0)
            ),
        )

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        ambient = inputs["ambient_temperature"]
        colder = np.median(ambient, axis=-1, keepdims=True) - ambient
        if theta.shape[-1] > 1:
            colder = colder + theta[..., 1 + inputs["run"].astype(np.intp)]
        factor = np.exp(np.clip(theta[..., :1] * colder, -5.0, 5.0))
        return response({**inputs, "loss_factor": factor * inputs.get("loss_factor", np.ones(1))})
