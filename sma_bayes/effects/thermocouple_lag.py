"""A sensor that trails the metal."""

from __future__ import annotations

from dataclasses import dataclass

from sma_bayes.arrays import Floats
from sma_bayes.effects.transformation import at
from sma_bayes.effects.types import Inputs, Place, Response, Scales
from sma_bayes.parameters.distributions import LogNormal
from sma_bayes.parameters.space import Parameter


@dataclass(frozen=True)
class ThermocoupleLag:
    """First-order lag ``tau dTm/dt = T - Tm``: the metal is at ``T = Tm + tau dTm/dt`` when the sensor reads ``Tm``.

    At a constant rate on each branch that is a shift of the curve, which its midpoint absorbs; it shows where the rate
    differs at the same temperature: other currents, a step-off, the rounded ends of a sweep. A transformation that
    lags moves the curves the other way; infrared, or a step-off above the transformation, shows the sensor alone. A
    simulated temperature goes through the same lag.
    """

    id = "thermocouple_lag"
    title = "sensor lags behind the metal"
    equation = "T = Tm + tau dTm/dt"
    reference = (
        "first-order response of a temperature sensor, tau 0.05-5 s from a fine junction in contact to a beaded "
        "thermocouple in still air: ASTM MNL12, Manual on the Use of Thermocouples in Temperature Measurement (1993)"
    )
    needs = ("outcome", "several_rates")
    place = Place.SENSOR

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        prior = LogNormal(0.5, 1.2)
        return (Parameter("tau", "s", "time constant of the sensor", prior, "90 % between 0.07 and 3.6 s"),)

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        tau, read = theta[..., :1], inputs["temperature"]
        lag = tau + inputs.get("sensor_lag", 0.0)
        return response(
            {**at(inputs, read + tau * inputs["rate"]), "sensor_lag": lag, "read": inputs.get("read", read)}
        )
