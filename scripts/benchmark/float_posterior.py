"""The log-posterior of one record as a plain function of one parameter vector.

Samplers that call a function once a point should not be held back by what the package does for batches. This is
what a careful user would write by hand for such a sampler: Python floats for the parameters, a few numpy calls on
the record. It is checked against the package's own log-posterior each time it is built.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.special import expit

from sma_bayes.arrays import Floats
from sma_bayes.fitting.posterior import Posterior
from sma_bayes.parameters.distributions import LogNormal, Normal, Uniform

HALF_LN_2PI, ROOT_HALF = 0.5 * math.log(2.0 * math.pi), math.sqrt(0.5)


class FloatPosterior:
    """Log-posterior of one record: ``z`` (D,) to float.

    Parameters
    ----------
    posterior : Posterior
        Of one record in one sweep without temperature error; independent or AR(1) noise; no fixed parameter;
        normal, lognormal and uniform priors.
    near : ndarray, shape (D,)
        A point of high density, about which the agreement with `posterior` is checked.

    Raises
    ------
    ValueError
        If the posterior is of another kind, or the check fails.
    """

    def __init__(self, posterior: Posterior, near: Floats) -> None:
        (record,) = posterior.records
        (steps,) = posterior.steps
        if (
            record.temperature_sd
            or steps.first[1:].any()
            or posterior.noise.name not in ("independent", "ar1")
        ):
            raise ValueError(
                f"{record.key}: only one sweep with independent or AR(1) noise can be written out"
            )
        self.temperature = record.temperature
        self.observed = {channel: record.observed[channel] for channel in record.channels}
        self.autocorrelated = posterior.noise.name == "ar1"
        self.scales = tuple(_scale(p.prior) for p in posterior.space.free)
        self.position = {p.name: i for i, p in enumerate(posterior.space.parameters)}
        if len(self.scales) != len(self.position):
            raise ValueError(f"{record.key}: a parameter is fixed")
        self.residual: dict[str, Callable[[list[float]], Floats]] = {
            "force": lambda theta: self._sigmoid("force", theta, "B"),
            "displacement": lambda theta: self._sigmoid("displacement", theta, "A"),
            "stiffness": self._stiffness,
        }
        z = near + 0.01 * posterior.space.prior_sd() * np.random.default_rng(0).standard_normal(
            (50, near.size)
        )
        mine = np.array([self(point) for point in z])
        if not np.allclose(mine, posterior.log_prob(z), rtol=1e-9, atol=1e-7):
            raise ValueError(f"{record.key}: the plain log-posterior disagrees with the package's")

    def __call__(self, z: Floats) -> float:
        """Log density at one point; minus infinity where it can't be evaluated."""
        try:
            theta, log_prior = self._parameters(z.tolist())
            total = log_prior + self._log_likelihood(theta)
        except (OverflowError, ValueError, ZeroDivisionError):
            return -math.inf
        return total if total == total else -math.inf

    def log_likelihood(self, z: Floats) -> float:
        """Its part without the priors, for nested sampling."""
        try:
            total = self._log_likelihood(self._parameters(z.tolist())[0])
        except (OverflowError, ValueError, ZeroDivisionError):
            return -math.inf
        return total if total == total else -math.inf

    def _parameters(self, z: list[float]) -> tuple[list[float], float]:
        """Parameters, and the log density of their priors in sampled coordinates."""
        theta, log_prior = [], 0.0
        for coordinate, scale in zip(z, self.scales, strict=True):
            value, density = scale(coordinate)
            theta.append(value)
            log_prior += density
        return theta, log_prior

    def _log_likelihood(self, theta: list[float]) -> float:
        total = 0.0
        for channel in self.observed:
            e = self.residual[channel](theta)
            sd = theta[self.position[f"{channel}_sd"]]
            total -= e.size * (math.log(sd) + HALF_LN_2PI)
            if self.autocorrelated:
                total += _remembering(e, sd, theta[self.position[f"{channel}_phi"]])
            else:
                total -= 0.5 * float(e.dot(e)) / (sd * sd)
        return total

    def _sigmoid(self, channel: str, theta: list[float], letter: str) -> Floats:
        size, rate, middle, offset = (theta[self.position[f"{letter}{i}"]] for i in (1, 2, 3, 4))
        x = self.temperature - middle
        x *= rate
        expit(x, out=x)
        x *= size
        x += offset
        return np.subtract(self.observed[channel], x, out=x)

    def _stiffness(self, theta: list[float]) -> Floats:
        a1, a2, a3, b1, b2, b3 = (theta[self.position[name]] for name in ("A1", "A2", "A3", "B1", "B2", "B3"))
        a = np.abs(a2 * (self.temperature - a3))
        b = np.abs(b2 * (self.temperature - b3))
        shape = np.log1p(np.exp(-a))
        shape -= np.log1p(np.exp(-b))
        shape *= 2.0
        shape += a
        shape -= b
        np.exp(shape, out=shape)
        shape *= (b1 * b2) / (a1 * a2)
        return np.subtract(self.observed["stiffness"], shape, out=shape)


def _remembering(e: Floats, sd: float, phi: float) -> float:
    """Part of the AR(1) log-likelihood that depends on the residuals or the memory."""
    squares = float(e.dot(e))
    cross = float(e[1:].dot(e[:-1]))
    first, last = float(e[0]) ** 2, float(e[-1]) ** 2
    left = 1.0 - phi * phi
    quadratic = first + (squares - first - 2.0 * phi * cross + phi * phi * (squares - last)) / left
    return -0.5 * quadratic / (sd * sd) - 0.5 * (e.size - 1) * math.log(left)


def _scale(prior: object) -> Callable[[float], tuple[float, float]]:
    """A function from a sampled coordinate to the parameter and the log density of the prior."""
    if isinstance(prior, Normal | LogNormal):
        mean, sd = (
            (prior.mean, prior.sd) if isinstance(prior, Normal) else (math.log(prior.median), prior.sigma)
        )
        constant = -math.log(sd) - HALF_LN_2PI
        factor = -0.5 / sd**2
        if isinstance(prior, Normal):
            return lambda z: (z, constant + factor * (z - mean) ** 2)
        sign = prior.sign
        return lambda z: (sign * math.exp(z), constant + factor * (z - mean) ** 2)
    if isinstance(prior, Uniform):
        low, width = prior.low, prior.high - prior.low

        def probit(z: float) -> tuple[float, float]:
            return low + 0.5 * width * math.erfc(-z * ROOT_HALF), -HALF_LN_2PI - 0.5 * z * z

        return probit
    raise ValueError(f"{prior!r} is not written out")
