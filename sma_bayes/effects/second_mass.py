"""A second thermal mass beside the alloy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.latent_heat import taking
from sma_bayes.effects.memory import MEMORY_TIME_CONSTANTS, elapsed, lagged
from sma_bayes.effects.types import Inputs, Response, Scales
from sma_bayes.parameters.distributions import LogNormal
from sma_bayes.parameters.space import Parameter
from sma_bayes.records.history import starts


@dataclass(frozen=True)
class SecondMass:
    """Grips, a sheath, the end coils or a bead warm up behind the alloy, and take up heat: ``C2 = q m c``.

    They follow ``tau dT2/dt = T - T2``. After a switching the temperature first goes fast and then slowly, with two
    time constants for one; over many cycles the slow one makes a drift. Each stretch begins with both equally warm.
    """

    id = "second_mass"
    title = "a second thermal mass warms up behind the alloy"
    equation = "m c dT/dt = I^2 R - h A (T - Ta) - q m c dT2/dt, tau dT2/dt = T - T2"
    reference = (
        "two bodies in contact: Incropera and DeWitt, Fundamentals of Heat and Mass Transfer (Wiley); from a bead and "
        "its glue to crimps at both ends, 5-90 % of the heat capacity of half a metre of 0.5 mm wire"
    )
    needs = ("temperature_response",)

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        heat, late = "its heat capacity over that of the alloy", "time constant of its warming"
        return (
            Parameter("q", "1", heat, LogNormal(0.2, 0.9), "90 % between 0.046 and 0.88"),
            Parameter("tau", "s", late, LogNormal(5.0, 1.0), "90 % between 0.97 and 26 s"),
        )

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        ratio, tau = theta[..., :1], np.maximum(theta[..., 1:2], 1e-12)
        steps = np.where(starts(inputs), MEMORY_TIME_CONSTANTS, elapsed(inputs) / tau)
        return response(taking(inputs, ratio * lagged(inputs["temperature"], steps)))
