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
from scipy.optimize import least_squares

from sma_bayes.arrays import Bools, Floats
from sma_bayes.fitting.posterior import QUADRATURE, Posterior
from sma_bayes.fitting.warm_start import BOUND_SD, OVERFLOW, WarmStart
from sma_bayes.records.types import Record

ROUNDS: Final = 4
"""Rounds in which the variance of the readings follows the parameters."""
QUIET: Final = 0.1
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
    space, free = posterior.space, posterior.sampled_model
    full = space.prior_centre()
    scale = space.prior_sd()[: free.size]
    low, high = full[: free.size] - BOUND_SD * scale, full[: free.size] + BOUND_SD * scale

    def theta_of(z: Floats) -> Floats:
        full[: free.size] = z
        return np.asarray(space.constrain(full)[: start.theta.size])

    def moments_at(z: Floats) -> tuple[Moments, ...]:
        return tuple(Moments.of(posterior, theta_of(z), r) for r in posterior.records)

    theta = space.constrain(full)
    theta[: start.theta.size] = start.theta
    z = np.clip(space.unconstrain(theta)[: free.size], low + 1e-6 * scale, high - 1e-6 * scale)
    for _ in range(ROUNDS if free.size else 0):
        found = moments_at(z)
        sds = [_deviation(r, m) for r, m in zip(posterior.records, found, strict=True)]

        def vector(z: Floats, sds: list[dict[str, Floats]] = sds) -> Floats:
            parts = [
                (r.observed[c] - m.mean[c]) / sd[c]
                for r, m, sd in zip(posterior.records, moments_at(z), sds, strict=True)
                for c in r.channels
            ]
            return _finite(np.concatenate(parts))

        def jacobian(z: Floats, sds: list[dict[str, Floats]] = sds) -> Floats:
            found = moments_at(z)
            chain = space.derivative(full)[: free.size]
            parts = [
                -m.jacobian[c][:, free] * chain / sd[c][:, None]
                for r, m, sd in zip(posterior.records, found, sds, strict=True)
                for c in r.channels
            ]
            return _finite(np.concatenate(parts))

        z = least_squares(vector, z, jac=jacobian, bounds=(low, high), x_scale=scale, max_nfev=50).x
    return moments_at(z)


def quiet(record: Record, moments: Moments) -> dict[str, Bools]:
    """Channel to the readings (n,) in which the error of the thermometer makes little beside the noise."""
    sd = _deviation(record, moments)
    return {c: v <= QUIET * (sd[c] ** 2 - v) for c, v in moments.variance.items()}


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


def _finite(values: Floats) -> Floats:
    clipped = np.clip(values, -OVERFLOW, OVERFLOW)
    return np.asarray(np.nan_to_num(clipped, nan=OVERFLOW, posinf=OVERFLOW, neginf=-OVERFLOW))
