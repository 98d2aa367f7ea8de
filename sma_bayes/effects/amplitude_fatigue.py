"""A stroke that fades with the number of cycles."""

from __future__ import annotations

from dataclasses import dataclass

from sma_bayes.arrays import Floats
from sma_bayes.effects.transformation import curves
from sma_bayes.effects.types import Inputs, Response, Scales
from sma_bayes.parameters.distributions import LogNormal
from sma_bayes.parameters.space import Parameter


@dataclass(frozen=True)
class AmplitudeFatigue:
    """Functional fatigue: in cycle N the stroke is ``1 - k (N - 1)`` of what it was.

    It acts on displacement, or on force where the spring is blocked and no displacement was observed: then the force
    fades. The span that is fitted takes the mean; what is left grows with the cycles at the hot end and not at the
    cold one, where training drift moves both and levels off. A long run separates the two.
    """

    id = "amplitude_fatigue"
    title = "stroke fades from cycle to cycle"
    equation = "A1 -> A1 (1 - k (N - 1))"
    reference = (
        "functional fatigue of NiTi: Eggeler, Hornbogen, Yawny, Heckmann and Wagner, "
        "Mater. Sci. Eng. A 378 (2004) 24-33; transformation strain of 8 % in one cycle, 6 % after 100 (Selected "
        "Properties of NiTi, sma-inc.com): 0.25 % of the span a cycle"
    )
    needs = ("curve", "cycles")

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        prior, source = LogNormal(1e-3, 1.4), "90 % between 0.01 and 1 % a cycle"
        return (Parameter("k", "1", "loss of stroke a cycle", prior, source),)

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        lost = theta[..., :1] * (inputs["cycle"] - 1.0)
        out, found = curves(response, inputs)
        name = "displacement" if "displacement" in found else "force"
        curve = found[name]
        return {**out, name: curve.value - lost * (curve.value - curve.cold)}
