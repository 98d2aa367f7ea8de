"""Gaussian noise that forgets in time: AR(1) for unequal steps (Ornstein-Uhlenbeck)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.noise.ar1 import MemoryNoise
from sma_bayes.noise.base import Steps, sd_fact
from sma_bayes.parameters.space import QUANTITY, ParameterSpec


@dataclass(frozen=True)
class AR1Time(MemoryNoise):
    """``corr(e(t), e(t + dt)) = exp(-dt/tau)``; `sd` is the standard deviation of the series itself.

    For samples at unequal steps. Two samples at the same instant would be the same sample, so a step of zero
    counts as a millionth of the correlation time.
    """

    name = "ar1_time"
    title = "AR(1) in time"
    needs_time = True

    def parameters(self, channel: str, unit: str, time_unit: str) -> tuple[ParameterSpec, ...]:
        tau = ParameterSpec(
            f"{channel}_tau",
            time_unit,
            f"correlation time of the noise of {QUANTITY}",
            "tau",
            channel,
            positive=True,
        )
        return (sd_fact(channel, unit), tau)

    def phi(self, shape: Floats, steps: Steps) -> Floats:
        lapse = np.maximum(steps.dt / shape[..., 0, None], 1e-6)
        return np.where(steps.first, 0.0, np.exp(-lapse))

    def shape_candidates(self, steps: Steps) -> Floats:
        return steps.typical * np.geomspace(0.1, 3e3, 201)[:, None]
