"""A load cell or amplifier at the end of its range."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.types import Inputs, Place, Response, Scales
from sma_bayes.parameters.distributions import LogNormal, Normal
from sma_bayes.parameters.space import Parameter


@dataclass(frozen=True)
class Saturation:
    """Force above the end of the range is lost: ``F -> F - w max(F - Fmax, 0)``, all of it for w = 1.

    Where pull is logged as negative, the end of the range is negative, and what lies below it is lost. A lower span
    absorbs the missing top, at the price of the upper shoulder, which is cut in the data and round in the model. A bias
    spring changes the whole curve instead. Another range of the amplifier settles it.
    """

    id = "saturation"
    title = "load cell or converter at the end of its range"
    equation = "F -> F - w max(F - Fmax, 0)"
    reference = (
        "an ideal limiter; an input beyond the range of a converter returns its end (NI USB-6009 User Guide)"
    )
    needs = ("force", "flat_tops")
    place = Place.RANGE

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        end = scales.high["force"] if scales.direction("force") > 0.0 else scales.low["force"]
        top = Normal(end, 0.01 * scales.span["force"])
        share = LogNormal(1.0, 0.2)
        return (
            Parameter(
                "w", "1", "share of the excess that is lost", share, "all of it: 90 % between 0.72 and 1.39"
            ),
            Parameter(
                "Fmax",
                scales.units["force"],
                "end of the range",
                top,
                "the farthest readings, if they are cut: 90 % within 1.6 % of the span",
            ),
        )

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        out = response(inputs)
        end = theta[..., 1:2]
        beyond = out["force"] - end
        excess = np.where(end < 0.0, np.minimum(beyond, 0.0), np.maximum(beyond, 0.0))
        return {**out, "force": out["force"] - theta[..., :1] * excess}
