"""Modes of a density and their Laplace approximation, by Newton steps on batched finite differences.

One iteration evaluates the density at ``1 + 2 D + D (D - 1)`` points in one batch, which gives gradient and
Hessian for any density without derivatives of its parts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sma_bayes.quantities import Floats

NEAR = 0.1
"""Steps of differences, in standard deviations along the axes of the covariance found so far."""
LEAST, MOST = 1e-5, 3.0
"""Least and greatest standard deviation along any direction, in widths."""


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
    z = start.astype(float).copy()
    axes = np.diag(width)
    evaluations = 0
    value = float(density.log_prob(z[None])[0])
    if not np.isfinite(value):
        return None
    covariance = np.diag(width**2)
    before = np.full(z.size, np.inf)
    for _ in range(steps):
        gradient, curvature, count = _differences(density, z, NEAR * axes, value)
        evaluations += count
        gradient, curvature = gradient / NEAR, curvature / NEAR**2
        root = axes @ _inverse_root(curvature)
        scaled, vector = np.linalg.eigh((root @ root.T) / np.outer(width, width))
        spread = np.sqrt(np.clip(scaled, LEAST**2, MOST**2))
        root = width[:, None] * vector * spread
        covariance = root @ root.T
        slope = np.linalg.solve(axes, root).T @ gradient
        decrement = float(slope @ slope)
        lengths = 0.5 ** np.arange(10)
        trial = density.log_prob(z + lengths[:, None] * (root @ slope))
        evaluations += lengths.size
        best = int(np.argmax(trial))
        if trial[best] > value:
            z = z + lengths[best] * (root @ slope)
            value = float(trial[best])
        settled = np.allclose(before, spread, rtol=0.5)
        if decrement < 1e-2 and settled:
            break
        before = spread
        axes = width[:, None] * vector * np.minimum(spread, 1.0)
    return Mode(z, value, 0.5 * (covariance + covariance.T), evaluations + z.size)


def _inverse_root(curvature: Floats) -> Floats:
    """Root ``R`` with ``R R' = |C|**-1`` of a symmetric matrix, its eigenvalues taken as positive."""
    eigenvalue, vector = np.linalg.eigh(curvature)
    return np.asarray(vector / np.sqrt(np.maximum(np.abs(eigenvalue), 1e-12)))


def _differences(density: Density, z: Floats, axes: Floats, value: float) -> tuple[Floats, Floats, int]:
    """Gradient and negative Hessian by central differences along axes (columns); flat where the density is zero."""
    d = z.size
    i, j = np.triu_indices(d, 1)
    single = axes.T
    pair = single[i] + single[j]
    f = density.log_prob(np.concatenate([z + single, z - single, z + pair, z - pair]))
    f = np.where(np.isfinite(f), f, value)
    up, down = f[:d], f[d : 2 * d]
    both_up, both_down = f[2 * d : 2 * d + i.size], f[2 * d + i.size :]
    gradient = 0.5 * (up - down)
    hessian = np.diag(up - 2.0 * value + down)
    mixed = 0.5 * (both_up - up[i] - up[j] + 2.0 * value - down[i] - down[j] + both_down)
    hessian[i, j] = mixed
    hessian[j, i] = mixed
    return gradient, -hessian, f.size
