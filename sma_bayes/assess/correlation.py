"""Posterior distributions of the correlation factor r, of R2 and of the RMSE."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sma_bayes.quantities import Floats
from sma_bayes.results.fit import Fit


@dataclass(frozen=True, slots=True, eq=False)
class Agreement:
    """How well curves and data agree, one value for each draw.

    Attributes
    ----------
    r : ndarray, shape (N,)
        Pearson correlation of data and curve.
    r2 : ndarray, shape (N,)
        ``1 - sum (y - curve)**2 / sum (y - mean y)**2``.
    rmse : ndarray, shape (N,)
        ``sqrt(mean (y - curve)**2)`` [unit of the channel].
    """

    r: Floats
    r2: Floats
    rmse: Floats


def agreement(data: Floats, curve: Floats) -> Agreement:
    """Compare data (n,) or (N, n) with curves (N, n)."""
    y = data - data.mean(axis=-1, keepdims=True)
    c = curve - curve.mean(axis=-1, keepdims=True)
    residual = data - curve
    sst = np.sum(y * y, axis=-1)
    sse = np.sum(residual * residual, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        r = np.sum(y * c, axis=-1) / np.sqrt(sst * np.sum(c * c, axis=-1))
        r2 = 1.0 - sse / sst
    return Agreement(r, np.asarray(r2), np.sqrt(sse / data.shape[-1]))


def correlation_factors(
    fit: Fit, replicated: dict[str, Floats], record: int = 0
) -> tuple[dict[str, Agreement], dict[str, Agreement]]:
    """Agreement of each observed channel with the measured data, and with data replicated from the posterior.

    The first says how well the posterior curves describe this measurement; the second how well they would
    describe a repetition of it if model and noise are right.

    Parameters
    ----------
    fit : Fit
    replicated : dict
        Channel to replicated data (N, n), one for each kept draw.
    record : int
    """
    r = fit.records[record]
    curve = fit.posterior.predict(fit.flat, r.inputs, record=record)
    measured = {c: agreement(r.observed[c], curve[c]) for c in r.channels}
    again = {c: agreement(replicated[c], curve[c][: len(replicated[c])]) for c in r.channels}
    return measured, again
