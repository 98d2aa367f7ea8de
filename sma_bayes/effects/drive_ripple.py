"""Pick-up of the drive in the measured channel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.types import Inputs, Place, Response, Scales, either_sign
from sma_bayes.parameters.distributions import Normal, Uniform
from sma_bayes.parameters.space import Parameter

HARMONICS: Final = 8
"""Highest harmonic."""
OVERTONE: Final = Normal(0.0, 0.2)
"""Prior of either part of the first overtone, as shares of the amplitude."""
SMALL: Final = "small: 90 % within 0.33 of the amplitude"


@dataclass(frozen=True)
class DriveRipple:
    """Pick-up at a harmonic of the drive and its first overtone.

    ``F -> F + a (sin u + p sin 2u + q cos 2u)`` with ``u = 2 pi k f t + phi``: a drive that is switched is no pure
    sine. It acts on force, or on displacement where there is no force. For the sake of the fit k may lie between two
    whole numbers, where it mixes the two (weights ``cos(pi (k - j)/2)**2``); only whole numbers are meant. A drive that
    sets the temperature makes temperature periodic as well, so the sigmoids absorb part of the lowest harmonic. Nothing
    else keeps the phase of the drive; a supply from batteries settles it.
    """

    id = "drive_ripple"
    title = "pick-up of the drive in the signal"
    equation = "F -> F + a (sin u + p sin 2u + q cos 2u), u = 2 pi k f t + phi"
    reference = (
        "coupling of switched currents into low-level signals: Ott, Electromagnetic Compatibility Engineering "
        "(Wiley, 2009)"
    )
    needs = ("curve", "time", "frequency")
    place = Place.SENSOR

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        channel = "force" if "force" in scales.step else "displacement"
        half = 0.5 * np.pi
        size = either_sign(0.03 * scales.span[channel])
        return (
            Parameter(
                "a", scales.units[channel], "amplitude", size, "a few per cent: 90 % within 3 % of the span"
            ),
            Parameter(
                "phi",
                "rad",
                "phase",
                Uniform(-half, half),
                "any from -1.571 to 1.571 rad, as the amplitude has a sign",
            ),
            Parameter(
                "k",
                "1",
                "harmonic",
                Uniform(0.5, HARMONICS + 0.5),
                "first to eighth, and half of one on either side: from 0.5 to 8.5",
            ),
            Parameter("p", "1", "overtone in phase", OVERTONE, SMALL, refines=True),
            Parameter("q", "1", "overtone out of phase", OVERTONE, SMALL, refines=True),
        )

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        out = response(inputs)
        channel = "force" if "force" in out else "displacement"
        a, phi, k, p, q = (theta[..., i, None] for i in range(5))
        turn = 2.0 * np.pi * inputs["frequency"] * inputs["time"]
        ripple = np.zeros(np.broadcast_shapes(turn.shape, phi.shape))
        for j in range(1, HARMONICS + 1):
            weight = np.cos(0.5 * np.pi * np.clip(k - j, -1.0, 1.0)) ** 2
            u = j * turn + phi
            ripple += weight * (np.sin(u) + p * np.sin(2.0 * u) + q * np.cos(2.0 * u))
        return {**out, channel: out[channel] + a * ripple}
