"""Weighing draws of the population by the likelihoods of the conditions, where Gaussians are not all that these say.

See `population` for the weights. What is estimated of each condition is the ratio of its likelihood, noise parameters
integrated out, to its Gaussian form.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from sma_bayes.arrays import Floats
from sma_bayes.assess.draws import RecordDraws
from sma_bayes.sampling.pareto import MAX_RELIABLE_K, smoothed_weights
from sma_bayes.sampling.weighted import resampled
from sma_bayes.studies.conditions.coordinates import CurveCoordinates
from sma_bayes.studies.conditions.scatter import ScatterDensity, Summary
from sma_bayes.studies.conditions.schema import StatedCorrection

Places = NDArray[np.intp]
POINTS_PER_DRAW: Final = 6
"""Points at which the likelihood of each condition is evaluated for each draw of the population."""
WIDENING: Final = 1.15
"""By how much these points are drawn from wider than the Gaussian answer, so that they reach the tails."""


def corrected(
    density: ScatterDensity,
    coordinates: CurveCoordinates,
    records: Sequence[RecordDraws],
    coefficients: Floats,
    tau: Floats,
    rng: np.random.Generator,
) -> tuple[Floats, Places, StatedCorrection]:
    """Draw the coordinates of each condition, and weigh the draws by the likelihoods where these can be relied on.

    Parameters
    ----------
    density : ScatterDensity
    coordinates : CurveCoordinates
    records : sequence of RecordDraws
        One for each condition of the density.
    coefficients : ndarray, shape (W, Q, P)
        Level and slopes, drawn by the Gaussian answer.
    tau : ndarray, shape (W, P)
        Scatters, likewise.
    rng : Generator

    Returns
    -------
    phi : ndarray, shape (C, W, P)
        Coordinates of each condition.
    kept : ndarray of int, shape (W,)
        Which draws to keep, some of them several times.
    correction : StatedCorrection
    """
    mean = np.einsum("cq,sqp->csp", density.matrix, coefficients)
    everything, count = np.arange(len(tau)), float(len(tau))
    gaussian = np.stack([density.condition(c, mean[c], tau, rng, 1)[0][:, 0] for c in range(len(records))])
    calibrated = [r.key for r in records if r.record.calibration]
    if calibrated:
        why = f"errors of a calibration are in the draws of {', '.join(calibrated)}, not in the likelihood"
        return gaussian, everything, _correction(np.nan, {}, count, why)
    log_weight, k_of, phi = np.zeros(len(tau)), {}, []
    for place, record in enumerate(records):
        own, ratio = density.condition(place, mean[place], tau, rng, POINTS_PER_DRAW, WIDENING)
        points = own.reshape(-1, own.shape[-1])
        ratio = ratio + log_ratio(density.summaries[place], coordinates, record, points, rng).reshape(
            ratio.shape
        )
        k_of[record.condition.id] = float(smoothed_weights(ratio.reshape(-1, 1))[1][0])
        log_weight += logsumexp(ratio, axis=1)
        chosen = np.argmax(ratio + rng.gumbel(size=ratio.shape), axis=1)  # a draw in proportion to exp(ratio)
        phi.append(own[everything, chosen])
    smooth, k = smoothed_weights(log_weight[:, None])
    bad = [name for name, value in k_of.items() if value > MAX_RELIABLE_K]
    if bad or k[0] > MAX_RELIABLE_K:
        why = f"the weights can't be relied on: Pareto k of {', '.join(bad) or 'all together'} above {MAX_RELIABLE_K}"
        return gaussian, everything, _correction(float(k[0]), k_of, count, why)
    effective = float(np.exp(-logsumexp(2.0 * smooth[:, 0])))
    kept = resampled(smooth[:, 0], len(tau), rng)
    return np.stack(phi), kept, _correction(float(k[0]), k_of, effective)


def _correction(k: float, k_of: Mapping[str, float], effective: float, why_not: str = "") -> StatedCorrection:
    return StatedCorrection(
        applied=not why_not,
        k=k,
        k_of=dict[str, float | None](k_of.items()),
        effective=effective,
        why_not=why_not,
    )


def log_ratio(
    summary: Summary,
    coordinates: CurveCoordinates,
    record: RecordDraws,
    phi: Floats,
    rng: np.random.Generator,
) -> Floats:
    """Log of the likelihood of a record over its Gaussian form, up to a constant.

    Parameters
    ----------
    summary : Summary
        The Gaussian form.
    coordinates : CurveCoordinates
    record : RecordDraws
    phi : ndarray, shape (W, P)
        Where.
    rng : Generator
        For the noise parameters, which are drawn once at each point; the exponential of the result estimates the ratio
        with the noise integrated out, without bias.

    Returns
    -------
    ndarray, shape (W,)
        Minus infinity where the likelihood is zero.
    """
    posterior, layout = record.posterior, record.posterior.layout[0]
    space = posterior.space
    z = space.unconstrain(record.theta)
    noise = np.flatnonzero(space.free_index >= len(layout.model))
    nu, log_q = _given_curve(coordinates.to_coordinates(record.curve_theta), z[:, noise], phi, rng)
    theta = np.empty((len(phi), len(space.parameters)))
    theta[:, layout.model] = coordinates.to_parameters(phi)
    log_p = np.zeros(len(phi))
    for at, values in zip(noise.tolist(), nu.T, strict=True):
        prior = space.free[at].prior
        physical = prior.transform.constrain(values)
        theta[:, space.free_index[at]] = physical
        log_p += prior.log_density(physical) + prior.transform.log_jacobian(values)
    for i, parameter in enumerate(space.parameters):
        if parameter.fixed is not None:
            theta[:, i] = parameter.fixed
    gaussian = phi @ summary.pull - 0.5 * np.einsum("wi,ij,wj->w", phi, summary.precision, phi)
    value = posterior.log_likelihood(theta) + log_p - log_q - gaussian
    return np.where(np.isnan(value), -np.inf, value)


def _given_curve(phi: Floats, nu: Floats, at: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Draw noise coordinates given those of the curve, by linear regression on posterior draws; and their log density.

    Parameters
    ----------
    phi, nu : ndarray, shape (S, P), (S, k)
        Posterior draws.
    at : ndarray, shape (W, P)
        Given coordinates of the curve.
    rng : Generator
    """
    count = nu.shape[1]
    if count == 0:
        return np.empty((len(at), 0)), np.zeros(len(at))
    centre, spread = phi.mean(axis=0), phi.std(axis=0)
    design = np.column_stack([np.ones(len(phi)), (phi - centre) / spread])
    slopes, *_ = np.linalg.lstsq(design, nu, rcond=None)
    left = nu - design @ slopes
    root = WIDENING * np.linalg.cholesky(np.atleast_2d(np.cov(left.T)))
    far = np.clip(
        (at - centre) / spread, -4.0, 4.0
    )  # a line is not meant for what the record itself rules out
    mean = np.column_stack([np.ones(len(at)), far]) @ slopes
    e = rng.standard_normal((len(at), count))
    log_q = -0.5 * np.sum(e**2, axis=1) - float(np.sum(np.log(np.diag(root))))
    return mean + e @ root.T, log_q
