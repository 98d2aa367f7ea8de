"""Columns of simple functions: splines and lines of a covariate, one level a cycle, steps, products of them."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline

from sma_bayes.arrays import Floats

MAX_CYCLE_COLUMNS = 8
"""Cycles that get a column of their own; where there are more, neighbours share one."""


def bspline_basis(x: Floats, count: int) -> Floats:
    """Cubic B-splines on equal steps over the range of a covariate, shape (N, count).

    Each is at most 1. For fewer than four the powers of the covariate serve instead.
    """
    low, high = float(np.min(x)), float(np.max(x))
    unit = np.clip((x - low) / max(high - low, 1e-300), 0.0, 1.0)
    if count < 4:
        return np.stack([(2.0 * unit - 1.0) ** k for k in range(count)], axis=1)
    inner = np.linspace(0.0, 1.0, count - 2)
    knots = np.concatenate([np.zeros(3), inner, np.ones(3)])
    return np.asarray(BSpline.design_matrix(unit, knots, 3).toarray())


def indicators(labels: Floats) -> Floats:
    """Columns that are 1 where a label is found, shape (N, number of labels)."""
    return np.asarray(labels[:, None] == np.unique(labels), dtype=float)


def grouped(cycle: Floats) -> Floats:
    """Cycles, neighbours joined where there are more than `MAX_CYCLE_COLUMNS`."""
    distinct, index = np.unique(cycle, return_inverse=True)
    return np.asarray(np.floor(index * min(1.0, MAX_CYCLE_COLUMNS / distinct.size)))


def row_tensor_product(a: Floats, b: Floats) -> Floats:
    """All products of a column of `a` (N, i) and one of `b` (N, j), without those that vanish."""
    product = (a[:, :, None] * b[:, None, :]).reshape(len(a), -1)
    return np.asarray(product[:, np.any(product != 0.0, axis=0)])


def linear(x: Floats) -> Floats:
    """A straight line in a covariate, of unit spread, shape (N, 1)."""
    return np.asarray((x - x.mean())[:, None] / max(float(np.std(x)), 1e-300))


def steps(condition: Floats, count: int) -> list[Floats]:
    """Steps between equal parts of the samples of each condition, which stay in order; `count` times (N, 1)."""
    passed = np.empty(condition.size)
    for label in np.unique(condition):
        own = condition == label
        passed[own] = (np.arange(int(own.sum())) + 0.5) / own.sum()
    return [np.where(passed > k / (count + 1), 0.5, -0.5)[:, None] for k in range(1, count + 1)]
