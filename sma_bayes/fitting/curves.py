"""Curves of a posterior, one for each draw: model, discrepancy and the uncertainty of calibrations together."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats, Ints
from sma_bayes.fitting.posterior import Posterior
from sma_bayes.response.base import ResponseModel

Errors = Mapping[str, tuple[Floats, Floats]]
"""Channel, or ``temperature``, to gain and shift (S,) of its calibration: a true value is ``gain * value + shift``."""


@dataclass(frozen=True, eq=False)
class CurveDraws:
    """Curves of one record, one for each of S draws.

    Attributes
    ----------
    posterior : Posterior
    theta : ndarray, shape (S, P)
        Draws of all parameters, the errors of calibrations carried into them (`calibrated_parameters`).
    weights : mapping of str to ndarray, shape (S, m)
        Channel to weights of its discrepancy, as they are before calibration.
    calibration : mapping
        Errors of calibrations, as far as they are uncertain.
    record : int
        Which of the records that share the posterior.
    """

    posterior: Posterior
    theta: Floats
    weights: Mapping[str, Floats] = field(default_factory=dict)
    calibration: Errors = field(default_factory=dict)
    record: int = 0

    @property
    def model_theta(self) -> Floats:
        """Draws of the parameters of the model, shape (S, number of them)."""
        return np.asarray(self.theta[:, self.posterior.layout[self.record].model])

    def curve(self, channel: str, temperature: Floats, stage: int | None = None) -> Floats:
        """Curves of a channel, stiffness also where it follows from force and displacement.

        Parameters
        ----------
        channel : str
        temperature : ndarray, shape (m,) or (S, m)
            [unit of temperature]
        stage : int, optional
            Of force or displacement with one stage of the transformation alone; see `ResponseModel.stage`.

        Returns
        -------
        ndarray, shape (S, m)
            [unit of the channel]
        """
        if channel not in self.posterior.model.channels:
            return self._path_stiffness(temperature)
        model = self.posterior.model
        with np.errstate(over="ignore", invalid="ignore"):
            if stage is None:
                value = model.predict(self.model_theta, {"temperature": temperature})[channel]
            else:
                value = model.stage(self.model_theta, channel, temperature, stage)
        value = self._of_observed_stiffness(channel, value)
        if channel in self.weights:
            value = value + self._gain(channel) * self._missed(channel, temperature)
        return value

    def slope(self, channel: str, temperature: Floats) -> Floats:
        """Derivatives of the curves of a measured channel with respect to temperature, shape (S, m)."""
        with np.errstate(over="ignore", invalid="ignore"):
            slope = self.posterior.model.slope(self.model_theta, {"temperature": temperature})[channel]
        if channel == "stiffness":  # no parameter stands for its gain
            slope = self._gain(channel) * slope
        if channel in self.weights:
            basis = self.posterior.discrepancy[self.record][channel]
            at = self._read(temperature)
            change = basis.function_slope(self.weights[channel], at)
            slope = slope + self._gain(channel) / self._gain("temperature") * change
        return np.asarray(slope)

    def _path_stiffness(self, temperature: Floats) -> Floats:
        if not self.weights:
            return self.posterior.model.stiffness(self.model_theta, {"temperature": temperature})
        force, displacement = (self.slope(c, temperature) for c in ("force", "displacement"))
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            return np.asarray(force / displacement)

    def with_mean_discrepancy(self) -> CurveDraws:
        """The same curves beside the mean of their discrepancies."""
        mean = {c: np.broadcast_to(w.mean(axis=0), w.shape) for c, w in self.weights.items()}
        return replace(self, weights=mean)

    def discrepancy(self, channel: str, temperature: Floats) -> Floats:
        """What the curve of the model misses, shape (S, m); zero where nothing stands beside it."""
        if channel not in self.weights:
            return np.zeros((len(self.theta), np.shape(temperature)[-1]))
        return np.asarray(self._gain(channel) * self._missed(channel, temperature))

    def _missed(self, channel: str, temperature: Floats) -> Floats:
        basis = self.posterior.discrepancy[self.record][channel]
        return basis.function(self.weights[channel], self._read(temperature))

    def _read(self, temperature: Floats) -> Floats:
        """What the thermometer reads at true temperatures, shape (m,) or (S, m)."""
        if "temperature" not in self.calibration:
            return temperature
        gain, shift = self.calibration["temperature"]
        return np.asarray((temperature - shift[:, None]) / gain[:, None])

    def _gain(self, channel: str) -> Floats:
        """Gain (S, 1) of a calibration, or one."""
        return self.calibration[channel][0][:, None] if channel in self.calibration else np.ones((1, 1))

    def _of_observed_stiffness(self, channel: str, value: Floats) -> Floats:
        """Calibration of a stiffness that was measured itself: no parameter stands for its gain."""
        if channel != "stiffness" or channel not in self.calibration:
            return np.asarray(value)
        gain, shift = self.calibration[channel]
        return np.asarray(gain[:, None] * value + shift[:, None])


def evenly_chosen(temperature: Floats, most: int) -> Floats:
    """At most so many of some temperatures, ascending, from the lowest to the highest.

    Examples
    --------
    >>> evenly_chosen(np.array([4.0, 1.0, 2.0, 5.0, 3.0]), 3)
    array([1., 3., 5.])
    """
    t = np.sort(temperature)
    return np.asarray(t[np.linspace(0, t.size - 1, min(most, t.size)).round().astype(int)])


def calibrated_parameters(
    posterior: Posterior, theta: Floats, calibration: Errors, record: int = 0
) -> Floats:
    """Draws (S, P) with the errors of calibrations carried into the parameters that stand for them.

    Those of force and displacement go into spans, offsets and slopes, those of the thermometer into midpoints and
    rates.
    """
    out = np.array(theta, dtype=float)
    at = posterior.layout[record].model
    out[:, at] = calibrated_curve(posterior.model, out[:, at], calibration)
    return out


def calibrated_curve(model: ResponseModel, theta: Floats, calibration: Errors) -> Floats:
    """The same for draws (S, P) of the parameters of a model alone."""
    for channel, (gain, shift) in calibration.items():
        if channel == "temperature":
            theta = model.with_thermometer(theta, gain, shift)
        elif channel != "stiffness":
            theta = model.calibrated(theta, channel, gain, shift)
    return theta


def undone(errors: Errors) -> Errors:
    """Errors that take those of the same draws out again."""
    return {c: (1.0 / gain, -shift / gain) for c, (gain, shift) in errors.items()}


def errors_of(errors: Errors, which: Ints | slice) -> Errors:
    """Errors of some of the draws."""
    return {c: (gain[which], shift[which]) for c, (gain, shift) in errors.items()}


INTERVAL: Final = {"q05": 0.05, "median": 0.5, "q95": 0.95}
"""Levels of the median and the equal-tailed 90 % interval, by the keys that documents have for them."""


def as_interval(values: Iterable[float]) -> dict[str, float]:
    """Quantiles at the levels of `INTERVAL`, by its keys."""
    return dict(zip(INTERVAL, map(float, values), strict=True))


def interval(draws: Floats) -> dict[str, float]:
    """Median and equal-tailed 90 % interval of draws, as ``q05``, ``median`` and ``q95``; see `quantiles`."""
    return as_interval(quantiles(draws, tuple(INTERVAL.values())))


def interval_where_defined(draws: Floats) -> dict[str, float]:
    """Median and equal-tailed 90 % interval of the draws that have a value; NaN where none has."""
    found = draws[~np.isnan(draws)]
    return interval(found) if found.size else dict.fromkeys(INTERVAL, math.nan)


def quantiles(draws: Floats, levels: Sequence[float], axis: int | None = None) -> Floats:
    """Quantiles of draws that may be infinite, as a stiffness is where the displacement stands still.

    Between two ordered draws of which one is infinite lies that one; between both infinities the nearer. An undefined
    draw (NaN) leaves the quantile undefined.

    Parameters
    ----------
    draws : ndarray
    levels : sequence of float
    axis : int, optional
        Of the draws; all by default.

    Returns
    -------
    ndarray
        The levels come first.

    Examples
    --------
    >>> quantiles(np.array([-np.inf, -np.inf, 1.0, 2.0, np.inf, np.inf]), (0.1, 0.5, 0.9)).tolist()
    [-inf, 1.5, inf]
    """
    ordered = np.sort(
        draws, axis=axis
    )  # a few times as fast as to part them at each level, as numpy.quantile does
    return quantiles_of_ordered(ordered, levels, -1 if axis is None else axis)


def quantiles_of_ordered(ordered: Floats, levels: Sequence[float], axis: int = -1) -> Floats:
    """The same of draws that are in ascending order along an axis, undefined ones (NaN) last."""
    n = ordered.shape[axis]
    place = np.asarray(levels, dtype=float) * (n - 1)
    at = np.floor(place).astype(int)
    share = (place - at).reshape(-1, *[1] * (ordered.ndim - 1))
    in_front = np.moveaxis(ordered, axis, 0)
    below, above = in_front[at], in_front[np.minimum(at + 1, n - 1)]
    with np.errstate(invalid="ignore", over="ignore"):
        step = above - below
        value = np.where(share < 0.5, below + step * share, above - step * (1.0 - share))
    infinite = np.isinf(below) | np.isinf(above)
    if infinite.any():
        nearest = in_front[np.rint(place).astype(int)]
        one = np.where(np.isinf(below), np.where(np.isinf(above), nearest, below), above)
        value = np.where(infinite, np.where(share > 0.0, one, below), value)
    return np.where(np.isnan(in_front[-1]), np.nan, value)
