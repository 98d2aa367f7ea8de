"""Importance draws of many posteriors that are alike but for a simulated measurement.

A few of them are sampled thoroughly. Their draws, each in coordinates in which the mode is at 0 and the covariance
there is 1, give one shape. Moved to the mode of another posterior and stretched to the covariance there it is a
proposal for it, and its weights tell whether it does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.sampling.bridge import fitted_proposal
from sma_bayes.sampling.density import Density
from sma_bayes.sampling.importance import WeightedDraws, drawn_if_enough, few_draws
from sma_bayes.sampling.laplace import Mode, find_mode
from sma_bayes.sampling.proposals import DrawSource

LEAST_POSTERIORS: Final = 4
"""Posteriors that a shape is found of, at least."""
COMPONENTS: Final = 4
"""Of the mixture that is fitted to their draws."""


@dataclass(frozen=True, slots=True, eq=False)
class CommonShape:
    """What posteriors that are alike have in common.

    Attributes
    ----------
    root : ndarray, shape (D, D)
        Of their mean covariance. About it covariances are stretched, so that axes of one are those of all.
    shape : DrawSource
        With the mode at 0 and the covariance there 1.
    """

    root: Floats
    shape: DrawSource

    @staticmethod
    def of(found: Sequence[WeightedDraws], rng: np.random.Generator) -> CommonShape | None:
        """Of draws of some of the posteriors; None where too few of them converged to one mode."""
        usable = [(f, f.modes[0]) for f in found if f.converged and len(f.modes) == 1]
        if len(usable) < LEAST_POSTERIORS:
            return None
        root = np.linalg.cholesky(np.mean([mode.covariance for _, mode in usable], axis=0))
        u = np.concatenate([np.linalg.solve(stretched(root, mode), (f.z - mode.z).T).T for f, mode in usable])
        weight = np.concatenate([np.exp(f.log_weight) for f, _ in usable])
        return CommonShape(root, fitted_proposal(u, weight / weight.sum(), COMPONENTS, rng))


@dataclass(frozen=True, slots=True, eq=False)
class AboutMode:
    """A shape moved to a mode and stretched.

    Attributes
    ----------
    shape : DrawSource
    mean : ndarray, shape (D,)
    root : ndarray, shape (D, D)
    """

    shape: DrawSource
    mean: Floats
    root: Floats

    def draw(self, rng: np.random.Generator, size: int) -> tuple[Floats, Floats]:
        """Points (size, D) and their log density (size,)."""
        u, log_q = self.shape.draw(rng, size)
        return self.mean + u @ self.root.T, log_q - self._log_volume

    def log_density(self, z: Floats) -> Floats:
        """Log density at any points, shape (W,)."""
        return (
            self.shape.log_density(np.asarray(np.linalg.solve(self.root, (z - self.mean).T).T))
            - self._log_volume
        )

    @property
    def _log_volume(self) -> float:
        return float(np.linalg.slogdet(self.root)[1])


def stretched(root: Floats, mode: Mode) -> Floats:
    """Root R of the covariance C of a mode, ``R R' = C``; it is `root` (D, D) where that is a root of C."""
    whitened = np.linalg.solve(root, np.linalg.solve(root, mode.covariance).T)
    scale, axes = np.linalg.eigh(0.5 * (whitened + whitened.T))
    return np.asarray(root @ (axes * np.sqrt(np.maximum(scale, 0.0))) @ axes.T)


def refitted(
    density: Density,
    start: Floats,
    width: Floats,
    seed: np.random.SeedSequence,
    size: int,
    common: CommonShape | None,
) -> WeightedDraws:
    """Sample one of very many similar densities: draws of the common shape where these do, else `few_draws`.

    Parameters
    ----------
    density : Density
    start : ndarray, shape (D,)
    width : ndarray, shape (D,)
        As those of `sma_bayes.sampling.importance.few_draws`.
    seed : numpy.random.SeedSequence
    size : int
    common : CommonShape or None
        None where none is known.
    """
    shape_seed, other_seed = seed.spawn(2)
    mode = None if common is None else find_mode(density, start, width)
    if common is not None and mode is not None:
        proposal = AboutMode(common.shape, mode.z, stretched(common.root, mode))
        found = drawn_if_enough(density, proposal, [mode], np.random.default_rng(shape_seed), size)
        if found is not None:
            return found
    return few_draws(density, [start], width, other_seed, size)
