"""Friction in the guides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sma_bayes.effects.transformation import slope
from sma_bayes.effects.types import EffectParameter, Inputs, Response, Scales
from sma_bayes.parameters.distributions import LogNormal, Normal
from sma_bayes.quantities import Floats


@dataclass(frozen=True)
class GuideFriction:
    """Coulomb friction, rounded where the motion stops: ``F -> F + Fc tanh(v/v0)``.

    The velocity is that of the model's displacement. A force that only changes sign with the branch goes into the
    offsets of the branches; what is left are the plateaus and reversals, where the motion stops and the friction with
    it. Steps of a converter depend on the force instead; reversing by hand tells the two apart.
    """

    id = "guide_friction"
    title = "friction in the guides"
    equation = "F -> F + Fc tanh(v/v0), v = dX/dt"
    reference = (
        "Andersson, Soderberg and Bjorklund, Friction models for sliding dry, boundary and mixed lubricated contacts, "
        "Tribology International 40 (2007) 580-587; 5-50 mN of light guides"
    )
    needs = ("force", "displacement", "time", "reversals")

    def parameters(self, scales: Scales) -> tuple[EffectParameter, ...]:
        newtons = scales.units["force"] == "N"
        size = Normal(0.0, 0.03 if newtons else 0.01 * scales.span["force"])
        whole = "5-50 mN, of either sign" if newtons else "1 % of the span of force, of either sign"
        moving = scales.span["displacement"] / scales.span["temperature"] * scales.level["rate"]
        speed = LogNormal(0.1 * max(moving, 1e-12), 1.0)
        return (
            EffectParameter("Fc", scales.units["force"], "force of friction", size, whole),
            EffectParameter(
                "v0", f"{scales.units['displacement']}/s", "speed at which it is nearly complete", speed,
                "a tenth of the mean speed at the fastest sweep, within a factor of 5",
            ),
        )  # fmt: skip

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        out = response(inputs)
        velocity = slope(response, inputs, "displacement") * inputs["rate"]
        friction = theta[..., :1] * np.tanh(velocity / theta[..., 1:2])
        return {**out, "force": out["force"] + friction}
