"""How a curve may go on beyond the sweep: as a phase with a slope, or as a transformation that is not over.

What a curve misses is a function over the temperatures that were measured. If it has a slope at an end of the sweep,
measurements don't tell what that is of. Over a whole sweep phases rise or fall by a small share of the span, and go
on so; a second step of the transformation that the sweep cuts short has a steep slope there and levels out. The tangent
to the plateau, and with it the start or the finish of the transformation, lies elsewhere in one case than in the other,
by several kelvin where the slope is steep.

Each draw of the curve goes on one way or the other, by Bayes' rule, both as probable beforehand. What is not over goes
on in the direction of the transformation, phases have slopes either way. With the slope s in that direction as a share
of the span over the width of the sweep,

    P(not over | s) = 2 N(s; 0, 1) / (2 N(s; 0, 1) + N(s; 0, 0.15)),    0 where s < 0,

0.23 of a slope of nothing (which is the same either way), one half at 0.24, and 0.99 at 0.5. What is not over levels
out as the model's curve does in its tail, exponentially over the length ``span/(4 greatest slope)``, 1/A2 of the
published one.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np
from scipy.special import expit

from sma_bayes.arrays import Floats
from sma_bayes.fitting.curves import CurveDraws

PHASE_SLOPE_SD = 0.15
"""Standard deviation of the slopes of phases [span of the channel over the width of the sweep], that of the priors of
models whose phases have slopes."""
TRUNCATION_SLOPE_SD = 1.0
"""That of slopes at which a sweep cuts a transformation short: with a sweep 25 times as wide as the length of the tail,
a slope of one leaves 4 % of the span outstanding."""
_GRID_POINTS = 193
"""Temperatures at which the steepest slope of the model is looked for."""


@dataclass(frozen=True, eq=False)
class Unfinished:
    """What curves do beyond a sweep, less what they would do if what they miss went on straight.

    Attributes
    ----------
    low, high : float
        Ends of the sweep [unit of temperature].
    slope : ndarray, shape (N, 2)
        Slopes at both ends of what the curves miss, zero of draws that go on straight [unit of the channel per unit of
        temperature].
    length : float
        Over which what is not over levels out [unit of temperature].
    """

    low: float
    high: float
    slope: Floats
    length: float

    def at(self, temperature: Floats) -> Floats:
        """Change of the curves, shape (N, m), at temperatures (m,) or (N, m); zero within the sweep."""
        below = self._levelled(self.low - temperature, -self.slope[:, :1])
        return below + self._levelled(temperature - self.high, self.slope[:, 1:])

    def _levelled(self, beyond: Floats, slope: Floats) -> Floats:
        distance = np.maximum(beyond, 0.0)
        return np.asarray(slope * (-self.length * np.expm1(-distance / self.length) - distance))


def unfinished(curves: CurveDraws, channel: str) -> Unfinished | None:
    """How the curves of a measured channel go on; None where nothing stands beside those of the model.

    The choice is drawn at random, and the same for the same draws.
    """
    if channel not in curves.weights:
        return None
    record = curves.posterior.records[curves.record]
    low, high = float(record.temperature.min()), float(record.temperature.max())
    width, span = high - low, float(np.ptp(record.observed[channel]))
    middle = np.median(curves.model_theta, axis=0)
    slopes = curves.posterior.model.slope(middle, {"temperature": np.linspace(low, high, _GRID_POINTS)})
    steepest = slopes[channel][np.argmax(np.abs(slopes[channel]))]
    if not np.isfinite(steepest) or steepest == 0.0:
        return None
    ends, outwards = np.array([low, high]), np.array([-width, width])
    missed = curves.discrepancy(channel, np.concatenate([ends, ends + outwards]))
    slope = (missed[:, 2:] - missed[:, :2]) / outwards
    in_direction = np.sign(steepest) * slope * width / span
    goes_on = _generator(curves, channel).random(slope.shape) >= probability_unfinished(in_direction)
    return Unfinished(low, high, np.where(goes_on, 0.0, slope), span / (4.0 * abs(float(steepest))))


def probability_unfinished(slope: Floats) -> Floats:
    """Probability that a slope at the end of a sweep is of a transformation that is not over.

    Parameters
    ----------
    slope : ndarray
        In the direction of the transformation [span of the channel over the width of the sweep].

    Examples
    --------
    >>> probability_unfinished(np.array([-0.3, 0.0, 0.3, 0.5])).round(2)
    array([0.  , 0.23, 0.68, 0.99])
    """
    in_favour = 0.5 * slope**2 * (PHASE_SLOPE_SD**-2 - TRUNCATION_SLOPE_SD**-2) + np.log(
        2.0 * PHASE_SLOPE_SD / TRUNCATION_SLOPE_SD
    )
    return np.where(slope < 0.0, 0.0, expit(in_favour))


def _generator(curves: CurveDraws, channel: str) -> np.random.Generator:
    """One for each set of draws; differences in the last digits between machines don't matter."""
    first = " ".join(f"{x:.5g}" for x in curves.theta[0])
    key = f"{curves.posterior.records[curves.record].key} {channel} {first}"
    return np.random.default_rng(np.frombuffer(hashlib.sha256(key.encode()).digest(), dtype=np.uint32))
