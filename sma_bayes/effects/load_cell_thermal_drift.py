"""A load cell whose zero follows its temperature."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.effects.memory import elapsed, lagged
from sma_bayes.effects.transformation import measured
from sma_bayes.effects.types import EffectParameter, Inputs, Response, Scales
from sma_bayes.parameters.distributions import LogNormal, Normal
from sma_bayes.quantities import Floats

CAPACITY: Final = 5.0
"""Capacity of a load cell over the greatest force measured with it."""
SOAKED: Final = 0.1
"""Share of the alloy's excess of temperature that reaches the cell."""


@dataclass(frozen=True)
class LoadCellThermalDrift:
    """Zero that follows the cell: ``F -> F + k (Tc - Tc0)``, ``tau dTc/dt = Ts - Tc``.

    The source Ts is the ambient temperature where it was recorded, otherwise the heat of the alloy that soaks into
    the cell, of which k then contains the share that arrives. The cell begins at the first value of its source; over a
    break it stays as it is. Offsets take the mean. A zero that only drifts in time does not follow the temperature:
    heating the rig without a spring tells the two apart.
    """

    id = "load_cell_thermal_drift"
    title = "zero of the load cell follows its temperature"
    equation = "F -> F + k (Tc - Tc0), tau dTc/dt = Ts - Tc"
    reference = (
        "zero of strain-gauge load cells, 0.005 to 0.025 % of capacity a kelvin on data sheets (HBM, temperature "
        "coefficient of the zero point; Load Cell Shop, temperature effects), more where uncompensated"
    )
    needs = ("force", "time", "warming_cell")

    def parameters(self, scales: Scales) -> tuple[EffectParameter, ...]:
        share = 1.0 if "ambient_temperature" in scales.span else SOAKED
        prior = Normal(0.0, 5e-4 * share * CAPACITY * scales.level["force"])
        source = "0.05 % of a capacity of 5 times the greatest force" + (
            "" if share == 1.0 else "; a tenth of the heat arrives"
        )
        time = LogNormal(300.0, 1.0)
        return (
            EffectParameter("k", f"{scales.units['force']}/K", "zero over temperature", prior, source),
            EffectParameter(
                "tau", "s", "time constant of the cell", time, "minutes: 90 % between 1 and 26 min"
            ),
        )

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        out = response(inputs)
        source = inputs.get("ambient_temperature", measured(inputs))
        cell = lagged(np.asarray(source), elapsed(inputs) / theta[..., 1:2])
        return {**out, "force": out["force"] + theta[..., :1] * (cell - source[..., :1])}
