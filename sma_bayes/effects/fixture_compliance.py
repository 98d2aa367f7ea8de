"""A rig that gives way under the force."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.types import Inputs, Place, Response, Scales, either_sign
from sma_bayes.parameters.space import Parameter


@dataclass(frozen=True)
class FixtureCompliance:
    """A spring in series that no drawing shows: ``X -> X + q F`` and ``1/K -> 1/K + q``.

    Where force and displacement have the same midpoint and rate, the span of the displacement absorbs it, and only a
    stiffness that was measured by itself tells; where they differ, a share of the force stays visible in the
    displacement. Where contraction is logged as positive the compliance counts as negative. A shift of the
    transformation along the path also mixes the two channels, but moves the temperature; a rigid dummy in place of the
    spring settles it.
    """

    id = "fixture_compliance"
    title = "the rig stretches in series with the spring"
    equation = "X -> X + q F, 1/K -> 1/K + q"
    reference = (
        "compliance of test machines, Kf of light rigs 1-50 N/mm: Kalidindi, Abusafieh and El-Danaf, Accurate "
        "characterization of machine compliance, Experimental Mechanics 37 (1997) 210-215"
    )
    needs = ("force", "displacement")
    place = Place.RIG

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        force, displacement = scales.units["force"], scales.units["displacement"]
        unit = f"{displacement}/{force}"
        if (force, displacement) == ("N", "m"):
            within, source = 5e-4, "90 % within 0.5 mm/N, half within 0.14 mm/N: rigs of 7 N/mm and stiffer"
        elif (force, displacement) == ("Pa", "1"):
            unit = "1/Pa"
            within, source = 1.7e-11, "90 % within 0.5 of the compliance of martensite, 30 GPa"
        else:
            within = 0.1 * scales.span["displacement"] / scales.span["force"]
            source = "90 % within 10 % of the stroke"
        return (Parameter("q", unit, "compliance of the rig, 1/Kf", either_sign(within), source),)

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        out = response(inputs)
        q = theta[..., :1]
        changed = {"displacement": out["displacement"] + q * out["force"]}
        if "stiffness" in out:
            with np.errstate(divide="ignore"):  # a stiffness of 0 stays 0
                changed["stiffness"] = 1.0 / (1.0 / out["stiffness"] + q)
        return {**out, **changed}
