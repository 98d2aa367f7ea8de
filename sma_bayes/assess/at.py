"""Force, displacement and stiffness at given temperatures: intervals of the curve, and of a new measurement."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.assess.bands import new_samples
from sma_bayes.fitting.curves import CurveDraws, quantiles

Curve = Callable[[Floats], Floats]


@dataclass(frozen=True, eq=False)
class IntervalAt:
    """Median and equal-tailed interval at each of m temperatures.

    Attributes
    ----------
    low, median, high : ndarray, shape (m,)
    """

    low: Floats
    median: Floats
    high: Floats


def interval(draws: Floats, level: float) -> IntervalAt:
    """Median and equal-tailed interval that holds a probability, over the draws of the first axis (S, m)."""
    tail = 0.5 * (1.0 - level)
    return IntervalAt(*quantiles(draws, (tail, 0.5, 1.0 - tail), axis=0))


def credible_at(curve: Curve, temperature: Floats, level: float, error: Floats | float = 0.0) -> IntervalAt:
    """Interval of the curve at given temperatures.

    Parameters
    ----------
    curve : callable
        Curves of S draws at temperatures of shape (m,) or (S, m).
    temperature : ndarray, shape (m,)
    level : float
        Probability that the interval holds [1].
    error : ndarray, shape (S,), or float
        Error of the setting of the temperature in each draw; none where 0.
    """
    at = temperature if np.ndim(error) == 0 else temperature + np.asarray(error)[:, None]
    return interval(curve(at), level)


def predictive_at(
    curves: CurveDraws,
    channel: str,
    temperature: Floats,
    level: float,
    seed: int,
    error: Floats | float = 0.0,
) -> IntervalAt | None:
    """Interval of a new measurement at given temperatures; None where the channel was not measured itself.

    Parameters
    ----------
    curves : CurveDraws
    channel : str
    temperature : ndarray, shape (m,)
        [unit of temperature of the record]
    level : float
        Probability that the interval holds [1].
    seed : int
        Decides the noise.
    error : ndarray, shape (S,), or float
        As `credible_at` takes it.
    """
    record = curves.posterior.records[curves.record]
    if channel not in record.channels:
        return None
    rng = np.random.default_rng(np.random.SeedSequence([seed, 7, *f"{record.key} {channel}".encode()]))
    drawn = new_samples(curves, channel, temperature, rng)
    if np.ndim(error):
        at = temperature + np.asarray(error)[:, None]
        drawn = drawn + curves.curve(channel, at) - curves.curve(channel, temperature)
    return interval(drawn, level)
