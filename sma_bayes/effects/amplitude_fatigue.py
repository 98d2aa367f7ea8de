"""A stroke that fades with the number of cycles."""

from __future__ import annotations

from dataclasses import dataclass

from sma_bayes.effects.transformation import curves
from sma_bayes.effects.types import EffectParameter, Inputs, Response, Scales
from sma_bayes.parameters.distributions import LogNormal
from sma_bayes.quantities import Floats


@dataclass(frozen=True)
class AmplitudeFatigue:
    """Functional fatigue: the spans of force and displacement are ``1 - k (N - 1)`` of their own in cycle N.

    The span that is fitted takes the mean; what is left grows with the cycles at the hot end and not at the cold one,
    where training drift moves both and levels off. A long run separates the two.
    """

    id = "amplitude_fatigue"
    title = "span fades from cycle to cycle"
    equation = "B1, A1 -> (1 - k (N - 1)) of themselves"
    reference = (
        "functional fatigue of NiTi: Eggeler, Hornbogen, Yawny, Heckmann and Wagner, "
        "Mater. Sci. Eng. A 378 (2004) 24-33; transformation strain of 8 % in one cycle, 6 % after 100 (Selected "
        "Properties of NiTi, sma-inc.com): 0.25 % of the span a cycle"
    )
    needs = ("curve", "cycles")

    def parameters(self, scales: Scales) -> tuple[EffectParameter, ...]:
        prior, source = LogNormal(1e-3, 1.4), "0.01-1 % a cycle, 90 %"
        return (EffectParameter("k", "1", "loss of span a cycle", prior, source),)

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        lost = theta[..., :1] * (inputs["cycle"] - 1.0)
        out, found = curves(response, inputs)
        return {**out, **{name: c.value - lost * (c.value - c.cold) for name, c in found.items()}}
