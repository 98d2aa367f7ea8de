"""Steps of an analogue-to-digital converter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.types import Inputs, Place, Response, Scales
from sma_bayes.parameters.distributions import LogNormal, Normal
from sma_bayes.parameters.space import Parameter

HARMONICS: Final = 12
"""Terms of the series; further ones are nothing once the noise is a twentieth of a step."""

LSB: Final = "lattice of the readings, 90 % within 3.3 % of a step over the whole span"
PLACE: Final = "lattice of the readings, 90 % within 1.6 % of a step"


def steps(mean: Floats, step: Floats, place: Floats, noise: Floats) -> Floats:
    """What rounding to a lattice adds to the mean of a noisy reading.

    Parameters
    ----------
    mean, step, place : ndarray
        Reading before the converter, distance of the lattice, one of its values. All arguments broadcast.
    noise : ndarray
        Standard deviation of Gaussian noise before the converter, in steps.

    Returns
    -------
    ndarray
        ``(step/pi) sum_k (-1)**k/k sin(2 pi k (mean - place)/step) exp(-2 (pi k noise)**2)``.
    """
    phase = 2.0 * np.pi * (mean - place) / step
    total = np.zeros(np.broadcast_shapes(phase.shape, noise.shape))
    for k in range(1, HARMONICS + 1):
        total += (-1.0) ** k / k * np.sin(k * phase) * np.exp(-2.0 * (np.pi * k * noise) ** 2)
    return step / np.pi * total


@dataclass(frozen=True)
class Quantisation:
    """Rounding to steps, of which noise before the converter leaves a ripple in the mean.

    It acts on force, or on displacement where there is no force. The ripple follows the reading, so the smooth curves
    of the model absorb nothing of it, and above half a step of noise nothing of it is left. Friction follows the
    direction instead; a histogram of increments shows the steps themselves.
    """

    id = "quantisation"
    title = "steps of the converter"
    equation = "F -> F + q (mean of rounding to multiples of lsb)"
    reference = (
        "Widrow and Kollar, Quantization Noise (Cambridge University Press, 2008); 14 bit over +-10 V are 1.22 mV "
        "(NI USB-6009 User Guide)"
    )
    needs = ("lattice",)
    place = Place.CONVERTER

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        channel = "force" if "force" in scales.step else "displacement"
        unit, step, place = scales.units[channel], scales.step[channel], scales.on_lattice[channel]
        many = max(scales.span[channel] / step, 1.0)
        return (
            Parameter(
                "q",
                "1",
                "share of the rounding",
                LogNormal(1.0, 0.2),
                "all of it: 90 % between 0.72 and 1.39",
            ),
            Parameter(
                "s",
                "1",
                "noise before the converter over a step",
                LogNormal(0.2, 0.5),
                "90 % between 0.088 and 0.46",
            ),
            Parameter("lsb", unit, "step", Normal(step, 0.02 * step / many), LSB),
            Parameter("F0", unit, "a value on the lattice", Normal(place, 0.01 * step), PLACE),
        )

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        out = response(inputs)
        channel = "force" if "force" in out else "displacement"
        q, noise, step, place = (theta[..., i, None] for i in range(4))
        return {**out, channel: out[channel] + q * steps(out[channel], step, place, noise)}
