"""Creep while the alloy is hot."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.memory import elapsed
from sma_bayes.effects.transformation import measured
from sma_bayes.effects.types import Inputs, Response, Scales, either_sign
from sma_bayes.parameters.distributions import LogNormal
from sma_bayes.parameters.space import Parameter

REFERENCE: Final = 100.0
"""Temperature at which the rate of creep is given [degC]."""
ENERGY: Final = 141e3
"""Apparent activation energy, median [J/mol]."""
GAS: Final = 8.314462618
"""Gas constant [J/(mol K)]."""
KELVIN: Final = 273.15
"""0 degC [K]."""
HOTTEST: Final = 100.0
"""Bound of the exponent, far beyond any measurement."""


@dataclass(frozen=True)
class HotCreep:
    """Thermally activated flow: ``dX/dt = c exp((T - 100 degC)/w)``, added up along the history.

    Over the kelvins of a hot end that is Arrhenius' law, with ``w = R T**2/Q`` at the absolute temperature T there. The
    offset takes the mean; what is left grows with the time spent hot, and within a cycle only at its hot end.
    Training drift counts cycles instead, and levels off; a hot hold, or cycles to a low peak, tell them apart. Over a
    break of the record the alloy is taken to rest.
    """

    id = "hot_creep"
    title = "creep while the alloy is hot"
    equation = "dX/dt = c exp((T - 100 degC)/w)"
    reference = (
        "creep of NiTi, Q = 155 kJ/mol above 950 degC: Oppenheimer, Yung and Dunand, Scripta Mater. 57 (2007) 377-380; "
        "334 kJ/mol near 500 degC: Kobus, Neuking, Eggeler and Wittkowsky, Prakt. Metallogr. 39 (2002) 177-186; "
        "with transformation: Lagoudas, Chatzigeorgiou and Kumar, J. Intell. Mater. Syst. Struct. 20 (2009) 2257-2267"
    )
    needs = ("displacement", "time")

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        hottest = scales.high["temperature"]
        width = GAS * (hottest + KELVIN) ** 2 / ENERGY
        cooler = math.exp(-(hottest - REFERENCE) / width)
        whole = 0.5 * scales.span["displacement"] / scales.span["time"]
        return (
            Parameter(
                "c", f"{scales.units['displacement']}/s", "rate of creep at 100 degC", either_sign(whole * cooler),
                "90 % within a tenth of the stroke if a fifth of the record is hottest",
            ),
            Parameter(
                "w", "K", "kelvins in which the rate grows e-fold", LogNormal(width, 0.52),
                "R T^2/Q at the hottest reading, 90 % between 60 and 330 kJ/mol: 155-334 measured, less under stress",
            ),
        )  # fmt: skip

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        out = response(inputs)
        exponent = (measured(inputs) - REFERENCE) / theta[..., 1:2]
        rate = np.exp(np.minimum(exponent, HOTTEST))
        before = np.concatenate([rate[..., :1], rate[..., :-1]], axis=-1)
        strain = np.cumsum(0.5 * (rate + before) * elapsed(inputs), axis=-1)
        return {**out, "displacement": out["displacement"] + theta[..., :1] * strain}
