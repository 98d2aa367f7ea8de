"""The instants of switching, as a part of the noise of a temperature that a current makes.

When between two samples the current is switched differs from step to step, unless the logger drives it. Each instant
moves all of the temperature that follows, by known courses that die away with the time constant. Their common part is
a parameter of the heat balance; what scatters about it has a standard deviation, in steps of the record, and as many
random numbers as there are switchings. These are integrated out: they widen the covariance of the noise along their
courses.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sma_bayes.arrays import Floats

INSTANT_SD_GRID = (0.01, 0.02, 0.05, 0.1, 0.2, 0.29, 0.4)
"""Standard deviations of instants that are tried, in steps of the record; 0.29 is that of any instant within a step."""
LEAST_LN_LIKELIHOOD_GAIN = 2.0
"""Least gain of log likelihood for which instants count as scattered."""


@dataclass(frozen=True, slots=True, eq=False)
class Scatter:
    """Scatter of the instants of switching in a record.

    Attributes
    ----------
    size : float
        Standard deviation of an instant, in steps of the record [1].
    courses : ndarray, shape (n, K)
        By how much it moves the temperature [K].
    axes : ndarray, shape (n, k)
        Orthonormal directions of the whitened courses.
    excess : ndarray, shape (k,)
        Variance along them beyond that of the noise, which is 1.
    """

    size: float
    courses: Floats
    axes: Floats
    excess: Floats

    @staticmethod
    def of(size: float, courses: Floats, whiten: Callable[[Floats], Floats]) -> Scatter:
        """Scatter beside a noise.

        Parameters
        ----------
        size : float
        courses : ndarray, shape (n, K)
            For one standard deviation.
        whiten : callable
            Series (..., n) as innovations of that noise.
        """
        axes, length, _ = np.linalg.svd(whiten(courses.T).T, full_matrices=False)
        shown = length > 1e-6
        return Scatter(size, courses, axes[:, shown], length[shown] ** 2)

    def whiten(self, innovations: Floats) -> Floats:
        """Innovations (..., n) of the noise as independent ones of unit variance."""
        damped = 1.0 - 1.0 / np.sqrt(1.0 + self.excess)
        return np.asarray(innovations - ((innovations @ self.axes) * damped) @ self.axes.T)

    def drawn(self, rng: np.random.Generator, count: int) -> Floats:
        """What scattered instants may add to a temperature, shape (n, count)."""
        return np.asarray(self.courses @ rng.standard_normal((self.courses.shape[1], count)))

    @property
    def log_scale(self) -> float:
        """Logarithm of the determinant of `whiten`, with a minus sign."""
        return 0.5 * float(np.log1p(self.excess).sum())


def likeliest_size(parts: Sequence[tuple[Floats, Floats, Floats]]) -> float:
    """Standard deviation of the instants that is likeliest, in steps of the record; 0 where they are all alike.

    Parameters
    ----------
    parts : sequence of (ndarray, ndarray, ndarray)
        Of each record: residuals (n,), what passes for misfit (n, k) and the courses of a whole step (n, K), all
        whitened. Misfit is taken out of the others.
    """
    value = np.zeros(len(INSTANT_SD_GRID))
    variance = np.square(INSTANT_SD_GRID)[:, None]
    for residual, misfit, courses in parts:
        basis = np.linalg.qr(misfit)[0]
        left, own = (x - basis @ (basis.T @ x) for x in (residual, courses))
        information, axes = np.linalg.eigh(own.T @ own)
        information = np.maximum(information, 0.0)
        pull = axes.T @ (own.T @ left)
        widened = 1.0 + variance * information
        value += np.sum(0.5 * variance * pull**2 / widened - 0.5 * np.log(widened), axis=1)
    best = int(np.argmax(value))
    return INSTANT_SD_GRID[best] if value[best] > LEAST_LN_LIKELIHOOD_GAIN else 0.0
