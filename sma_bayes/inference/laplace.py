"""Modes of a density and their Laplace approximation, by Newton steps on batched finite differences.

One iteration evaluates the density at ``1 + 2 D + D (D - 1)`` points in one batch, which gives gradient and
Hessian for any density without derivatives of its parts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sma_bayes.quantities import Floats


class Density(Protocol):
    """An unnormalised density that ensembles can sample."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        ...

    def log_prob(self, z: Floats) -> Floats:
        """Log of the density at each row of `z` (W, D); never NaN."""
        ...

    def draw_prior(self, rng: np.random.Generator, size: int) -> Floats:
        """Dispersed points (size, D): draws from a distribution wider than the density."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """A local maximum.

    Attributes
    ----------
    z : ndarray, shape (D,)
    log_prob : float
    covariance : ndarray, shape (D, D)
        Inverse of the negative Hessian, floored so that no direction is wider than the prior.
    evaluations : int
    """

    z: Floats
    log_prob: float
    covariance: Floats
    evaluations: int


def climb(density: Density, start: Floats, width: Floats, *, steps: int = 40) -> Mode | None:
    """Climb to the mode nearest to a start.

    Parameters
    ----------
    density : Density
    start : ndarray, shape (D,)
    width : ndarray, shape (D,)
        Greatest plausible standard deviation in each coordinate, such as that of the prior.
    steps : int
        Greatest number of Newton steps.

    Returns
    -------
    Mode or None
        None if the density is zero at the start.
    """
    d = start.size
    z = start.astype(float).copy()
    h = 1e-2 * width
    evaluations = 0
    value = float(density.log_prob(z[None])[0])
    if not np.isfinite(value):
        return None
    covariance = np.diag(width**2)
    for _ in range(steps):
        gradient, hessian, count = _differences(density, z, h, value)
        evaluations += count
        scaled = -hessian * np.outer(width, width)
        eigenvalue, vector = np.linalg.eigh(scaled)
        curvature = np.maximum(np.abs(eigenvalue), 1.0 / 9.0)
        root = (vector / np.sqrt(curvature)) * 1.0
        covariance = (root @ root.T) * np.outer(width, width)
        h_new = np.clip(0.1 * np.sqrt(np.diag(covariance)), 1e-6 * width, 0.1 * width)
        slope = root.T @ (gradient * width)
        decrement = float(slope @ slope)
        step = width * (root @ slope)
        lengths = 0.5 ** np.arange(10)
        trial = density.log_prob(z + lengths[:, None] * step)
        evaluations += lengths.size
        best = int(np.argmax(trial))
        settled = np.allclose(h, h_new, rtol=0.5)
        h = h_new
        if trial[best] > value:
            z = z + lengths[best] * step
            value = float(trial[best])
        if decrement < 1e-2 and settled:
            break
    return Mode(z, value, 0.5 * (covariance + covariance.T), evaluations + d)


def _differences(density: Density, z: Floats, h: Floats, value: float) -> tuple[Floats, Floats, int]:
    """Gradient and Hessian by central differences; where a neighbour has density zero, as if flat."""
    d = z.size
    i, j = np.triu_indices(d, 1)
    single = np.diag(h)
    pair = single[i] + single[j]
    f = density.log_prob(np.concatenate([z + single, z - single, z + pair, z - pair]))
    f = np.where(np.isfinite(f), f, value)
    up, down = f[:d], f[d : 2 * d]
    both_up, both_down = f[2 * d : 2 * d + i.size], f[2 * d + i.size :]
    gradient = (up - down) / (2.0 * h)
    hessian = np.diag((up - 2.0 * value + down) / h**2)
    mixed = (both_up - up[i] - up[j] + 2.0 * value - down[i] - down[j] + both_down) / (2.0 * h[i] * h[j])
    hessian[i, j] = mixed
    hessian[j, i] = mixed
    return gradient, hessian, f.size
