"""A load cell whose zero follows its temperature."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.memory import elapsed, lagged
from sma_bayes.effects.transformation import measured
from sma_bayes.effects.types import Inputs, Place, Response, Scales, either_sign
from sma_bayes.parameters.distributions import LogNormal
from sma_bayes.parameters.space import Parameter

CAPACITY: Final = 5.0
"""Capacity of a load cell over the greatest force measured with it."""
ROOM: Final = 22.0
"""Ambient temperature where none was recorded; any constant one gives the same [degC]."""


@dataclass(frozen=True)
class LoadCellThermalDrift:
    """Zero that follows the cell: ``F -> F + k (Tc - Tc0)``, ``tau dTc/dt = Ta + soak (T - Ta) - Tc``.

    A share of the alloy's heat soaks into the cell, and a change of the ambient temperature reaches it as a whole. The
    cell begins in balance, and over a break stays as it is. Offsets take the mean; a cell that was tared in one room
    and used in another shows as a difference between conditions. A zero that drifts in time alone
    follows neither; heating the rig without a spring tells the two apart.
    """

    id = "load_cell_thermal_drift"
    title = "zero of the load cell follows its temperature"
    equation = "F -> F + k (Tc - 22 degC), tau dTc/dt = Ta + soak (T - Ta) - Tc"
    reference = (
        "zero of strain-gauge load cells, 0.005 to 0.025 % of capacity a kelvin on data sheets (HBM, temperature "
        "coefficient of the zero point; Load Cell Shop, temperature effects), more where uncompensated"
    )
    needs = ("force", "time", "warming_cell")
    place = Place.SENSOR

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        size = either_sign(5e-4 * CAPACITY * scales.level["force"])
        time, soak = LogNormal(300.0, 1.0), LogNormal(0.1, 1.0)
        whole = "90 % within 0.05 % of a capacity of 5 times the greatest force"
        return (
            Parameter("k", f"{scales.units['force']}/K", "zero over temperature", size, whole),
            Parameter("tau", "s", "time constant of the cell", time, "90 % between 0.97 and 26 min"),
            Parameter("soak", "1", "share of the heat that arrives", soak, "90 % between 1.9 and 52 %"),
        )

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        out = response(inputs)
        ambient = inputs.get("ambient_temperature", np.array(ROOM))
        source = ambient + theta[..., 2:3] * (measured(inputs) - ambient)
        cell = lagged(source, elapsed(inputs) / theta[..., 1:2])
        return {**out, "force": out["force"] + theta[..., :1] * (cell - ROOM)}
