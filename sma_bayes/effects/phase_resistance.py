"""A resistance that depends on the phase."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.types import Inputs, Response, Scales, either_sign
from sma_bayes.parameters.space import Parameter


@dataclass(frozen=True)
class PhaseResistance:
    """Martensite and austenite differ in resistance: ``R -> R (1 + r (s - 1/2))``, s the share of austenite.

    Gain is then that half way. It shows while the current is on only: the same current heats one phase more than the
    other. Latent heat shows within the transformation, and while cooling as well. Where voltage or resistance were
    recorded the change is known, and is used in the heat balance.
    """

    id = "phase_resistance"
    title = "resistance depends on the phase"
    equation = "R -> R (1 + r (s - 1/2))"
    reference = (
        "Novak, Sittner, Dayananda, Braz-Fernandes and Mahesh, Electric resistance variation of NiTi shape memory "
        "alloy wires in thermomechanical tests, Mater. Sci. Eng. A 481-482 (2008) 127-133; changes of 10-20 % between "
        "phases, of either sign with stress and R-phase"
    )
    needs = ("temperature_response", "share", "resistance_unknown")

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        meaning = "resistance of austenite less that of martensite, over the mean"
        return (Parameter("r", "1", meaning, either_sign(0.3), "90 % within 0.3"),)

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        factor = np.maximum(1.0 + theta[..., :1] * (inputs["share"] - 0.5), 0.01)
        return response({**inputs, "resistance_factor": factor * inputs.get("resistance_factor", np.ones(1))})
