"""Friction in the guides of the moving end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.memory import lagged
from sma_bayes.effects.types import Inputs, Place, Response, Scales, either_sign
from sma_bayes.parameters.distributions import LogNormal
from sma_bayes.parameters.space import Parameter
from sma_bayes.records.history import starts


@dataclass(frozen=True)
class GuideFriction:
    """Coulomb friction that builds up over a short way after each reversal (Dahl): ``dFf/dX = (Fc sgn(dX) - Ff)/x0``.

    The way is that of the model's displacement. A force that only changes sign with the branch goes into the offsets
    of the branches; what is left is how it turns round after a reversal. Steps of a converter depend on the force
    instead; reversing by hand tells the two apart.
    """

    id = "guide_friction"
    title = "friction in the guides"
    equation = "F -> F + Ff, dFf/dX = (Fc sgn(dX) - Ff)/x0"
    reference = (
        "P. R. Dahl, Solid friction damping of mechanical vibrations, AIAA Journal 14 (1976) 1675-1682; friction of "
        "light guides 5-50 mN"
    )
    needs = ("force", "displacement", "reversals")
    place = Place.RIG

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        newtons = scales.units["force"] == "N"
        size = either_sign(0.05 if newtons else 0.02 * scales.span["force"])
        whole = (
            "90 % within 50 mN, those of light guides" if newtons else "90 % within 2 % of the span of force"
        )
        way = LogNormal(0.03 * scales.span["displacement"], 1.0)
        return (
            Parameter("Fc", scales.units["force"], "force of friction", size, whole),
            Parameter(
                "x0", scales.units["displacement"], "way over which it turns round", way,
                "some per cent: 90 % between 0.58 and 16 % of the stroke",
            ),
        )  # fmt: skip

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        out = response(inputs)
        step = np.where(
            starts(inputs), 0.0, np.diff(out["displacement"], axis=-1, prepend=out["displacement"][..., :1])
        )
        direction = np.sign(step)
        direction[..., 0] = 0.0
        friction = lagged(direction, np.abs(step) / theta[..., 1:2])
        return {**out, "force": out["force"] + theta[..., :1] * friction}
