"""Several tests judged together: S. Holm, Scandinavian Journal of Statistics 6 (1979) 65."""

from __future__ import annotations

import numpy as np

from sma_bayes.arrays import Floats


def holm_limits(p_values: Floats, rate: float) -> Floats:
    """What each of several p-values may be at most to be rejected, with at most `rate` for one false alarm or more.

    The least of m may be rate/m, the next rate/(m - 1), and so on until one is more; its limit is that of all after it.

    Parameters
    ----------
    p_values : ndarray, shape (m,)
    rate : float
        Probability of a false alarm or more, whatever depends on what [1].

    Returns
    -------
    ndarray, shape (m,)

    Examples
    --------
    >>> p = np.array([0.004, 0.02, 0.001])
    >>> (p <= holm_limits(p, 0.01)).tolist()
    [True, False, True]
    """
    order = np.argsort(p_values, kind="stable")
    limits = rate / np.arange(len(order), 0, -1)
    over = p_values[order] > limits
    if over.any():
        first = int(np.argmax(over))
        limits[first:] = limits[first]
    out = np.empty(len(order))
    out[order] = limits
    return out
