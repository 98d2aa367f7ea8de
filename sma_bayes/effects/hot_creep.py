"""Creep while the alloy is hot."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.effects.memory import elapsed
from sma_bayes.effects.transformation import measured
from sma_bayes.effects.types import Inputs, Response, Scales, either_sign
from sma_bayes.parameters.distributions import LogNormal
from sma_bayes.parameters.space import Parameter
from sma_bayes.quantities import Floats

REFERENCE: Final = 100.0
"""Temperature at which the rate of creep is given [degC]."""
WIDTH: Final = 14.0
"""Kelvins in which the rate of creep grows e-fold, median."""
HOTTEST: Final = 100.0
"""Bound of the exponent, far beyond any measurement."""


@dataclass(frozen=True)
class HotCreep:
    """Thermally activated flow: ``dX/dt = c exp((T - 100 degC)/w)``, added up along the history.

    The offset takes the mean; what is left grows with the time spent hot, and within a cycle only at its hot end.
    Training drift counts cycles instead, and levels off; a hot hold, or cycles to a low peak, tell them apart. Over a
    break of the record the alloy is taken to rest.
    """

    id = "hot_creep"
    title = "creep while the alloy is hot"
    equation = "dX/dt = c exp((T - 100 degC)/w)"
    reference = (
        "creep of NiTi: Eggeler, Khalil-Allafi, Neuking and Dlouhy, Z. Metallkd. 93 (2002) 654-660; together with "
        "transformation: Lagoudas, Chatzigeorgiou and Kumar, J. Intell. Mater. Syst. Struct. 20 (2009) 2257-2267"
    )
    needs = ("displacement", "time")

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        cooler = math.exp(-(scales.high["temperature"] - REFERENCE) / WIDTH)
        whole = 0.5 * scales.span["displacement"] / scales.span["time"]
        return (
            Parameter(
                "c", f"{scales.units['displacement']}/s", "rate of creep at 100 degC", either_sign(whole * cooler),
                "of either sign; a tenth of the stroke if a fifth of the record is hot",
            ),
            Parameter(
                "w", "K", "kelvins in which the rate grows e-fold", LogNormal(WIDTH, 0.2),
                "10-20 K; 90 % between 10 and 19 K, an activation energy of 60-120 kJ/mol at 100 degC",
            ),
        )  # fmt: skip

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        out = response(inputs)
        exponent = (measured(inputs) - REFERENCE) / theta[..., 1:2]
        rate = np.exp(np.minimum(exponent, HOTTEST))
        before = np.concatenate([rate[..., :1], rate[..., :-1]], axis=-1)
        strain = np.cumsum(0.5 * (rate + before) * elapsed(inputs), axis=-1)
        return {**out, "displacement": out["displacement"] + theta[..., :1] * strain}
