"""What a user would take instead: Gaussian processes, smoothing splines, least squares of the published curve.

Each sees temperature and the readings, pooled over the sweeps of a record, and predicts a normal distribution for a
new reading. They need the extra ``bench``.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from scipy.interpolate import make_smoothing_spline
from scipy.optimize import minimize
from scipy.special import expit

from real_records.prediction import Prediction, normal
from sma_bayes.arrays import Floats
from sma_bayes.records.types import Record


class _Scaled:
    """Temperature over its range and readings less their mean over their standard deviation."""

    def __init__(self, train: Record) -> None:
        (y,) = train.observed.values()
        self.low, self.width = float(train.temperature.min()), float(np.ptp(train.temperature))
        self.centre, self.size = float(y.mean()), float(y.std()) or 1.0
        self.u, self.z = self.inputs(train), (y - self.centre) / self.size

    def inputs(self, record: Record) -> Floats:
        return np.asarray((record.temperature - self.low) / self.width)

    def prediction(self, test: Record, mean: Floats, variance: Floats) -> Prediction:
        (y,) = test.observed.values()
        return normal(y, self.centre + self.size * mean, self.size * np.sqrt(np.maximum(variance, 1e-16)))


def gaussian_process(train: Record, test: Record) -> Prediction:
    """scikit-learn's Gaussian process: squared exponential or Matérn 5/2 with white noise, whichever is more likely.

    Hyperparameters maximise the marginal likelihood from two starts.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, Matern, WhiteKernel

    scaled = _Scaled(train)
    bounds = (1e-3, 1e2)
    fits = []
    for shape in (RBF(0.2, bounds), Matern(0.2, bounds, nu=2.5)):
        kernel = ConstantKernel(1.0, (1e-3, 1e4)) * shape + WhiteKernel(1e-3, (1e-10, 1e1))
        process = GaussianProcessRegressor(kernel, alpha=1e-10, n_restarts_optimizer=1, random_state=0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # a hyperparameter at its bound
            fits.append(process.fit(scaled.u[:, None], scaled.z))
    best = max(fits, key=lambda p: p.log_marginal_likelihood_value_)
    mean, sd = best.predict(scaled.inputs(test)[:, None], return_std=True)
    return scaled.prediction(test, mean, sd**2)


def celerite(train: Record, test: Record) -> Prediction:
    """celerite2's Gaussian process, Matérn 3/2 with white noise, in time linear in the samples."""
    import celerite2
    from celerite2 import terms
    from celerite2.driver import LinAlgError

    scaled = _Scaled(train)
    order = np.argsort(scaled.u, kind="stable")
    u, z = scaled.u[order], scaled.z[order]

    def process(p: Floats) -> Any:
        log_sd, log_length, log_noise = p
        found = celerite2.GaussianProcess(terms.Matern32Term(sigma=np.exp(log_sd), rho=np.exp(log_length)))
        found.compute(u, diag=np.full(u.size, np.exp(2.0 * log_noise)))
        return found

    def cost(p: Floats) -> float:
        try:
            return -float(process(p).log_likelihood(z))
        except LinAlgError:  # not positive definite to working precision
            return 1e25

    bounds = [(-4.0, 5.0), (np.log(1e-3), np.log(1e2)), (np.log(1e-5), 1.0)]
    starts = ([0.5, np.log(s), np.log(n)] for s, n in ((1.0, 0.02), (0.3, 0.1)))
    best = min((minimize(cost, s, method="L-BFGS-B", bounds=bounds) for s in starts), key=lambda f: f.fun)
    at = scaled.inputs(test)
    where = np.argsort(at, kind="stable")
    mean, variance = np.empty(at.size), np.empty(at.size)
    mean[where], variance[where] = process(best.x).predict(z, t=at[where], return_var=True)
    return scaled.prediction(test, mean, variance + np.exp(2.0 * best.x[2]))


def smoothing_spline(train: Record, test: Record) -> Prediction:
    """Cubic smoothing spline, its penalty by generalised cross-validation; the band by the sandwich ``s2 (1 + l l')``.

    Readings of equal temperature are averaged and weighted. ``l`` is the row of the linear smoother at the new reading;
    s2 is the residual sum of squares over n less the trace of the smoother.
    """
    scaled = _Scaled(train)
    u, group, count = np.unique(scaled.u, return_inverse=True, return_counts=True)
    mean = np.bincount(group, scaled.z) / count
    weight = count.astype(float)
    penalty = _penalty(u, mean, weight)

    def smoother(z: Floats, at: Floats) -> Floats:
        return np.asarray(make_smoothing_spline(u, z, weight, lam=penalty)(at))

    at = np.clip(scaled.inputs(test), -0.2, 1.2)
    rows = make_smoothing_spline(u, np.eye(u.size), weight, lam=penalty)
    trace = float(np.trace(rows(u)))
    left = float(np.sum((scaled.z - smoother(mean, u)[group]) ** 2))
    variance = left / max(scaled.z.size - trace, 1.0)
    influence = np.sum(rows(at) ** 2 / weight, axis=1)
    return scaled.prediction(test, smoother(mean, at), variance * (1.0 + influence))


def _penalty(u: Floats, y: Floats, weight: Floats) -> float:
    """Penalty of least generalised cross-validation, on a grid, of no more parameters than half the readings.

    Without that bound the criterion takes readings of little noise for noiseless.
    """

    def score(penalty: float) -> float:
        rows = make_smoothing_spline(u, np.eye(u.size), weight, lam=penalty)(u)
        left, used = y - rows @ y, float(np.trace(rows)) / u.size
        return float(np.mean(weight * left * left)) / (1.0 - used) ** 2 if used <= 0.5 else float("inf")

    return min(np.geomspace(1e-10, 1e0, 31).tolist(), key=score)


def published_curve(train: Record, test: Record) -> Prediction:
    """The published curve by `lmfit`, with the standard error of its prediction."""
    import lmfit

    scaled = _Scaled(train)

    def curve(x: Floats, span: float, rate: float, midpoint: float, offset: float) -> Floats:
        return np.asarray(offset + span * expit(rate * (x - midpoint)))

    model = lmfit.Model(curve)
    rising = np.sign(np.corrcoef(scaled.u, scaled.z)[0, 1]) or 1.0
    start = 0.5 * float(np.ptp(scaled.z))
    fits = [
        model.fit(scaled.z, x=scaled.u, span=2.0 * rising * start, rate=k, midpoint=m, offset=-rising * start)
        for k in (8.0, 20.0)
        for m in (0.35, 0.5, 0.65)
    ]
    best = min(fits, key=lambda f: f.chisqr)
    at = scaled.inputs(test)
    mean = best.eval(x=at)
    error = best.eval_uncertainty(x=at, sigma=1) if best.covar is not None else np.zeros(at.size)
    return scaled.prediction(test, mean, np.nan_to_num(error) ** 2 + best.redchi)


BASELINES = {
    "gaussian_process": gaussian_process,
    "celerite": celerite,
    "smoothing_spline": smoothing_spline,
    "published_curve": published_curve,
}
"""Predictors by name."""
TITLES = {
    "ours": "sma_bayes",
    "gaussian_process": "Gaussian process (scikit-learn)",
    "celerite": "Gaussian process (celerite2)",
    "smoothing_spline": "smoothing spline (SciPy)",
    "published_curve": "published curve (lmfit)",
}
