"""Strain that is left behind in every cycle until the alloy is trained."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.types import Inputs, Response, Scales, either_sign
from sma_bayes.parameters.distributions import LogNormal
from sma_bayes.parameters.space import Parameter

CYCLES: Final = 12.0
"""Cycles to train, median."""


def trained(inputs: Inputs, pace: Floats) -> Floats:
    """Share of the way from the first to the last measured cycle, ``(1 - exp(-(N - 1)/N0))/(1 - exp(-(L - 1)/N0))``.

    Parameters
    ----------
    inputs : mapping of str to ndarray, shape (n,)
    pace : ndarray, shape (..., 1)
        Cycles to train N0.

    Returns
    -------
    ndarray, shape (..., n)
    """
    share = np.expm1(-(inputs["cycle"] - 1.0) / pace) / np.expm1(-(inputs["last_cycle"] - 1.0) / pace)
    return np.asarray(share)


@dataclass(frozen=True)
class TrainingDrift:
    """Shakedown: ``X -> X + d (1 - exp(-(N - 1)/N0))/(1 - exp(-(L - 1)/N0))`` in cycle N, the same in both plateaus.

    The drift d is that from the first to the last cycle L that was measured, which the measurements tell; what a fully
    trained spring has, ``d/(1 - exp(-(L - 1)/N0))``, hangs on N0. An offset takes its mean; what is left is how the
    cycles differ. Creep also adds to the displacement, but while the alloy is hot, not from cycle to cycle; fading of
    the span leaves one plateau where it is. Cycles to a low peak temperature train without creep. Where conditions
    follow each other on one spring, later ones begin trained, and their cycle numbers should say so.
    """

    id = "training_drift"
    title = "residual strain grows until the alloy is trained"
    equation = "X -> X + d (1 - exp(-(N - 1)/N0))/(1 - exp(-(L - 1)/N0)), L the last cycle"
    reference = (
        "Stabilizing shape memory alloy actuator performance through cyclic shakedown: an empirical study "
        "(Proc. SPIE: exponential approach within tens to hundreds of cycles); Lagoudas, Shape Memory Alloys "
        "(Springer, 2008)"
    )
    needs = ("displacement", "cycles")

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        last = scales.level["last_cycle"]
        shown = -math.expm1(-(last - 1.0) / CYCLES)
        size = either_sign(0.1 * scales.span["displacement"] * max(shown, 1e-3))
        return (
            Parameter(
                "d", scales.units["displacement"], f"drift of the displacement until cycle {last:.0f}", size,
                "90 % within 10 % of the stroke in the trained spring",
            ),
            Parameter(
                "N0", "1", "cycles to train", LogNormal(CYCLES, 0.85), "90 % between 3 and 49"
            ),
        )  # fmt: skip

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        out = response(inputs)
        return {
            **out,
            "displacement": out["displacement"] + theta[..., :1] * trained(inputs, theta[..., 1:2]),
        }
