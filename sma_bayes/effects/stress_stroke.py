"""A stroke that grows with the load."""

from __future__ import annotations

from dataclasses import dataclass

from sma_bayes.arrays import Floats
from sma_bayes.effects.transformation import curves, stretched
from sma_bayes.effects.types import Inputs, Response, Scales
from sma_bayes.parameters.distributions import LogNormal
from sma_bayes.parameters.space import Parameter


@dataclass(frozen=True)
class StressStroke:
    """A greater load orients more of the martensite, so that the cold alloy yields further; hot it is where it was.

    Each condition's own A1 and A4 absorb it completely; it shows where one set of parameters serves several loads. The
    stiffness, dF/dX, falls as the stroke grows.
    """

    id = "stress_stroke"
    title = "stroke grows with the load"
    equation = "X(T) -> X_hot + (1 + k load) (X(T) - X_hot)"
    reference = (
        "transformation strain that grows with stress until martensite is oriented: Lagoudas, Hartl, Chemisky, Machado "
        "and Popov, Int. J. Plast. 32-33 (2012) 155-183, H_cur between H_min and H_sat"
    )
    needs = ("curve", "displacement", "several_loads")

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        prior = LogNormal(0.5 / scales.level["load"], 1.4, scales.direction("load"))
        source = "what the greatest load adds to the stroke at no load, 90 % between 5 and 500 %"
        unit = "Pa" if scales.specimen else "N"
        return (
            Parameter(
                "k", f"1/{unit}", "growth of the stroke a load, over the stroke at none", prior, source
            ),
        )

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        grown = 1.0 + theta[..., :1] * inputs["load"]
        out, found = curves(response, inputs)
        curve = found["displacement"]
        return stretched(out, curve, curve.cold + curve.span, grown)
