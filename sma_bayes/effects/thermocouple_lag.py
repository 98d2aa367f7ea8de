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
    step-off above the transformation, shows the sensor alone. A simulated temperature goes through the same sensor.
    Each stretch begins with all of it equally warm. Where temperature is an outcome, second thermal masses make such
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
        own = Parameter("tau", "s", "time constant of the junction", lag, "90 % between 0.07 and 3.6 s")
        if "temperature" in scales.step:
            return (own,)
        return (
            own,
            Parameter("q", "1", "mount over junction in what is read", part, few, refines=True),
            Parameter(
                "m", "1", "time constant of the mount over tau", slow, "90 % between 14 and 720", refines=True
            ),
        )

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        if theta.shape[-1] == 1:
            theta = np.concatenate([theta, np.zeros_like(theta), np.ones_like(theta)], axis=-1)
        tau, q, slower = (theta[..., i : i + 1] for i in range(3))
        mount = np.maximum(slower * tau, LEAST)
        passed = elapsed(inputs) / mount
        passed = np.where(starts(inputs), MEMORY_TIME_CONSTANTS, passed)

        def behind(read: Floats) -> Floats:
            """What the mount is behind the reading, shape (..., n)."""
            return read - lagged(read, (1.0 + q) * passed)

        read = inputs["temperature"]
        late = behind(read)
        junction = read + q * late
        rate = inputs["rate"] + q * (inputs["rate"] - (1.0 + q) * late / mount)
        given = at(inputs, junction + tau * rate)
        given["sensor_lag"] = tau + inputs.get("sensor_lag", 0.0)
        known = inputs.get("read", read)
        given["read"] = known + q * behind(known)
        out = response(given)
        if "temperature" in out:
            warm = out["temperature"]
            out = {**out, "temperature": (warm + q * lagged(warm, passed)) / (1.0 + q)}
        return out
