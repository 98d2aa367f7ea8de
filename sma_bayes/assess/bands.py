"""Credible bands of the curves, pointwise and simultaneous, and predictive bands of a new measurement."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sma_bayes.arrays import Floats, Ints
from sma_bayes.fitting.curves import CurveDraws, quantiles, quantiles_of_ordered
from sma_bayes.fitting.fit import Fit
from sma_bayes.noise import Steps
from sma_bayes.quantities import ARBITRARY, convert
from sma_bayes.records.types import Record
from sma_bayes.response.arrangement import ArrangedSpring, overall_stiffness
from sma_bayes.response.modified_sigmoid import channel_unit

QUANTILES = {"q025": 0.025, "q05": 0.05, "q25": 0.25, "q50": 0.5, "q75": 0.75, "q95": 0.95, "q975": 0.975}
LEVELS = {"50": 0.5, "90": 0.9, "95": 0.95}
PREDICTIVE = {"pred_q05": 0.05, "pred_q50": 0.5, "pred_q95": 0.95}
GRID = 161
"""Temperatures at which a band is given."""


@dataclass(frozen=True, eq=False)
class Band:
    """Bands of one channel against temperature.

    Attributes
    ----------
    channel, unit : str
    temperature : ndarray, shape (m,)
    curve : mapping of str to ndarray, shape (m,)
        Pointwise quantiles of the curve, by the names in `QUANTILES`.
    simultaneous : mapping of str to ndarray, shape (m,)
        ``sim50_low``, ``sim50_high`` and so on: the whole curve lies inside with that probability.
    predictive : mapping of str to ndarray, shape (m,)
        Quantiles of a new measurement, by the names in `PREDICTIVE`; NaN where the channel was not measured
        itself, so that its noise is not known.
    extrapolated : ndarray of bool, shape (m,)
        True beyond the observed temperatures.
    derived : bool
        True where the curve follows from other channels.
    """

    channel: str
    unit: str
    temperature: Floats
    curve: Mapping[str, Floats]
    simultaneous: Mapping[str, Floats]
    predictive: Mapping[str, Floats]
    extrapolated: np.ndarray[tuple[int], np.dtype[np.bool_]]
    derived: bool

    def columns(self, temperature_unit: str) -> dict[str, object]:
        """The band as columns of a file: temperature, quantiles of the curve and of a new measurement, simultaneous."""
        return {
            f"temperature_{temperature_unit}": self.temperature,
            **self.curve,
            **self.predictive,
            **self.simultaneous,
            "extrapolated": self.extrapolated,
        }


def band_channels(record: Record) -> tuple[str, ...]:
    """Channels that have a band: the observed ones, and stiffness where force and displacement give it."""
    observed = record.channels
    if "stiffness" not in observed and {"force", "displacement"} <= set(observed):
        return (*observed, "stiffness")
    return observed


def temperature_grid(record: Record, extrapolate: float = 0.0) -> Floats:
    """Even temperatures over what was observed, and `extrapolate` [unit of temperature] beyond at both ends."""
    low, high = float(record.temperature.min()), float(record.temperature.max())
    return np.linspace(low - extrapolate, high + extrapolate, GRID)


def curve_draws(fit: Fit, channel: str, temperature: Floats, record: int = 0) -> Floats:
    """Curves of a channel, one for each kept draw, calibration included; shape (N, m)."""
    return fit.curves(record).curve(channel, temperature)


def credible_band(fit: Fit, channel: str, record: int = 0, extrapolate: float = 0.0) -> Band:
    """Bands of one channel of one record.

    Parameters
    ----------
    fit : Fit
    channel : str
        One of `band_channels`.
    record : int
        Which of the records that share the posterior.
    extrapolate : float
        How far to go beyond the observed temperatures [unit of temperature]; what lies there is marked.
    """
    r = fit.records[record]
    t = temperature_grid(r, extrapolate)
    curve = curve_draws(fit, channel, t, record)
    return _band(r, channel, t, curve, _predictive(fit, channel, t, record, curve))


def _band(record: Record, channel: str, t: Floats, curve: Floats, predictive: dict[str, Floats]) -> Band:
    measured = channel in record.channels
    order, in_order = _in_order(curve)
    values = quantiles_of_ordered(in_order, list(QUANTILES.values()))
    return Band(
        channel=channel,
        unit=channel_unit(record.units, channel if measured else "stiffness"),
        temperature=t,
        curve=dict(zip(QUANTILES, values, strict=True)),
        simultaneous=_simultaneous(order, in_order),
        predictive=predictive,
        extrapolated=(t < record.temperature.min() - 1e-12) | (t > record.temperature.max() + 1e-12),
        derived=not measured,
    )


def overall_band(fit: Fit, bias: ArrangedSpring, record: int = 0, extrapolate: float = 0.0) -> Band | None:
    """Bands of the stiffness of the spring together with its bias spring, Eq. (8).

    The bias spring's stiffness is drawn from a normal distribution, one value for each curve.

    Returns
    -------
    Band or None
        None where no stiffness follows from the record, or its unit can't be compared with N/m.
    """
    r = fit.records[record]
    unit = channel_unit(r.units, "stiffness")
    if "stiffness" not in band_channels(r) or r.specimen or unit == ARBITRARY:
        return None
    t = temperature_grid(r, extrapolate)
    k1 = curve_draws(fit, "stiffness", t, record)
    k2 = bias_draws(bias, fit.seed, r.key, len(k1), unit)
    curve = overall_stiffness(k1, k2[:, None], bias.arrangement)
    return _band(r, "overall_stiffness", t, curve, _no_measurement(t))


def bias_draws(bias: ArrangedSpring, seed: int, key: str, size: int, unit: str) -> Floats:
    """Stiffness of the bias spring for each draw of a record [unit], shape (size,)."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, 5, *key.encode()]))
    drawn = bias.stiffness + bias.sd * rng.standard_normal(size)
    return convert(drawn, "N/m", unit, what="bias stiffness")


def simultaneous_band(curve: Floats) -> dict[str, Floats]:
    """Bands that hold whole curves with the stated probability.

    Pointwise quantiles of equal tails are widened until the wanted share of the draws lies inside at every
    point (J. Besag, P. Green, D. Higdon, K. Mengersen, Statistical Science 10 (1995) 3, section 6.3). Ranks
    make it independent of the scale of the channel.

    Parameters
    ----------
    curve : ndarray, shape (N, m)
        Draws of the curve.
    """
    return _simultaneous(*_in_order(curve))


def _in_order(curve: Floats) -> tuple[Ints, Floats]:
    """Order of the draws (N, m) at each point, and the draws in that order, both (m, N)."""
    at_points = np.ascontiguousarray(curve.T)
    order = np.argsort(at_points, axis=1)
    return order, np.take_along_axis(at_points, order, axis=1)


def _simultaneous(order: Ints, in_order: Floats) -> dict[str, Floats]:
    """The same from the order of the draws at each point and the draws in that order, both (m, N)."""
    count = order.shape[1]
    rank = np.arange(count, dtype=np.int32)
    inside = np.empty(order.shape, dtype=np.int32)
    np.put_along_axis(inside, order, np.minimum(rank, count - 1 - rank)[None], axis=1)
    depth = inside.min(axis=0)  # how deep a curve stays inside all others
    deepest_first = np.sort(depth)[::-1]
    out = {}
    for name, level in LEVELS.items():
        k = int(deepest_first[min(int(np.ceil(level * count)) - 1, count - 1)])
        out[f"sim{name}_low"] = in_order[:, k]
        out[f"sim{name}_high"] = in_order[:, count - 1 - k]
    return out


def _predictive(fit: Fit, channel: str, t: Floats, record: int, curve: Floats) -> dict[str, Floats]:
    r = fit.records[record]
    if channel not in r.channels:
        return _no_measurement(t)
    rng = np.random.default_rng(np.random.SeedSequence([fit.seed, 1, *f"{r.key} {channel}".encode()]))
    new = new_samples(fit.curves(record), channel, t, rng, curve)
    values = quantiles(np.ascontiguousarray(new.T), list(PREDICTIVE.values()), axis=1)
    return dict(zip(PREDICTIVE, values, strict=True))


def new_samples(
    curves: CurveDraws,
    channel: str,
    temperature: Floats,
    rng: np.random.Generator,
    curve: Floats | None = None,
) -> Floats:
    """New samples that follow no other, errors of the readings of temperature included.

    Parameters
    ----------
    curves : CurveDraws
        Of S draws.
    channel : str
        That was measured.
    temperature : ndarray, shape (m,)
        Readings [unit of temperature].
    rng : numpy.random.Generator
    curve : ndarray, shape (S, m), optional
        The curves at these temperatures, where they are known already [unit of the channel].

    Returns
    -------
    ndarray, shape (S, m)
        [unit of the channel].
    """
    posterior, record, theta = curves.posterior, curves.record, curves.theta
    shape = posterior.noise_shape(theta, record, channel)
    series = posterior.noise.draw(rng, shape, Steps.apart(temperature.size))
    spread = posterior.temperature_sd(theta, record)
    true: Floats = temperature
    if spread is not None:
        true = temperature + spread[:, None] * rng.standard_normal((len(theta), temperature.size))
    clean = curve if spread is None and curve is not None else curves.curve(channel, true)
    scale = posterior.noise_scale(theta, record, channel, clean)
    apart = posterior.of_new_sweeps(rng, theta, record, channel, true)
    return np.asarray(clean + scale * series + apart)


def _no_measurement(t: Floats) -> dict[str, Floats]:
    return {name: np.full(t.size, np.nan) for name in PREDICTIVE}
