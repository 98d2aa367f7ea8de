"""A load cell or amplifier at the end of its range."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sma_bayes.effects.types import Inputs, Response, Scales
from sma_bayes.parameters.distributions import LogNormal, Normal
from sma_bayes.parameters.space import Parameter
from sma_bayes.quantities import Floats


@dataclass(frozen=True)
class Saturation:
    """Force above the end of the range is lost: ``F -> F - w max(F - Fmax, 0)``, all of it for w = 1.

    A lower span absorbs the missing top, at the price of the upper shoulder, which is cut in the data and round in the
    model. A bias spring changes the whole curve instead. Another range of the amplifier settles it.
    """

    id = "saturation"
    title = "load cell or converter at the end of its range"
    equation = "F -> F - w max(F - Fmax, 0)"
    reference = (
        "an ideal limiter; an input beyond the range of a converter returns its end (NI USB-6009 User Guide)"
    )
    needs = ("force", "flat_tops")

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        top = Normal(scales.high["force"], 0.01 * scales.span["force"])
        share = LogNormal(1.0, 0.2)
        return (
            Parameter("w", "1", "share of the excess that is lost", share, "all of it, within 20 %"),
            Parameter(
                "Fmax",
                scales.units["force"],
                "end of the range",
                top,
                "the highest readings, if they are cut",
            ),
        )

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        out = response(inputs)
        excess = np.maximum(out["force"] - theta[..., 1:2], 0.0)
        return {**out, "force": out["force"] - theta[..., :1] * excess}
