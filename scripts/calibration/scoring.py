"""What a fit says of a known truth: coverage of its 90 % intervals, their widths, and what was chosen."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import sma_bayes
from calibration.curves import Curve, Floats, nearest_published
from calibration.truths import READINGS, Case
from sma_bayes.assess.bands import Band, band_channels
from sma_bayes.assess.nearest import nearest_parameters
from sma_bayes.assess.transformation import tangents, transformation_channel
from sma_bayes.fitting.fit import Fit

THIRDS = ("cold", "middle", "hot")
SAME = 0.1
"""Share of the width of a transformation by which its temperatures may depend on how a curve goes on, to be judged."""
MOVES = 0.02
"""K = F'/X' is judged where the displacement is at least so steep [share of its greatest slope]."""
LETTER = {"displacement": "A", "force": "B"}


def scores(fit: Fit, case: Case, rng: np.random.Generator) -> dict[str, Any]:
    """All scores of one fit of one record.

    Parameters
    ----------
    fit : Fit
    case : Case
    rng : numpy.random.Generator
        For fresh readings.

    Returns
    -------
    dict
        ``curve`` and ``readings`` by channel, ``temperatures``, ``nearest``, ``chosen``, ``converged``.
    """
    bands = {c: sma_bayes.credible_band(fit, c) for c in band_channels(fit.records[0])}
    curve = {c: curve_scores(bands[c], true) for c, true in case.curves.items()}
    if case.stiffness is not None and "stiffness" in bands:
        curve["stiffness"] = curve_scores(
            bands["stiffness"], case.stiffness, _moving(case, bands["stiffness"])
        )
    return {
        "converged": bool(fit.converged),
        "chosen": chosen(fit),
        "curve": curve,
        "readings": reading_scores(bands, case, rng),
        "temperatures": temperature_scores(fit, case),
        "nearest": nearest_scores(fit, case),
    }


def chosen(fit: Fit) -> dict[str, Any]:
    """Model, noise and channels with a discrepancy that the fit took."""
    return {
        "model": fit.posterior.model.name,
        "noise": fit.posterior.noise.name,
        "discrepancy": ", ".join(fit.posterior.discrepancy[0]) or None,
    }


def curve_scores(
    band: Band, true: Curve, judged: np.ndarray[Any, np.dtype[np.bool_]] | None = None
) -> dict[str, Any]:
    """Coverage of a curve by its 90 % bands, and their width over the range of the curve.

    Parameters
    ----------
    judged : ndarray of bool, shape (m,), optional
        Temperatures of the band that count; all measured ones by default.
    """
    judged = ~band.extrapolated if judged is None else judged & ~band.extrapolated
    y = true.value(band.temperature)
    low, high = band.curve["q05"], band.curve["q95"]
    inside = (low <= y) & (y <= high)
    whole = (band.simultaneous["sim90_low"] <= y) & (y <= band.simultaneous["sim90_high"])
    size = float(np.ptp(y[judged])) if judged.any() else float("nan")
    return {
        "pointwise": _mean(inside[judged]),
        **{k: _mean(inside[at & judged]) for k, at in thirds(band.temperature).items()},
        "simultaneous": bool(whole[judged].all()),
        "width": float(np.median((high - low)[judged])) / size,
        "rmse": float(np.sqrt(np.mean((band.curve["q50"] - y)[judged] ** 2))) / size,
    }


def reading_scores(bands: dict[str, Band], case: Case, rng: np.random.Generator) -> dict[str, Any]:
    """Coverage of fresh readings by the 90 % predictive bands, and the width of these over the range of the curve."""
    found: dict[str, list[tuple[Floats, Floats]]] = {c: [] for c in case.curves}
    for _ in range(READINGS):
        logged, readings = case.again(rng)
        for channel, y in readings.items():
            t = bands[channel].temperature
            within = (logged >= t[0]) & (logged <= t[-1])
            low, high = (np.interp(logged, t, bands[channel].predictive[k]) for k in ("pred_q05", "pred_q95"))
            inside = (low <= y) & (y <= high)
            found[channel].append((logged[within], inside[within]))
    out = {}
    for channel, pairs in found.items():
        t, inside = (np.concatenate(x) for x in zip(*pairs, strict=True))
        band = bands[channel]
        size = float(np.ptp(case.curves[channel].value(band.temperature)))
        out[channel] = {
            "all": _mean(inside),
            **{k: _mean(inside[at]) for k, at in thirds(t).items()},
            "width": float(np.median(band.predictive["pred_q95"] - band.predictive["pred_q05"])) / size,
        }
    return out


def temperature_scores(fit: Fit, case: Case) -> dict[str, Any]:
    """Coverage, error of the median and width [K] of As and Af, or Mf and Ms; truth by the same rule.

    A temperature of which the truth knows nothing is left out.
    """
    record = fit.records[0]
    channel = transformation_channel(record)
    if channel is None or fit.posterior.model.stages > 1:  # the rule gives the truth's as of one stage
        return {}
    true = true_temperatures(case, channel)
    out = {}
    for found, value in zip(sma_bayes.transformation_temperatures(fit), true, strict=True):
        if np.isnan(value):
            continue
        low, median, high = found.interval.values()
        out[found.name] = _interval_score(low, median, high, value)
    return out


def true_temperatures(case: Case, channel: str) -> tuple[float, float]:
    """Lower and upper transformation temperature of the true curve by the tangent rule [degC].

    Where nobody knows how the curve goes on beyond the sweep, one that depends on that is NaN: that of the curve as it
    is written down, straight from its ends, and level from there, differ by more than `SAME` of the narrowest
    transformation of the three.
    """
    t, curve = case.record.temperature, case.curves[channel]
    low, high = float(t.min()), float(t.max())

    def rule(way: Callable[[Floats], Floats]) -> Floats:
        found = tangents(lambda x: np.atleast_2d(way(x)), low, high)
        return np.array([found.lower[0], found.upper[0]])

    def level(t: Floats) -> Floats:
        return curve.value(np.clip(t, low, high))

    def straight(t: Floats) -> Floats:
        inside = np.clip(t, low, high)
        return np.asarray(curve.value(inside) + curve.slope(inside) * (t - inside))

    true = rule(curve.value)
    if not case.beyond:
        ways = np.array([true, rule(straight), rule(level)])
        allowed = SAME * np.min(np.diff(ways, axis=1))
        true[~(np.ptp(ways, axis=0) <= allowed)] = np.nan
    return float(true[0]), float(true[1])


def nearest_scores(fit: Fit, case: Case) -> dict[str, Any]:
    """Coverage of the parameters of the published curve nearest to the true one; empty where stiffness was measured.

    Of stiffness alone the published parameters are identified in part only.
    """
    intervals = nearest_intervals(fit)
    out = {}
    for channel in case.curves:
        if channel not in LETTER:
            continue
        true = nearest_published(case.curves[channel], case.record.temperature)
        for number, value in enumerate(true.values(), start=1):
            name = f"{LETTER[channel]}{number}"
            if name in intervals:
                out[name] = _interval_score(*intervals[name].values(), value)
    return out


def nearest_intervals(fit: Fit) -> dict[str, dict[str, float]]:
    """``q05``, ``median`` and ``q95`` of the parameters of the nearest published curve, by name."""
    return {n.name: n.interval for n in nearest_parameters(fit)}


def thirds(temperature: Floats) -> dict[str, np.ndarray[Any, np.dtype[np.bool_]]]:
    """Cold, middle and hot third of the range of temperatures (m,), as masks."""
    low, width = float(temperature.min()), float(np.ptp(temperature))
    number = np.clip(((temperature - low) / width * 3.0).astype(int), 0, 2)
    return {name: number == i for i, name in enumerate(THIRDS)}


def _interval_score(low: float, median: float, high: float, true: float) -> dict[str, Any]:
    return {"covered": bool(low <= true <= high), "error": median - true, "width": high - low, "true": true}


def _moving(case: Case, band: Band) -> np.ndarray[Any, np.dtype[np.bool_]]:
    steep = np.abs(case.curves["displacement"].slope(band.temperature))
    return np.asarray(steep >= MOVES * steep.max())


def _mean(inside: np.ndarray[Any, Any]) -> float | None:
    return float(np.mean(inside)) if inside.size else None
