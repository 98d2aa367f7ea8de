"""How far a posterior moves where its prior or its likelihood is raised to a power a little off one.

Draws are weighted by ``p**(alpha - 1)``, smoothed by Pareto's distribution, and what is weighted is compared with what
is not by the cumulative Jensen-Shannon distance. Its gradient with respect to ``log2(alpha)`` is the sensitivity, as
arviz-stats computes it. The gradient of the mean itself has a closed form, ``ln 2`` times the posterior covariance of
the quantity with ``ln p``.

References
----------
N. Kallioinen, T. Paananen, P.-C. Bürkner, A. Vehtari, "Detecting and diagnosing prior and likelihood sensitivity with
power-scaling", Statistics and Computing 34 (2024) 57 (online 2023), doi:10.1007/s11222-023-10366-5.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sma_bayes.arrays import Floats

THRESHOLD: Final = 0.05
"""Sensitivity from which a quantity counts as sensitive, that of the article. It is reached where doubling the power
moves the mean of a normal distribution by about 0.3 standard deviations; told by 2000 draws, by 0.24."""
POWERS: Final = (0.99, 1.01)
"""Between which the gradient is taken."""
LEAST_DRAWS: Final = 20
"""Draws below which no sensitivity is told."""


def power_sensitivity(values: Floats, log_density: Floats) -> Floats:
    """Sensitivity of quantities to one factor of the posterior.

    Parameters
    ----------
    values : ndarray, shape (S, q)
        Draws of the quantities; those that are not finite are left out, of each quantity by itself.
    log_density : ndarray, shape (S,)
        Logarithm of the factor at each draw.

    Returns
    -------
    ndarray, shape (q,)
        [1]; zero where the factor, or the quantity, is the same in all draws, NaN with fewer than `LEAST_DRAWS` draws.
    """
    out = np.full(values.shape[1], np.nan)
    finite = np.isfinite(values)
    whole = finite.all(axis=0)
    if whole.any():
        out[whole] = _sensitivity(values[:, whole], log_density)
    for i in np.flatnonzero(~whole):
        kept = finite[:, i]
        out[i] = _sensitivity(values[kept, i, None], log_density[kept])[0]
    return out


def _sensitivity(values: Floats, log_density: Floats) -> Floats:
    size, count = values.shape
    if size < LEAST_DRAWS:
        return np.full(count, np.nan)
    varies = np.ptp(values, axis=0) > 0.0
    out = np.zeros(count)
    if not np.ptp(log_density) > 0.0 or not varies.any():
        return out
    from arviz_stats.base import array_stats as stats  # here, since it takes long to import

    centred = log_density - log_density.max()
    weights = []
    for power in POWERS:
        log_weight = stats.power_scale_lw(centred, alpha=power)
        weight = np.exp(log_weight - log_weight.max())
        weights.append(weight[None] / weight.sum())
    for i in np.flatnonzero(varies):
        out[i] = stats.power_scale_sense(values[None, :, i], *weights, *POWERS)
    return out


def mean_gradient(values: Floats, log_density: Floats) -> Floats:
    """Derivative of posterior means (q,) with respect to the binary logarithm of the power of one factor.

    Parameters
    ----------
    values : ndarray, shape (S, q)
        Finite draws.
    log_density : ndarray, shape (S,)
    """
    apart = log_density - log_density.mean()
    return np.asarray(np.log(2.0) * (apart @ (values - values.mean(axis=0))) / len(values))
