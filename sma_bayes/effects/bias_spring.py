"""A bias spring whose force the load cell sees too."""

from __future__ import annotations

from dataclasses import dataclass

from sma_bayes.arrays import Floats
from sma_bayes.effects.types import Inputs, Place, Response, Scales, either_sign
from sma_bayes.parameters.space import Parameter


@dataclass(frozen=True)
class BiasSpring:
    """Force of a spring beside the alloy: ``F -> F + K2 X``, ``K -> K + K2``; its preload goes into the offset.

    Where force and displacement have the same midpoint and rate, the span of the force absorbs it, unless the
    displacement was also changed at a constant temperature; where they differ, a share of the displacement stays
    visible in the force. Saturation bends only the top of the curve; removing the bias spring settles it.
    """

    id = "bias_spring"
    title = "share of a bias spring in the force"
    equation = "F -> F + K2 X, K -> K + K2"
    reference = (
        "bias spring of 130 N/m +-10 % in the published experiment; a bias spring is chosen between the stiffness of "
        "the alloy's spring in martensite and in austenite (Ikuta, Proc. IEEE ICRA 1990, 2156-2161)"
    )
    needs = ("force", "displacement")
    place = Place.RIG

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        force, displacement = scales.units["force"], scales.units["displacement"]
        unit = force if displacement == "1" else f"{force}/{displacement}"
        newtons = (force, displacement) == ("N", "m")
        size = 260.0 if newtons else 2.0 * scales.span["force"] / scales.span["displacement"]
        source = "90 % within " + (
            "260 N/m, twice the published one" if newtons else "2 spans of force a stroke"
        )
        return (Parameter("K2", unit, "stiffness of the bias spring", either_sign(size), source),)

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        out = response(inputs)
        k = theta[..., :1]
        changed = {"force": out["force"] + k * out["displacement"]}
        if "stiffness" in out:
            changed["stiffness"] = out["stiffness"] + k
        return {**out, **changed}
