"""Heavy tails: independent Student t noise, and a memory whose innovations are Student t.

A Gaussian series is decorrelated into independent innovations ``a``; each is then Student t of unit scale instead of
normal, ``p(a) = t(a; nu)``. Since decorrelating is linear the Jacobian is that of the Gaussian series.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln, ndtri, stdtr

from sma_bayes.arrays import Floats
from sma_bayes.noise.base import NoiseModel, OfSeries, Steps
from sma_bayes.noise.independent import Independent
from sma_bayes.noise.information import Information
from sma_bayes.normal import HALF_LN_2PI
from sma_bayes.parameters.space import QUANTITY, ParameterSpec


@dataclass(frozen=True)
class StudentTNoise(OfSeries):
    """Innovations scatter as Student's t with ``nu`` degrees of freedom; ``sd`` is their scale.

    Suited to records with occasional outliers that the quality checks let pass. The scale equals the standard
    deviation only for large ``nu``.

    Attributes
    ----------
    series : NoiseModel
        Gaussian series whose innovations these are; independent samples by default.
    """

    series: NoiseModel = Independent()  # noqa: RUF009 (it is frozen and holds nothing)

    @property
    def name(self) -> str:  # type: ignore[override]
        """``student_t``, or that of the series before it."""
        return "student_t" if not self.series.autocorrelated else f"{self.series.name}_student_t"

    @property
    def title(self) -> str:  # type: ignore[override]
        """For people."""
        return (
            "independent Student t"
            if not self.series.autocorrelated
            else f"{self.series.title} with Student t innovations"
        )

    def parameters(self, channel: str, unit: str, time_unit: str) -> tuple[ParameterSpec, ...]:
        nu = ParameterSpec(
            f"{channel}_nu",
            "1",
            f"degrees of freedom of the noise of {QUANTITY}",
            "nu",
            channel,
            positive=True,
        )
        return (*self.series.parameters(channel, unit, time_unit), nu)

    @property
    def _at(self) -> int:
        """Position of ``nu`` among the parameters after ``sd``."""
        return len(self.series.parameters("", "", "")) - 1

    def _nu(self, shape: Floats) -> Floats:
        return shape[..., self._at, None]

    def log_density(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        nu = self._nu(shape)
        norm = gammaln(0.5 * (nu + 1.0)) - gammaln(0.5 * nu) - 0.5 * np.log(np.pi * nu)
        a = self.decorrelate(e, shape, steps)
        density = norm - 0.5 * (nu + 1.0) * np.log1p(a * a / nu)
        if self.series.autocorrelated:
            # the Jacobian: what the Gaussian density of a series of zeros has beyond that of its innovations
            density = density + self.series.log_density(np.zeros_like(e), shape, steps) + HALF_LN_2PI
            density = np.where(np.isnan(density), -np.inf, density)
        return np.asarray(density)

    def score(self, innovation: Floats, shape: Floats) -> Floats:
        return self.weight(innovation, shape) * innovation

    def weight(self, innovation: Floats, shape: Floats) -> Floats:
        nu = self._nu(shape)
        return np.asarray((nu + 1.0) / (nu + innovation * innovation))

    def location_information(self, shape: Floats) -> Floats:
        nu = self._nu(shape)[..., 0]
        return np.asarray((nu + 1.0) / (nu + 3.0))

    def innovations(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        # by probability, so that they are unit normal if the model is right; from the lower tail for its digits
        a = self.decorrelate(e, shape, steps)
        return np.asarray(-np.sign(a) * ndtri(stdtr(self._nu(shape), -np.abs(a))))

    def information(self, shape: Floats, steps: Steps, inverse: Floats | None = None) -> Information:
        return self.series.information(shape, steps, inverse).scaled(self.location_information(shape))

    def estimate(self, residual: Floats, steps: Steps) -> Floats:
        first = self.series.estimate(residual, steps)  # the memory is told nearly as well with light tails
        with np.errstate(divide="ignore", invalid="ignore"):
            a = self.series.decorrelate(residual, first[1:], steps)
        nu = np.array([2.1, 2.5, 3.0, 4.0, 6.0, 10.0, 20.0, 50.0, 200.0])[:, None]
        variance = np.full(nu.shape, np.mean(a**2))
        for _ in range(50):  # expectation-maximisation for the scale, at each number of degrees of freedom
            weight = (nu + 1.0) / (nu + a**2 / variance)
            variance = np.mean(weight * a**2, axis=1, keepdims=True)
        shape = np.concatenate([np.tile(first[1:], (len(nu), 1)), nu], axis=1)
        likelihood = self.log_density(residual / np.sqrt(variance), shape, steps).sum(axis=1)
        likelihood -= 0.5 * residual.size * np.log(variance[:, 0])
        best = int(np.argmax(likelihood))
        return np.array([np.sqrt(variance[best, 0]), *shape[best]])

    def draw(self, rng: np.random.Generator, shape: Floats, steps: Steps) -> Floats:
        n, nu = steps.dt.size, self._nu(shape)
        normal = rng.standard_normal((*shape.shape[:-1], n))
        a = normal / np.sqrt(rng.standard_gamma(0.5 * nu, (*shape.shape[:-1], n)) / (0.5 * nu))
        return self.correlate(a, shape, steps)
