"""What weighted draws say: copies of equal weight, and quantiles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from sma_bayes.quantities import Floats


def resampled(log_weight: Floats, size: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Numbers of draws of equal weight, by systematic resampling, in random order.

    Parameters
    ----------
    log_weight : ndarray, shape (S,)
        Logarithms of weights, up to a constant.
    size : int
        How many are taken.
    rng : numpy.random.Generator

    Returns
    -------
    ndarray of int, shape (size,)
        Each draw in as many copies as its weight says, to within one.
    """
    passed = np.cumsum(np.exp(log_weight - logsumexp(log_weight)))
    at = (np.arange(size) + rng.random()) / size * passed[-1]
    return rng.permutation(np.searchsorted(passed, at, side="right").clip(max=log_weight.size - 1))


def weighted_quantiles(values: Floats, log_weight: Floats, levels: Sequence[float]) -> Floats:
    """Quantiles of weighted draws.

    Parameters
    ----------
    values : ndarray, shape (S, m)
        Undefined ones count as greater than all others.
    log_weight : ndarray, shape (S,)
        Logarithms of weights that sum to one.
    levels : sequence of float

    Returns
    -------
    ndarray, shape (len(levels), m)
    """
    order = np.argsort(values, axis=0)
    passed = np.cumsum(np.exp(log_weight)[order], axis=0)
    at = [np.minimum((passed < level * passed[-1]).sum(axis=0), len(values) - 1) for level in levels]
    ordered = np.take_along_axis(values, order, axis=0)
    return np.stack([ordered[i, np.arange(values.shape[1])] for i in at])
