"""A load cell whose zero wanders in time."""

from __future__ import annotations

from dataclasses import dataclass

from sma_bayes.arrays import Floats
from sma_bayes.effects.types import Inputs, Place, Response, Scales, either_sign
from sma_bayes.parameters.space import Parameter


@dataclass(frozen=True)
class SensorDrift:
    """Linear drift of the zero: ``F -> F + r t``."""

    id = "sensor_drift"
    title = "zero of the load cell drifts in time"
    equation = "F -> F + r t"
    reference = (
        "creep and zero drift of strain-gauge load cells, some 0.02-0.05 % of full scale in 30 min when loaded "
        "(OIML R 60, 2017); more for uncompensated cells, so the prior allows a drift of 5 % of the span of force"
    )
    needs = ("force", "time")
    place = Place.SENSOR

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        prior = either_sign(0.05 * scales.span["force"] / scales.span["time"])
        unit = f"{scales.units['force']}/s"
        return (
            Parameter(
                "r", unit, "rate of the drift", prior, "90 % within 5 % of the span of force over the record"
            ),
        )

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        out = response(inputs)
        return {**out, "force": out["force"] + theta[..., :1] * inputs["time"]}
