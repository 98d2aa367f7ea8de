"""A spring whose ends are cooler than its middle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.memory import elapsed, lagged
from sma_bayes.effects.transformation import at
from sma_bayes.effects.types import Inputs, Response, Scales
from sma_bayes.parameters.distributions import LogNormal
from sma_bayes.parameters.space import Parameter

ROOM: Final = 22.0
"""Temperature of the grips where no ambient temperature was recorded [degC]."""
ENDS: Final = 8.0
"""How much cooler the ends are at the greatest distance from the temperature of the grips, median [K]."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(7)
PLACES: Final = 0.5 * (_NODES + 1.0)
SHARES: Final = 0.5 * _WEIGHTS


@dataclass(frozen=True)
class TemperatureGradient:
    """Grips cool the ends: at the distance x from the middle (1 at the ends) ``T(x) = T - D x**2``.

    The deficit D follows the excess of the middle over the room with the thermal time constant of the wire,
    ``tau dD/dt = g (T - Ta) - D``; where time was not recorded it is there at once. Force and displacement are
    averages along the spring. Most of the smearing looks like a slower curve and goes into the rates; what is left is
    the skew, because only part of the spring is late, and what the rate changes in it. An error of contact shifts
    without skew; several peak temperatures or an infrared line separate the two.
    """

    id = "temperature_gradient"
    title = "ends of the spring are cooler than its middle"
    equation = "average over x of the response at T - D x^2, tau dD/dt = g (T - Ta) - D"
    reference = (
        "parabola of a conducting wire between heat sinks (Carslaw and Jaeger, Conduction of Heat in Solids, 1959); "
        "2-20 K between middle and ends"
    )
    needs = ("channel", "several_peaks")

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        excess = max(abs(scales.high["temperature"] - ROOM), abs(scales.low["temperature"] - ROOM), ENDS)
        prior = LogNormal(ENDS / excess, 0.7)
        source = "90 % between 2.5 and 25 K at the temperature farthest from ambient"
        wire = LogNormal(8.0, 0.8)
        return (
            Parameter("g", "1", "cooling of the ends over the excess", prior, source),
            Parameter(
                "tau", "s", "thermal time constant of the wire", wire, "in air, 90 % between 2.1 and 30 s"
            ),
        )

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        temperature = inputs["temperature"]
        excess = temperature - inputs.get("ambient_temperature", np.array(ROOM))
        late = lagged(excess, elapsed(inputs) / theta[..., 1:2]) if "time" in inputs else excess
        ends = theta[..., :1] * late
        along = [response(at(inputs, temperature - ends * x**2)) for x in PLACES.tolist()]
        out = {
            c: np.asarray(sum(share * part[c] for share, part in zip(SHARES.tolist(), along, strict=True)))
            for c in along[0]
        }
        return {**out, "temperature": response(inputs)["temperature"]} if "temperature" in out else out
