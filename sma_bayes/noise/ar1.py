"""Gaussian noise that remembers the sample before: AR(1) in sample index."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.noise.base import NoiseModel, Steps, sd_fact
from sma_bayes.noise.information import EachSample, Information, KindsOfSample, is_even, squared
from sma_bayes.normal import HALF_LN_2PI
from sma_bayes.parameters.space import QUANTITY, ParameterSpec


def memory_log_density(e: Floats, phi: Floats) -> Floats:
    """Log density of each sample of a stationary series with memory `phi` of the sample before.

    ``e[0] ~ N(0, 1)``, ``e[i] | e[i-1] ~ N(phi[i] e[i-1], 1 - phi[i]**2)``.

    Parameters
    ----------
    e : ndarray, shape (..., n)
    phi : ndarray, broadcasts with (..., n)
        Zero where a new memory starts.
    """
    variance = 1.0 - phi * phi
    step = _less_memory(e, phi)
    with np.errstate(divide="ignore", invalid="ignore"):
        value = -0.5 * step * step / variance - 0.5 * np.log(variance) - HALF_LN_2PI
    return np.where(variance > 0.0, value, -np.inf)


def memory_innovations(e: Floats, phi: Floats, scale: Floats | float = 1.0) -> Floats:
    """Series with its memory taken out, of unit variance where innovations have these scales over the usual one."""
    step = _less_memory(e, phi)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(step / (np.sqrt(1.0 - phi * phi) * scale))


def _less_memory(e: Floats, phi: Floats) -> Floats:
    """Each sample less what the one before it predicts."""
    step = e.copy()
    step[..., 1:] -= np.broadcast_to(phi, e.shape)[..., 1:] * e[..., :-1]
    return step


def memory_log_scale(phi: Floats) -> Floats:
    """Logarithm of the standard deviation of each innovation, in standard deviations of the series."""
    return np.asarray(0.5 * np.log1p(-(phi**2)))


def memory_series(innovation: Floats, phi: Floats, scale: Floats | float = 1.0) -> Floats:
    """Stationary series with memory `phi` (..., n) from its innovations (..., n); inverts `memory_innovations`."""
    e = innovation * np.sqrt(1.0 - phi * phi) * scale
    for i in range(1, phi.shape[-1]):
        e[..., i] += phi[..., i] * e[..., i - 1]
    return e


def best_memory(noise: NoiseModel, residual: Floats, shape: Floats, steps: Steps) -> Floats:
    """Of shapes (c, k) of a Gaussian series that of greatest likelihood, after the ``sd`` that goes with it."""
    e = np.broadcast_to(residual, (len(shape), residual.size))
    sd = np.sqrt(np.mean(noise.innovations(e, shape, steps) ** 2, axis=1))
    likelihood = noise.total_log_density(e / sd[:, None], shape, steps) - residual.size * np.log(sd)
    best = int(np.argmax(likelihood))
    return np.array([sd[best], *shape[best]])


class MemoryNoise(NoiseModel):
    """Gaussian series whose samples remember the one before: ``corr(e[i], e[i-1]) = phi[i]``."""

    autocorrelated = True
    is_gaussian = True

    @abstractmethod
    def phi(self, shape: Floats, steps: Steps) -> Floats:
        """Correlation (..., n) of each sample with the one before it; zero where a sweep starts."""
        ...

    def log_density(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        return memory_log_density(e, self.phi(shape, steps))

    def decorrelate(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        return memory_innovations(e, self.phi(shape, steps))

    def memory(self, shape: Floats, steps: Steps) -> float:
        inside = self.phi(shape, steps)[..., ~steps.first]
        r = float(np.clip(np.median(inside), -1.0, 1.0 - 1e-9)) if inside.size else 0.0
        return max(1.0, (1.0 + r) / (1.0 - r))

    def decorrelate_adjoint(self, series: Floats, shape: Floats, steps: Steps) -> Floats:
        phi = self.phi(shape, steps)
        with np.errstate(divide="ignore", invalid="ignore"):
            scaled = series / np.sqrt(1.0 - phi * phi)
            back = scaled.copy()
            back[..., :-1] -= (phi * scaled)[..., 1:]
        return np.asarray(back)

    def correlate(self, innovation: Floats, shape: Floats, steps: Steps) -> Floats:
        return memory_series(innovation, self.phi(shape, steps))

    def information(self, shape: Floats, steps: Steps, inverse: Floats | None = None) -> Information:
        phi = self.phi(shape, steps)
        with np.errstate(divide="ignore", invalid="ignore"):
            own = 1.0 / (1.0 - phi * phi)
            cross = phi * own
            own[..., :-1] += (phi * cross)[..., 1:]
        if is_even(inverse):
            return EachSample(own, -cross).scaled(squared(inverse, len(shape)))
        assert inverse is not None
        cross[..., 1:] *= inverse[..., 1:] * inverse[..., :-1]
        return EachSample(own * inverse * inverse, -cross)

    def draw(self, rng: np.random.Generator, shape: Floats, steps: Steps) -> Floats:
        phi = self.phi(shape, steps)
        return memory_series(rng.standard_normal(phi.shape), phi)

    def score(self, innovation: Floats, shape: Floats) -> Floats:
        return innovation

    def location_information(self, shape: Floats) -> Floats:
        return np.ones(shape.shape[:-1])

    def innovations(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        return self.decorrelate(e, shape, steps)

    def estimate(self, residual: Floats, steps: Steps) -> Floats:
        return best_memory(self, residual, self.shape_candidates(steps), steps)


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("...i,...i->...", a, b))


@dataclass(frozen=True)
class AR1(MemoryNoise):
    """``e[i] = phi e[i-1] + sqrt(1 - phi**2) N(0, 1)``; `sd` is the standard deviation of the series itself.

    For samples at equal steps. Each sweep starts afresh.
    """

    name = "ar1"
    title = "AR(1) in sample index"

    def parameters(self, channel: str, unit: str, time_unit: str) -> tuple[ParameterSpec, ...]:
        phi = ParameterSpec(
            f"{channel}_phi", "1", f"correlation of neighbouring noise of {QUANTITY}", "phi", channel
        )
        return (sd_fact(channel, unit), phi)

    def phi(self, shape: Floats, steps: Steps) -> Floats:
        return np.where(steps.first, 0.0, shape[..., 0, None])

    def total_log_density(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        # sums of squares and of neighbouring products are all that a constant memory needs
        phi = shape[..., 0]
        n = e.shape[-1]
        starts = np.flatnonzero(steps.first)
        ends = np.append(starts[1:] - 1, n - 1)
        m = n - starts.size
        all_squares = _dot(e, e)
        start_squares = _dot(e[..., starts], e[..., starts])
        before = all_squares - _dot(e[..., ends], e[..., ends])
        cross = _dot(e[..., 1:], e[..., :-1]) - _dot(e[..., starts[1:]], e[..., ends[:-1]])
        variance = 1.0 - phi * phi
        with np.errstate(divide="ignore", invalid="ignore"):
            quadratic = (
                start_squares
                + (all_squares - start_squares - 2.0 * phi * cross + phi * phi * before) / variance
            )
            value = -0.5 * quadratic - 0.5 * m * np.log(variance) - n * HALF_LN_2PI
        return np.where(variance > 0.0, value, -np.inf)

    def information(self, shape: Floats, steps: Steps, inverse: Floats | None = None) -> Information:
        if not is_even(inverse):
            return super().information(shape, steps, inverse)
        phi = shape[:, 0]
        variance = np.maximum(1.0 - phi * phi, 1e-300)
        has_next = np.append(~steps.first[1:], False)
        kinds = np.stack([steps.first, ~steps.first, has_next]).astype(float)
        own = np.stack([np.ones(len(phi)), 1.0 / variance, phi * phi / variance], axis=1)
        found = KindsOfSample(own, kinds, -phi / variance, kinds[1])
        return found.scaled(squared(inverse, len(phi)))

    def shape_candidates(self, steps: Steps) -> Floats:
        return np.tanh(np.linspace(-1.0, 4.0, 201))[:, None]
