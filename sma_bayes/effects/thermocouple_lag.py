"""A sensor that trails the metal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.memory import MEMORY_TIME_CONSTANTS, elapsed, lagged
from sma_bayes.effects.transformation import at
from sma_bayes.effects.types import Inputs, Place, Response, Scales
from sma_bayes.parameters.distributions import HalfNormal, LogNormal
from sma_bayes.parameters.space import Parameter
from sma_bayes.records.history import starts

LEAST: Final = 1e-12
"""Least time constant of the mount that is reckoned with [s]."""


@dataclass(frozen=True)
class ThermocoupleLag:
    """First-order lag of the junction, ``tau dTj/dt = T - Tj``, and a part of its heat by way of a slow mount.

    The mount is m times as slow, ``m tau dTs/dt = Tj - Ts``, and the sensor reads ``Tm = (Tj + q Ts)/(1 + q)``.

    At a constant rate on each branch the lag is a shift of the curve, which its midpoint absorbs; it shows where the
    rate differs at the same temperature: other currents, a step-off, the rounded ends of a sweep. The mount moves whole
    cycles until it is as warm as it gets. A transformation that lags moves the curves the other way; infrared, or a
    step-off above the transformation, shows the sensor alone. Each stretch begins with all of it equally warm.

    A simulated temperature goes through the same lag. Where temperature is an outcome a second thermal mass makes such
    slow parts, and the sensor has no mount.
    """

    id = "thermocouple_lag"
    title = "sensor lags behind the metal"
    equation = "T = Tj + tau dTj/dt, Tj = Tm + q (Tm - Ts), m tau dTs/dt = Tj - Ts"
    reference = (
        "first-order response of a temperature sensor, tau 0.05-5 s from a fine junction in contact to a beaded "
        "thermocouple in still air, and heat along its leads and mount: ASTM MNL12, Manual on the Use of Thermocouples "
        "in Temperature Measurement (1993)"
    )
    needs = ("outcome", "several_rates")
    place = Place.SENSOR

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        lag, part, slow = LogNormal(0.5, 1.2), HalfNormal(0.06), LogNormal(100.0, 1.2)
        few = "a few per cent: 90 % between 0.0038 and 0.12"
        junction = Parameter("tau", "s", "time constant of the junction", lag, "90 % between 0.07 and 3.6 s")
        if "temperature" in scales.step:
            return (junction,)
        return (
            junction,
            Parameter("q", "1", "mount over junction in what is read", part, few, refines=True),
            Parameter(
                "m", "1", "time constant of the mount over tau", slow, "90 % between 14 and 720", refines=True
            ),
        )

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        tau, read, rate = theta[..., :1], inputs["temperature"], inputs["rate"]
        junction = read
        if theta.shape[-1] > 1:
            junction, rate = _of_junction(read, rate, tau, theta[..., 1:2], theta[..., 2:3], inputs)
        lag = tau + inputs.get("sensor_lag", 0.0)
        return response(
            {**at(inputs, junction + tau * rate), "sensor_lag": lag, "read": inputs.get("read", read)}
        )


def _of_junction(
    read: Floats, rate: Floats, tau: Floats, share: Floats, slower: Floats, inputs: Inputs
) -> tuple[Floats, Floats]:
    """Temperature of the junction, and how fast it changes, of a sensor that reads its mount as well."""
    mount = np.maximum(slower * tau, LEAST)
    passed = np.where(starts(inputs), MEMORY_TIME_CONSTANTS, elapsed(inputs) / mount)
    behind = read - lagged(read, (1.0 + share) * passed)
    return read + share * behind, rate + share * (rate - (1.0 + share) * behind / mount)
