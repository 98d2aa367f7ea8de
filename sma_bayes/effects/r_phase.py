"""A transformation in two steps, by way of the R-phase."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from scipy.special import expit

from sma_bayes.arrays import Floats
from sma_bayes.effects.transformation import curves
from sma_bayes.effects.types import Inputs, Response, Scales
from sma_bayes.parameters.distributions import LogNormal, Uniform
from sma_bayes.parameters.space import Parameter

HYSTERESIS: Final = 3.0
"""Hysteresis of the R-phase, which is known better than these data could tell [K]."""


@dataclass(frozen=True)
class RPhase:
    """B2-R-B19': a share p of the span comes in a step of its own, at nearly the same temperature on both branches.

    A step near the midpoint of a branch only changes its rate; elsewhere it leaves a wave that no single sigmoid
    follows. That it stands at one temperature while the main steps stand tens of kelvins apart tells it from a
    temperature gradient; calorimetry settles it. A curve of one stage that is skewed, has long tails or sloped phases
    looks much the same, so it has to be worth more than such a shape before it is named.
    """

    id = "r_phase"
    title = "transformation in two steps, by way of the R-phase"
    equation = "s -> (1 - p) s + p/(1 + exp(-(T - TR -/+ 1.5 K)/w))"
    reference = (
        "R-phase of NiTi: hysteresis of 1-5 K and a tenth of the transformation strain, Otsuka and Ren, "
        "Prog. Mater. Sci. 50 (2005) 511-678"
    )
    needs = ("curve", "both_branches")
    further_stage = True

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        place = Uniform(scales.low["temperature"], scales.high["temperature"])
        width = LogNormal(1.5, 0.5)
        return (
            Parameter("p", "1", "share of the span", LogNormal(0.08, 0.6), "3-20 %: 90 % between 3 and 21 %"),
            Parameter(
                "TR",
                "degC",
                "temperature of the step",
                place,
                "anywhere from 0 to 100 % of the measured range",
            ),
            Parameter(
                "w",
                "K",
                "width of the step",
                width,
                "from 10 to 90 % (4.4 w) some 3-15 K by calorimetry: 90 % between 0.66 and 3.4 K",
            ),
        )

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        p, place, width = (theta[..., i, None] for i in range(3))
        step = expit((inputs["temperature"] - place - 0.5 * HYSTERESIS * inputs["branch"]) / width)
        out, found = curves(response, inputs)
        return {**out, **{n: c.value + p * c.span * (step - c.share) for n, c in found.items()}}
