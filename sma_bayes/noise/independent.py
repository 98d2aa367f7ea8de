"""Independent Gaussian noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.noise.base import NoiseModel, Steps
from sma_bayes.normal import HALF_LN_2PI


@dataclass(frozen=True)
class Independent(NoiseModel):
    """Samples scatter independently: ``e ~ N(0, 1)``."""

    name = "independent"
    title = "independent Gaussian"
    is_gaussian = True

    def log_density(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        return np.asarray(-0.5 * e * e - HALF_LN_2PI)

    def total_log_density(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        return np.asarray(-0.5 * np.einsum("...i,...i->...", e, e) - HALF_LN_2PI * e.shape[-1])

    def estimate(self, residual: Floats, steps: Steps) -> Floats:
        return np.array([np.sqrt(np.mean(residual**2))])

    def draw(self, rng: np.random.Generator, shape: Floats, steps: Steps) -> Floats:
        return np.asarray(rng.standard_normal((*shape.shape[:-1], steps.dt.size)))
