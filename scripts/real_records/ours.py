"""The package's own fit, as a user calls it, as a predictor of readings."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import sma_bayes
from real_records.prediction import Prediction, mixture
from real_records.records import Measured, scatter_of_readings
from sma_bayes.assess.bands import curve_draws, noise_of_samples
from sma_bayes.noise import Steps
from sma_bayes.noise.types import lag1
from sma_bayes.quantities import Floats
from sma_bayes.records.types import Campaign, Record
from sma_bayes.results.fit import Fit


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
        curve = curve_draws(fit, channel, test.temperature)
        place = fit.posterior.layout[0]
        own, theta = fit.flat[:, place.noise[channel]], fit.flat[:, place.model]
        rng = np.random.default_rng(0)
        noise = noise_of_samples(fit.posterior, channel, own, theta, test.temperature, rng)
        density = log_noise_density(fit, channel, test.temperature, test.observed[channel] - curve)
        return mixture(density, curve + noise)


def log_noise_density(fit: Fit, channel: str, temperature: Floats, residual: Floats) -> Floats:
    """Log density of the residuals of new readings that follow no other, one row for each draw of the fit.

    Parameters
    ----------
    temperature : ndarray, shape (m,)
    residual : ndarray, shape (S, m)
        [unit of the channel].

    Returns
    -------
    ndarray, shape (S, m)
    """
    posterior, place, m = fit.posterior, fit.posterior.layout[0], temperature.size
    own = fit.flat[:, place.noise[channel]]
    scale = np.broadcast_to(own[:, :1], residual.shape)
    temperature_sd = posterior.records[0].temperature_sd
    if temperature_sd > 0.0:
        slope = posterior.model.slope(fit.flat[:, place.model], {"temperature": temperature})[channel]
        scale = np.hypot(scale, slope * temperature_sd)
    alone = Steps(np.ones(m, dtype=bool), np.ones(m), False)
    return np.asarray(posterior.noise.log_density(residual / scale, own[:, 1:], alone) - np.log(scale))


def described(measured: Measured, ours: Ours) -> dict[str, Any]:
    """What a fit of the whole record leaves.

    Returns
    -------
    dict
        ``model``, ``noise``, ``discrepancy``, ``converged``; ``rmse`` of the median curve over the range; ``lag1`` of
        the innovations, median over the draws; ``width`` of the 90 % predictive band, median over the samples, over
        that of normal noise of the readings' own scatter; ``scatter`` of the readings over the range; ``seconds`` of
        processor time.
    """
    record, channel = measured.record, measured.channel
    began = time.process_time()
    fit = ours.fit(record)
    seconds = time.process_time() - began
    curve = curve_draws(fit, channel, record.temperature)
    left = record.observed[channel] - np.median(curve, axis=0)
    innovations = fit.posterior.residuals(fit.flat[:: max(1, len(fit.flat) // 200)])[0][channel]
    band = sma_bayes.credible_band(fit, channel)
    wide = np.median(
        np.interp(
            record.temperature, band.temperature, band.predictive["pred_q95"] - band.predictive["pred_q05"]
        )
    )
    scatter = scatter_of_readings(record, channel)
    discrepancy = getattr(fit.posterior, "discrepancy", None)
    return {
        "model": fit.posterior.model.name,
        "noise": fit.posterior.noise.name,
        "discrepancy": None if discrepancy is None else str(getattr(discrepancy, "name", True)),
        "converged": bool(fit.converged),
        "rmse": float(np.sqrt(np.mean(left * left))) / measured.size,
        "lag1": float(np.median(lag1(innovations, fit.posterior.steps[0]))),
        "width": float(wide) / (2.0 * 1.6448536 * scatter),
        "scatter": scatter / measured.size,
        "seconds": seconds,
    }


def without_calibration(record: Record) -> Record:
    """A record whose calibration is taken as exact: held-out readings share it with those that were fitted."""
    return replace(record, calibration={})
