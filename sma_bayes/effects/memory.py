"""What depends on the past of a history: elapsed time and first-order lags along it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.types import Inputs
from sma_bayes.records.history import starts

BLOCK_TIME_CONSTANTS = 200.0
"""Time constants in one block of the recursion: its weights stay far from overflow."""
MEMORY_TIME_CONSTANTS = 1e6
"""Time constants after which nothing of the past is left."""


def elapsed(inputs: Inputs) -> Floats:
    """Time since the sample before [s], shape (n,); 0 for the first sample of each stretch, whose past is unknown."""
    steps = np.diff(inputs["time"], prepend=inputs["time"][:1])
    return np.where(starts(inputs), 0.0, np.maximum(steps, 0.0))


def lagged(source: Floats, steps: Floats) -> Floats:
    """What follows a source as ``tau dy/dt = source - y``, exact where the source is straight between samples.

    Parameters
    ----------
    source : ndarray, shape (..., n)
    steps : ndarray, shape (..., n)
        Time since the sample before, in time constants; 0 holds the state over a break.

    Returns
    -------
    ndarray, shape (..., n)
        Begins at the first value of the source.
    """
    shape = np.broadcast_shapes(source.shape, steps.shape)
    source, steps = np.broadcast_to(source, shape), np.broadcast_to(steps, shape)
    kept = np.exp(-steps)
    rise = np.diff(source, axis=-1, prepend=source[..., :1])
    mean = np.where(steps > 1e-8, -np.expm1(-steps) / np.maximum(steps, 1e-8), 1.0)
    new = source - kept * (source - rise) - mean * rise
    new[..., 0] = source[..., 0]
    out = np.empty(shape)
    longest = np.cumsum(steps.reshape(-1, shape[-1]).max(axis=0))
    edges = np.flatnonzero(np.diff(np.floor(longest / BLOCK_TIME_CONSTANTS), prepend=-1.0))
    before = np.zeros(shape[:-1])
    for low, high in pairwise([*edges.tolist(), shape[-1]]):
        block = slice(low, high)
        age = np.cumsum(np.where(np.arange(low, high) == low, 0.0, steps[..., block]), axis=-1)
        weighted = new[..., block] * np.exp(age)
        weighted[..., 0] += kept[..., low] * before if low else 0.0
        out[..., block] = np.exp(-age) * np.cumsum(weighted, axis=-1)
        before = out[..., high - 1]
    return out
