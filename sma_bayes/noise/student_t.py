"""Independent noise with heavy tails."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln, ndtri, stdtr

from sma_bayes.noise.types import Steps, sd_fact
from sma_bayes.parameters.space import ParameterFact
from sma_bayes.quantities import Floats


@dataclass(frozen=True)
class StudentT:
    """Samples scatter independently as Student's t with `nu` degrees of freedom; `sd` is its scale.

    Suited to records with occasional outliers that the quality checks let pass. The scale equals the standard
    deviation only for large `nu`.
    """

    name = "student_t"
    title = "independent Student t"
    needs_time = False
    remembers = False
    is_density = True

    def parameters(self, channel: str, unit: str, time_unit: str) -> tuple[ParameterFact, ...]:
        nu = ParameterFact(
            f"{channel}_nu", "1", f"degrees of freedom of the noise of {channel}", "nu", channel
        )
        return (sd_fact(channel, unit), nu)

    def information(self, shape: Floats) -> Floats:
        return np.ones(shape.shape[:-1])

    def log_density(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        nu = shape[..., 0, None]
        norm = gammaln(0.5 * (nu + 1.0)) - gammaln(0.5 * nu) - 0.5 * np.log(np.pi * nu)
        return np.asarray(norm - 0.5 * (nu + 1.0) * np.log1p(e * e / nu))

    def total_log_density(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        return np.asarray(self.log_density(e, shape, steps).sum(axis=-1))

    def innovations(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        # by probability, so that they are unit normal if the model is right; from the lower tail for its digits
        return np.asarray(-np.sign(e) * ndtri(stdtr(shape[..., 0, None], -np.abs(e))))

    def weighted_gram(self, rows: Floats, shape: Floats, steps: Steps) -> Floats:
        nu = shape[:, 0, None, None]
        return np.asarray((nu + 1.0) / (nu + 3.0) * (rows @ rows.T))  # Fisher information of a t location

    def estimate(self, residual: Floats, steps: Steps) -> Floats:
        nu = np.array([1.5, 2.0, 3.0, 4.0, 6.0, 10.0, 20.0, 50.0, 200.0])[:, None]
        variance = np.full(nu.shape, np.mean(residual**2))
        for _ in range(50):  # expectation-maximisation for the scale, at each number of degrees of freedom
            weight = (nu + 1.0) / (nu + residual**2 / variance)
            variance = np.mean(weight * residual**2, axis=1, keepdims=True)
        likelihood = self.log_density(residual / np.sqrt(variance), nu, steps).sum(axis=1)
        likelihood -= 0.5 * residual.size * np.log(variance[:, 0])
        best = int(np.argmax(likelihood))
        return np.array([np.sqrt(variance[best, 0]), nu[best, 0]])

    def draw(self, rng: np.random.Generator, shape: Floats, steps: Steps) -> Floats:
        n = steps.dt.size
        nu = shape[..., 0, None]
        normal = rng.standard_normal((*shape.shape[:-1], n))
        return np.asarray(normal / np.sqrt(rng.standard_gamma(0.5 * nu, (*shape.shape[:-1], n)) / (0.5 * nu)))
