"""Friction in the guides of the moving end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.memory import elapsed, lagged
from sma_bayes.effects.types import Inputs, Place, Response, Scales, either_sign
from sma_bayes.parameters.distributions import LogNormal
from sma_bayes.parameters.space import Parameter
from sma_bayes.records.history import starts


@dataclass(frozen=True)
class GuideFriction:
    """Coulomb friction that builds up over a short way after each reversal (Dahl), and falls off near rest.

    ``dFf/dt = (Fc tanh(v/v0) - Ff)(abs(v) + v0)/x0`` with the speed v = dX/dt of the model: where the alloy moves
    slower than v0, contacts creep instead of sliding. v0 -> 0, and no recorded time, leave Dahl's law
    ``dFf/dX = (Fc sgn(dX) - Ff)/x0``; x0 -> 0 leaves Coulomb's, smooth near rest. A force that only changes sign with
    the branch goes into the offsets of the branches; what is left is how it turns round after a reversal, and how it
    falls off where the alloy hardly moves. Steps of a converter depend on the force instead; reversing by hand tells
    the two apart.
    """

    id = "guide_friction"
    title = "friction in the guides"
    equation = "F -> F + Ff, dFf/dt = (Fc tanh(v/v0) - Ff)(abs(v) + v0)/x0, v = dX/dt"
    reference = (
        "P. R. Dahl, Solid friction damping of mechanical vibrations, AIAA Journal 14 (1976) 1675-1682; near rest: "
        "B. Armstrong-Helouvry, P. Dupont and C. Canudas de Wit, Automatica 30 (1994) 1083-1138; friction of light "
        "guides 5-50 mN"
    )
    needs = ("force", "displacement", "reversals")
    place = Place.RIG

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        newtons = scales.units["force"] == "N"
        size = either_sign(0.05 if newtons else 0.02 * scales.span["force"])
        whole = (
            "90 % within 50 mN, those of light guides" if newtons else "90 % within 2 % of the span of force"
        )
        stroke, unit = scales.span["displacement"], scales.units["displacement"]
        way = LogNormal(0.005 * stroke, 1.7)
        dahl = (
            Parameter("Fc", scales.units["force"], "force of friction", size, whole),
            Parameter(
                "x0", unit, "way over which it turns round", way,
                "up to some per cent: 90 % between 0.031 and 8.2 % of the stroke",
            ),
        )  # fmt: skip
        if "typical_rate" not in scales.level:
            return dahl
        typical = stroke / scales.span["temperature"] * scales.level["typical_rate"]
        near_rest = Parameter(
            "v0", f"{unit}/s", "speed below which it falls off", LogNormal(0.03 * typical, 2.0),
            "a small share: 90 % between 0.11 and 81 % of the mean speed of a sweep",
        )  # fmt: skip
        return *dahl, near_rest

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        out = response(inputs)
        step = np.where(
            starts(inputs), 0.0, np.diff(out["displacement"], axis=-1, prepend=out["displacement"][..., :1])
        )
        direction, way = np.sign(step), np.abs(step)
        if theta.shape[-1] > 2:
            crept = theta[..., 2:3] * elapsed(inputs)
            direction = np.where(crept > 0.0, np.tanh(step / np.where(crept > 0.0, crept, 1.0)), direction)
            way = way + crept
        direction[..., 0] = 0.0
        friction = lagged(direction, way / theta[..., 1:2])
        return {**out, "force": out["force"] + theta[..., :1] * friction}
