"""The package's own fit, as a user calls it, as a predictor of readings."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import sma_bayes
from real_records.prediction import Prediction, mixture
from real_records.records import Measured, scatter_of_readings
from sma_bayes.arrays import Floats
from sma_bayes.fitting.fit import Fit
from sma_bayes.noise import Steps
from sma_bayes.noise.base import lag1
from sma_bayes.records.types import Campaign, Record


@dataclass(frozen=True, slots=True)
class Ours:
    """`sma_bayes.fit` with its defaults.

    Attributes
    ----------
    model : str
        As `sma_bayes.fit` takes it; empty for its default.
    """

    model: str = ""

    def fit(self, record: Record) -> Fit:
        """Fit one record."""
        campaign = Campaign("record", "record", "", (record,))
        chosen = {"model": self.model} if self.model else {}
        (found,) = sma_bayes.fit(campaign, jobs=1, **chosen).values()
        return found

    def __call__(self, train: Record, test: Record) -> Prediction:
        """Predict readings; each as if it followed no other."""
        fit = self.fit(train)
        (channel,) = train.channels
        return predicted(fit, channel, test.temperature, test.observed[channel])


def predicted(fit: Fit, channel: str, temperature: Floats, readings: Floats) -> Prediction:
    """Prediction of readings of one channel that follow no other.

    Given the parameters and the discrepancy of a draw, a reading scatters about the curve at the temperature that was
    really there; where the thermometer errs, that temperature is drawn, too, anew for each draw and reading.

    Parameters
    ----------
    temperature, readings : ndarray, shape (m,)
        As logged [degC]; [unit of the channel].
    """
    posterior, theta, rng = fit.posterior, fit.flat, np.random.default_rng(0)
    spread = posterior.temperature_sd(theta)
    there = np.broadcast_to(temperature, (len(theta), temperature.size))
    if spread is not None:
        there = there + spread[:, None] * rng.standard_normal(there.shape)
    curve = posterior.predict(theta, {"temperature": there}, weights=fit.discrepancy)[channel]
    curve = curve + posterior.of_new_sweeps(rng, theta, 0, channel, there)
    scale = np.broadcast_to(posterior.noise_scale(theta, 0, channel, curve), curve.shape)
    shape, apart = theta[:, posterior.layout[0].noise[channel][1:]], Steps.apart(temperature.size)
    density = posterior.noise.log_density((readings - curve) / scale, shape, apart) - np.log(scale)
    return mixture(density, curve + scale * posterior.noise.draw(rng, shape, apart))


def described(measured: Measured, ours: Ours) -> dict[str, Any]:
    """What a fit of the whole record leaves.

    Returns
    -------
    dict
        ``model``, ``noise``, ``converged``; ``discrepancy``, its root mean square over the range, or None; ``rmse`` of
        the median curve, discrepancy included, over the range; ``lag1`` of the innovations, median over the draws;
        ``width`` of the 90 % predictive band, median over the samples, over that of normal noise of the readings' own
        scatter; ``scatter`` of the readings over the range; ``seconds`` of processor time.
    """
    record, channel = measured.record, measured.channel
    began = time.process_time()
    fit = ours.fit(record)
    seconds = time.process_time() - began
    curve = fit.posterior.predict(fit.flat, record.inputs, weights=fit.discrepancy)[channel]
    left = record.observed[channel] - np.median(curve, axis=0)
    innovations = fit.posterior.residuals(fit.flat, fit.discrepancy)[0][channel]
    band = sma_bayes.credible_band(fit, channel)
    wide = np.median(
        np.interp(
            record.temperature, band.temperature, band.predictive["pred_q95"] - band.predictive["pred_q05"]
        )
    )
    scatter = scatter_of_readings(record, channel)
    return {
        "model": fit.posterior.model.name,
        "noise": fit.posterior.noise.name,
        "discrepancy": _discrepancy(fit, measured),
        "converged": bool(fit.converged),
        "rmse": float(np.sqrt(np.mean(left * left))) / measured.size,
        "lag1": float(np.median(lag1(innovations, fit.posterior.steps[0].first))),
        "width": float(wide) / (2.0 * 1.6448536 * scatter),
        "scatter": scatter / measured.size,
        "seconds": seconds,
    }


def _discrepancy(fit: Fit, measured: Measured) -> float | None:
    """Root mean square of the discrepancy over the samples and draws, over the range; None where there is none."""
    basis = fit.posterior.discrepancy[0].get(measured.channel)
    if basis is None:
        return None
    missed = basis.function(fit.discrepancy[0][measured.channel], measured.record.temperature)
    return float(np.sqrt(np.mean(missed * missed))) / measured.size


def without_calibration(record: Record) -> Record:
    """A record whose calibration is taken as exact: held-out readings share it with those that were fitted."""
    return replace(record, calibration={})
