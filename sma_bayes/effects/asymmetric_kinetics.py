"""Start and finish of the transformation that differ."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.transformation import curves
from sma_bayes.effects.types import Inputs, Response, Scales, either_sign
from sma_bayes.parameters.distributions import Normal
from sma_bayes.parameters.space import Parameter


@dataclass(frozen=True)
class AsymmetricKinetics:
    """Richards' curve: the share transformed is ``s**nu`` with ``nu = exp(a)`` on heating, ``exp(r a)`` on cooling.

    Only the difference between the two shoulders remains, as midpoint, rate and span absorb the rest. A transformation
    that is always sharper where it begins has r = -1; one that is sharper at the same temperature has r = 1. An error
    of contact or a fast sweep can bend a curve too: a slow sweep in an oven separates them.
    """

    id = "asymmetric_kinetics"
    title = "start and finish of the transformation differ"
    equation = "s -> s^nu, ln nu = a on heating, r a on cooling"
    reference = "Richards, A flexible growth function for empirical use, J. Exp. Bot. 10 (1959) 290-301"
    needs = ("curve",)

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        size, ratio = either_sign(0.64), Normal(0.0, 1.0)
        return (
            Parameter("a", "1", "logarithm of the exponent", size, "nu of 0.5-2: 90 % between 0.53 and 1.9"),
            Parameter(
                "r",
                "1",
                "the same on cooling over heating",
                ratio,
                "either sense is as likely: 90 % within 1.6",
            ),
        )

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        a = theta[..., :1] * np.where(inputs["branch"] > 0.0, 1.0, theta[..., 1:2])
        out, found = curves(response, inputs)
        nu = np.exp(np.clip(a, -10.0, 10.0))
        return {**out, **{n: c.value + c.span * (c.share**nu - c.share) for n, c in found.items()}}
