"""Least squares on what readings are expected to be where the thermometer is known to err.

A reading at a logged temperature comes from a temperature about it, so its mean is not the curve but the curve blurred
by the error, and readings scatter where the curve is steep. Where the error is as wide as the transformation the plain
least-squares curve is less steep than the true one, and what it leaves is neither of zero mean nor of the variance
that its slope gives. Here the mean and the variance of a reading are found by quadrature over the error, and the
parameters by weighted least squares on them: first and second moments of the density that is sampled.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.arrays import Bools, Floats
from sma_bayes.fitting.posterior import QUADRATURE, Posterior
from sma_bayes.fitting.warm_start import SumOfSquares, WarmStart
from sma_bayes.records.types import Record

ROUNDS: Final = 4
"""Rounds in which the variance of the readings follows the parameters."""
NEGLIGIBLE_TEMPERATURE_VARIANCE: Final = 0.1
"""Variance that the error of the thermometer makes, over that of the noise, up to which it hardly shows."""


@dataclass(frozen=True, slots=True, eq=False)
class Moments:
    """Mean and variance of the readings of one record, by channel, and their derivatives.

    Attributes
    ----------
    mean, variance : dict of str to ndarray, shape (n,)
        Over errors of the thermometer [unit of the channel] and its square; without the noise of the channel.
    jacobian : dict of str to ndarray, shape (n, P)
        Derivatives of the mean with respect to the parameters of the model.
    """

    mean: dict[str, Floats]
    variance: dict[str, Floats]
    jacobian: dict[str, Floats]

    @classmethod
    def of(cls, posterior: Posterior, theta: Floats, record: Record) -> Moments:
        """Moments at parameters (P,) of the model, by quadrature over the declared error."""
        nodes, weights = QUADRATURE if record.temperature_sd > 0.0 else (np.zeros(1), np.ones(1))
        weights = weights / weights.sum()
        with np.errstate(all="ignore"):
            inputs = [
                {**record.inputs, "temperature": record.temperature + x * record.temperature_sd}
                for x in nodes
            ]
            values = [posterior.model.predict(theta, at) for at in inputs]
            slopes = [posterior.model.jacobian(theta, at) for at in inputs]
        mean = {c: _average(weights, [v[c] for v in values]) for c in record.channels}
        return cls(
            mean,
            {c: _average(weights, [(v[c] - mean[c]) ** 2 for v in values]) for c in record.channels},
            {c: _average(weights, [s[c] for s in slopes]) for c in record.channels},
        )


def fitted_moments(posterior: Posterior, start: WarmStart) -> tuple[Moments, ...]:
    """Moments of each record by weighted least squares; of the warm start where no error is declared.

    Parameters
    ----------
    posterior : Posterior
        Priors only supply bounds and which parameters are fixed.
    start : WarmStart
    """
    if not any(r.temperature_sd > 0.0 for r in posterior.records):
        return tuple(Moments.of(posterior, start.theta, r) for r in posterior.records)
    problem = _ExpectedSquares(posterior)
    theta = posterior.space.constrain(problem.centre)
    theta[: start.theta.size] = start.theta
    z = problem.inside(posterior.space.unconstrain(theta)[: problem.free.size])
    for _ in range(ROUNDS):
        problem.weigh(z)
        z, _ = problem.solve(z, dict.fromkeys(problem.channels, 1.0))
    return problem.moments(problem.theta(z))


class _ExpectedSquares(SumOfSquares):
    """The sum of squares about the expected response, each reading by its standard deviation."""

    def __init__(self, posterior: Posterior) -> None:
        super().__init__(posterior)
        self.sd: list[dict[str, Floats]] = []
        self._last: tuple[bytes, tuple[Moments, ...]] = (b"", ())

    def moments(self, theta: Floats) -> tuple[Moments, ...]:
        """Moments of each record; residuals and derivatives at one point share them."""
        key = theta.tobytes()
        if key != self._last[0]:
            found = tuple(Moments.of(self.posterior, theta, r) for r in self.posterior.records)
            self._last = key, found
        return self._last[1]

    def weigh(self, z: Floats) -> None:
        """Take the standard deviations that the readings have at a point."""
        found = self.moments(self.theta(z))
        self.sd = [_deviation(r, m) for r, m in zip(self.posterior.records, found, strict=True)]

    def residuals(self, theta: Floats) -> tuple[dict[str, Floats], ...]:
        """Measured less expected [standard deviations]."""
        parts = zip(self.posterior.records, self.moments(theta), self.sd, strict=True)
        return tuple({c: (r.observed[c] - m.mean[c]) / sd[c] for c in sd} for r, m, sd in parts)

    def jacobians(self, theta: Floats) -> tuple[dict[str, Floats], ...]:
        """Derivatives of what is expected [standard deviations]."""
        parts = zip(self.moments(theta), self.sd, strict=True)
        return tuple({c: m.jacobian[c] / sd[c][:, None] for c in sd} for m, sd in parts)


def quiet(record: Record, moments: Moments) -> dict[str, Bools]:
    """Channel to the readings (n,) in which the error of the thermometer makes little beside the noise."""
    sd = _deviation(record, moments)
    return {c: v <= NEGLIGIBLE_TEMPERATURE_VARIANCE * (sd[c] ** 2 - v) for c, v in moments.variance.items()}


def _deviation(record: Record, moments: Moments) -> dict[str, Floats]:
    """Standard deviation (n,) of the readings: that of the error, and of the noise what the residuals leave for it."""
    out = {}
    for channel, mean in moments.mean.items():
        variance = moments.variance[channel]
        square = (record.observed[channel] - mean) ** 2
        least = 1e-3 * float(np.ptp(record.observed[channel])) or 1.0
        noise = least**2
        for _ in range(ROUNDS):  # mean square of what is left, each reading weighted by its information
            weight = (noise + variance) ** -2
            noise = max(float(weight @ (square - variance) / weight.sum()), least**2)
        out[channel] = np.sqrt(noise + variance)
    return out


def _average(weights: Floats, values: list[Floats]) -> Floats:
    return np.asarray(np.tensordot(weights, np.stack(values), axes=1))
