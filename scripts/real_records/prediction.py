"""Predictions of readings, whatever makes them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp, ndtri

from sma_bayes.arrays import Floats
from sma_bayes.records.types import Record


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """What is said of readings that had no part in the fit.

    Attributes
    ----------
    log_density : ndarray, shape (m,)
        Log predictive density at each reading [-log unit of the channel].
    low, high : ndarray, shape (m,)
        Quantiles at 5 and 95 % [unit of the channel].
    """

    log_density: Floats
    low: Floats
    high: Floats


Predictor = Callable[[Record, Record], Prediction]
"""Record to fit and record to predict -> prediction of the latter."""


def normal(y: Floats, mean: Floats, sd: Floats) -> Prediction:
    """Prediction by a normal distribution at each reading."""
    z = (y - mean) / sd
    half = float(ndtri(0.95)) * sd
    return Prediction(-0.5 * z * z - np.log(sd) - 0.5 * np.log(2.0 * np.pi), mean - half, mean + half)


def mixture(log_density: Floats, draws: Floats) -> Prediction:
    """Prediction by draws of equal weight.

    Parameters
    ----------
    log_density : ndarray, shape (S, m)
        At the readings, given each draw of the parameters.
    draws : ndarray, shape (S, m)
        New readings, one for each draw of the parameters.
    """
    low, high = np.quantile(draws, (0.05, 0.95), axis=0)
    return Prediction(logsumexp(log_density, axis=0) - np.log(len(log_density)), low, high)
