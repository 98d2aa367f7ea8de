"""Independent Gaussian noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sma_bayes.noise.types import Steps, sd_fact
from sma_bayes.parameters.space import ParameterFact
from sma_bayes.quantities import Floats

HALF_LN_2PI = 0.9189385332046727


@dataclass(frozen=True)
class Independent:
    """Samples scatter independently: ``e ~ N(0, 1)``."""

    name = "independent"
    title = "independent Gaussian"
    needs_time = False
    remembers = False
    is_density = True

    def parameters(self, channel: str, unit: str, time_unit: str) -> tuple[ParameterFact, ...]:
        return (sd_fact(channel, unit),)

    def information(self, shape: Floats) -> Floats:
        return np.ones(shape.shape[:-1])

    def log_density(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        return np.asarray(-0.5 * e * e - HALF_LN_2PI)

    def total_log_density(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        return np.asarray(-0.5 * np.einsum("...i,...i->...", e, e) - HALF_LN_2PI * e.shape[-1])

    def innovations(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        return e

    def weighted_gram(self, rows: Floats, shape: Floats, steps: Steps) -> Floats:
        return np.broadcast_to(rows @ rows.T, (len(shape), len(rows), len(rows)))

    def estimate(self, residual: Floats, steps: Steps) -> Floats:
        return np.array([np.sqrt(np.mean(residual**2))])

    def draw(self, rng: np.random.Generator, shape: Floats, steps: Steps) -> Floats:
        return rng.standard_normal((*shape.shape[:-1], steps.dt.size))
