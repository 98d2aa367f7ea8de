"""What each condition says, as a Gaussian, and the density of the scatter between conditions that follows from it.

With Gaussians, level, slopes and the coordinates of every condition integrate out in closed form; see `population`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from scipy.stats import multivariate_normal

from sma_bayes.arrays import Floats
from sma_bayes.batches import batches

COMMON_LN_SD: Final = 1.0
OWN_LN_SD: Final = 1.0
"""Standard deviations of the logarithm of the scatter: what all coordinates have in common, and what each has alone."""
LEAST_VARIANCE_RATIO: Final = 1e-10
"""Least variance of a posterior over that of its prior: parameters that are held fixed have none."""
CHUNK: Final = 1 << 20
"""Numbers in an array of intermediate results, about."""


@dataclass(frozen=True, slots=True, eq=False)
class Summary:
    """What the measurements of one condition say, as a Gaussian ``exp(pull phi - phi precision phi/2)``.

    Attributes
    ----------
    precision : ndarray, shape (P, P)
        Never negative; zero where nothing is added to the prior.
    pull : ndarray, shape (P,)
    """

    precision: Floats
    pull: Floats


def summary_of(phi: Floats, prior_mean: Floats, prior_covariance: Floats) -> Summary:
    """Divide a Gaussian posterior by a Gaussian prior.

    Parameters
    ----------
    phi : ndarray, shape (S, P)
        Posterior draws.
    prior_mean : ndarray, shape (P,)
    prior_covariance : ndarray, shape (P, P)

    Notes
    -----
    Directions in which the draws are as wide as the prior or wider carry no information: there the precision is zero.
    """
    root = np.linalg.cholesky(prior_covariance)
    whitened = np.linalg.solve(root, (phi - prior_mean).T)  # prior N(0, I)
    mean, covariance = whitened.mean(axis=1), np.atleast_2d(np.cov(whitened))
    variance, vector = np.linalg.eigh(covariance)
    variance = np.maximum(variance, LEAST_VARIANCE_RATIO)
    gained = np.maximum(1.0 / variance - 1.0, 0.0)
    pull = np.where(gained > 0.0, (vector.T @ mean) / variance, 0.0)
    back = np.linalg.solve(root.T, vector)
    precision = (back * gained) @ back.T
    return Summary(precision, back @ pull + precision @ prior_mean)


@dataclass(frozen=True, eq=False)
class ScatterDensity:
    """Density of ``ln tau`` (P,), everything else integrated out.

    Attributes
    ----------
    matrix : ndarray, shape (C, Q)
        Regressors.
    summaries : tuple of Summary
        One for each condition.
    centre : ndarray, shape (P,)
        Mean of the prior of the level.
    width : ndarray, shape (P,)
        Standard deviation of the prior of level and slopes.
    scale : ndarray, shape (P,)
        Median of the prior of tau.
    labels : tuple of str
    """

    matrix: Floats
    summaries: tuple[Summary, ...]
    centre: Floats
    width: Floats
    scale: Floats
    labels: tuple[str, ...]
    precision: Floats = field(init=False, repr=False)
    pull: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "precision", np.stack([s.precision for s in self.summaries]))
        object.__setattr__(self, "pull", np.stack([s.pull for s in self.summaries]))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coordinates that are sampled."""
        return tuple(f"ln tau[{label}]" for label in self.labels)

    def draw_prior(self, rng: np.random.Generator, size: int) -> Floats:
        """Draws (size, P) of ``ln tau`` from its prior."""
        common, own = rng.standard_normal((size, 1)), rng.standard_normal((size, self.scale.size))
        return np.asarray(np.log(self.scale) + COMMON_LN_SD * common + OWN_LN_SD * own)

    def log_prior(self, log_tau: Floats) -> Floats:
        """Log density of the prior of ``ln tau`` (W, P), shape (W,)."""
        p = self.scale.size
        covariance = COMMON_LN_SD**2 * np.ones((p, p)) + OWN_LN_SD**2 * np.eye(p)
        return np.asarray(multivariate_normal.logpdf(log_tau, np.log(self.scale), covariance)).reshape(
            len(log_tau)
        )

    def log_prob(self, log_tau: Floats) -> Floats:
        """Log density at each row of ``ln tau`` (W, P), shape (W,); never NaN."""
        log_tau = np.atleast_2d(log_tau)
        with np.errstate(over="ignore", invalid="ignore"):
            value = self.log_prior(log_tau)
            usable = np.isfinite(value) & (np.abs(log_tau) < 300.0).all(axis=-1)
            rows = np.flatnonzero(usable)
            for part in batches(rows.size, self.precision.size, CHUNK):
                value[rows[part]] += self._given(np.exp(log_tau[rows[part]]))[2]
        return np.where(usable & ~np.isnan(value), value, -np.inf)

    def _given(self, tau: Floats) -> tuple[Floats, Floats, Floats]:
        """Precision (W, QP, QP) and pull (W, QP) of level and slopes, and the log marginal likelihood (W,)."""
        p, q = self.width.size, self.matrix.shape[1]
        variance = tau[:, None, :] ** 2  # (W, 1, P)
        inner = np.eye(p) + variance[..., None] * self.precision  # I + T Lambda, (W, C, P, P)
        inverse = np.linalg.inv(inner)
        m = self.precision @ inverse  # Lambda (I + T Lambda)^-1
        h = np.einsum("wcji,cj->wci", inverse, self.pull)  # (I + Lambda T)^-1 eta
        fixed = -0.5 * np.linalg.slogdet(inner)[1] + 0.5 * np.einsum("ci,wci,wci->wc", self.pull, variance, h)
        precision = np.einsum("ca,cb,wcij->waibj", self.matrix, self.matrix, m).reshape(-1, q * p, q * p)
        pull = np.einsum("ca,wci->wai", self.matrix, h).reshape(-1, q * p)
        prior = np.tile(1.0 / self.width**2, q)
        precision = precision + np.diag(prior)
        pull = pull + prior * self._centre(q)
        solved = np.linalg.solve(precision, pull[..., None])[..., 0]
        log_likelihood = fixed.sum(axis=1) + 0.5 * np.einsum("wi,wi->w", pull, solved)
        log_likelihood -= 0.5 * np.linalg.slogdet(precision)[1] - 0.5 * np.log(prior).sum()
        log_likelihood -= 0.5 * float(np.sum(prior * self._centre(q) ** 2))
        return precision, pull, log_likelihood

    def _centre(self, q: int) -> Floats:
        return np.concatenate([self.centre, np.zeros((q - 1) * self.centre.size)])

    def coefficients(self, rng: np.random.Generator, tau: Floats) -> Floats:
        """Draw level and slopes (W, Q, P) given scatters ``tau`` (W, P)."""
        out = np.empty((len(tau), self.matrix.shape[1] * self.width.size))
        for part in batches(len(tau), self.precision.size, CHUNK):
            precision, pull, _ = self._given(tau[part])
            root = np.linalg.cholesky(precision)
            mean = np.linalg.solve(precision, pull[..., None])
            noise = np.linalg.solve(np.swapaxes(root, 1, 2), rng.standard_normal(mean.shape))
            out[part] = (mean + noise)[..., 0]
        return out.reshape(len(tau), self.matrix.shape[1], -1)

    def condition(
        self, place: int, mean: Floats, tau: Floats, rng: np.random.Generator, size: int, wider: float = 1.0
    ) -> tuple[Floats, Floats]:
        """Draw what one condition's coordinates are, given level, slopes and scatter.

        Parameters
        ----------
        place : int
            Which condition.
        mean, tau : ndarray, shape (W, P)
            ``x_c B`` and scatters.
        rng : Generator
        size : int
            Draws for each.
        wider : float
            By how much they are drawn from wider.

        Returns
        -------
        phi : ndarray, shape (W, size, P)
            About the product of N(mean, tau**2) and the Gaussian of the condition.
        log_ratio : ndarray, shape (W, size)
            Log of that product, as a density, over the density that they are drawn from.
        """
        s = self.summaries[place]
        whole = s.precision + np.eye(self.width.size) / tau[:, None, :] ** 2
        root = np.linalg.cholesky(whole)
        centre = np.linalg.solve(whole, (s.pull + mean / tau**2)[..., None])
        noise = rng.standard_normal((len(tau), self.width.size, size))
        phi = centre + wider * np.linalg.solve(np.swapaxes(root, 1, 2), noise)
        log_ratio = 0.5 * (1.0 - wider**2) * np.sum(noise**2, axis=1) + self.width.size * np.log(wider)
        return np.swapaxes(phi, 1, 2), log_ratio
