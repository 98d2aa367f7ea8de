"""Convergence: rank-normalised split R-hat, effective sample sizes, and errors of quantiles and standard deviations.

Formulae of A. Vehtari, A. Gelman, D. Simpson, B. Carpenter, P.-C. Bürkner, "Rank-normalization, folding, and
localization: an improved R-hat for assessing convergence of MCMC", Bayesian Analysis 16 (2021) 667,
doi 10.1214/20-BA1221. They are those of arviz-stats to rounding, which tests hold, but for the error of a standard
deviation of a heavy tail, and for all parameters at once: a short record takes longer to import arviz-stats, with
xarray and pandas, than to be sampled. The normal scores of the draws, which most of the formulae need, are computed
once.

A chain here is one *independent ensemble* with its walkers joined end to end. Walkers of one ensemble are not
independent of each other, so they are never counted as chains.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtri

from sma_bayes.arrays import Floats, Ints
from sma_bayes.sampling.pareto import MAX_RELIABLE_K, tail_exponent

TAIL_QUANTILES = (0.05, 0.95)
"""Quantiles whose effective sample sizes are those of the tails."""
PUBLISHED_QUANTILES = (0.025, 0.975)
"""Quantiles that are published as the ends of intervals."""
NORMAL_ERROR = 3.5
"""Standard error [sd] of these, of a normal distribution, times the root of the number of draws: 2.7, and a third more
for the greatest of some twenty estimates."""
NORMAL_SD_ERROR = math.sqrt(0.5)
"""Relative standard error of the standard deviation of a normal distribution, times the root of the number of draws."""
LEAST_SERIES_STEPS = 100
"""Steps from which the means over walkers are a series that an effective sample size can be taken of."""


@dataclass(frozen=True, slots=True)
class Target:
    """What draws must reach before they are called converged.

    Attributes
    ----------
    rhat : float
        Greatest R-hat of any parameter.
    ess : float
        Least bulk and tail effective sample size of any parameter.
    quantile_error : float
        Greatest Monte Carlo standard error of the 2.5 and 97.5 % quantiles of any parameter [posterior sd].
    sd_error : float
        Greatest relative Monte Carlo standard error of the standard deviation of any parameter.
    """

    rhat: float = 1.01
    ess: float = 1000.0
    quantile_error: float = math.inf
    sd_error: float = math.inf

    @property
    def draws(self) -> float:
        """Effective draws of a normal distribution that reach the target."""
        return max(
            self.ess, (NORMAL_ERROR / self.quantile_error) ** 2, (NORMAL_SD_ERROR / self.sd_error) ** 2
        )


PUBLISHED_TARGET = Target(quantile_error=0.06, sd_error=0.023)
"""Target of a posterior whose standard deviations and 2.5 and 97.5 % quantiles are published. The greatest of some
twenty estimated errors of quantiles is a third above the true ones, so that 0.2 sd are four standard errors and more:
met by chance in one of 300 records. Three errors of a standard deviation are 7 % of it."""


@dataclass(frozen=True, slots=True, eq=False)
class Convergence:
    """Diagnostics of draws.

    Attributes
    ----------
    rhat, ess_bulk, ess_tail : ndarray, shape (D,)
        R-hat is the greater of the rank-normalised and the folded one.
    converged : bool
        Whether every parameter reached the target.
    quantile_error : ndarray, shape (D,)
        Greater of the Monte Carlo standard errors of the 2.5 and 97.5 % quantiles [sd]: the binomial standard error of
        their levels, with `ess_tail` draws, times the mean slope of the quantiles from half to one and a half of them.
    sd_error : ndarray, shape (D,)
        Relative Monte Carlo standard error of the standard deviation, from the effective sample size of squared
        deviations from the mean (A. Vehtari and others 2021): ``0.5 sqrt((kurtosis - 1) / ess)``. Where the squares
        have a Pareto exponent k over 0.5, hence no variance, their mean converges as ``ess ** (k - 1)`` (A. Vehtari,
        D. Simpson, A. Gelman, Y. Yao, J. Gabry, Journal of Machine Learning Research 25 (2024) 72), and the error is
        ``ess ** (k - 0.5)`` times that, with k of `MAX_RELIABLE_K` at most.
    """

    rhat: Floats
    ess_bulk: Floats
    ess_tail: Floats
    converged: bool
    quantile_error: Floats
    sd_error: Floats

    def reaches(self, target: Target) -> bool:
        """Whether every parameter reaches a target."""
        with np.errstate(invalid="ignore"):
            return bool(
                np.all(self.rhat <= target.rhat)
                and np.all(np.minimum(self.ess_bulk, self.ess_tail) >= target.ess)
                and np.all(self.quantile_error <= target.quantile_error)
                and np.all(self.sd_error <= target.sd_error)
            )


def assess(draws: Floats, target: Target) -> Convergence:
    """Diagnose draws of independent ensembles.

    Parameters
    ----------
    draws : ndarray, shape (G, S, W, D)
        Ensembles, steps, walkers, parameters.
    target : Target

    Returns
    -------
    Convergence
        R-hat is taken both over halves in walkers and over halves in steps; the worse counts, so that neither
        a stuck walker nor a drift of the whole ensemble goes unseen. From `LEAST_SERIES_STEPS` steps on, effective
        sample sizes are also estimated from the means over walkers, which sees walkers that move together; the lesser
        counts.
    """
    groups, steps, walkers, d = draws.shape
    values = np.moveaxis(draws, -1, 0).reshape(draws.shape[-1], -1)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        scores, folded = _scores(values), _scores(np.abs(values - np.median(values, axis=1, keepdims=True)))
        both = np.stack([scores, folded]).reshape(2, d, groups, steps, walkers)
        by_step, by_walker = (x.reshape(2, d, groups, -1) for x in (both, both.swapaxes(3, 4)))
        rhat = np.maximum(_rhat(by_step), _rhat(by_walker)).max(axis=0)
        squares = (values - values.mean(axis=1, keepdims=True)) ** 2
        series = np.concatenate([scores[None], _in_tails(values), squares[None]])
        series = series.reshape(4, d, groups, steps, walkers)
        bulk, *tails, of_squares = _ess(series.swapaxes(3, 4).reshape(4, d, groups, -1))
        tail = np.minimum(*tails)
        if steps >= LEAST_SERIES_STEPS:
            means = series.mean(axis=4)
            gain = series.var(axis=(2, 3, 4)) / means.var(axis=(2, 3))
            of_bulk, *of_tails, of_means = _ess(means) * gain
            bulk, tail = np.minimum(bulk, of_bulk), np.minimum(tail, np.minimum(*of_tails))
            of_squares = np.minimum(of_squares, of_means)
        sd_error = 0.5 * squares.std(axis=1) / squares.mean(axis=1) * of_squares ** -_rate(squares)
    found = Convergence(rhat, bulk, tail, False, _quantile_error(values, tail), sd_error)
    return replace(found, converged=bool(np.all(np.isfinite(draws))) and found.reaches(target))


def _rate(squares: Floats) -> Floats:
    """Power of the number of draws with which errors of the means of squares (D, N) fall, shape (D,).

    A half; ``1 - k`` where the tail of the squares has a Pareto exponent k over a half, hence no variance.
    """
    return 1.0 - np.clip(tail_exponent(squares), 0.5, MAX_RELIABLE_K)


def _scores(values: Floats) -> Floats:
    """Normal scores of the ranks of each parameter's values (D, N); NaN where one is."""
    count = values.shape[1]
    of_rank = ndtri(
        (np.arange(0.0, count + 0.25, 0.5) + 0.625) / (count + 0.25)
    )  # ranks that are equal are shared
    scores = of_rank[_doubled_ranks(values)]
    return np.where(np.isnan(values).any(axis=1, keepdims=True), np.nan, scores)


def _doubled_ranks(values: Floats) -> Ints:
    """Twice the ranks, from nought, of each row's values (D, N); those that are equal have their mean.

    As `scipy.stats.rankdata` has them, which sorts such that equal values keep their order, in six times the time.
    """
    order = np.argsort(values, axis=1)
    ordered = np.take_along_axis(values, order, axis=1)
    at = np.arange(values.shape[1])
    differs = ordered[:, 1:] != ordered[:, :-1]
    edge = np.ones((len(values), 1), dtype=bool)
    first = np.maximum.accumulate(np.where(np.hstack([edge, differs]), at, 0), axis=1)
    last = np.where(np.hstack([differs, edge]), at, at[-1])
    last = np.minimum.accumulate(last[:, ::-1], axis=1)[:, ::-1]
    ranks = np.empty_like(order)
    np.put_along_axis(ranks, order, first + last, axis=1)
    return ranks


def _in_tails(values: Floats) -> Floats:
    """Whether values (D, N) are at most each of the `TAIL_QUANTILES`, shape (2, D, N); NaN where a value is."""
    below = values <= np.quantile(values, TAIL_QUANTILES, axis=1)[..., None]
    return np.where(np.any(np.isnan(values), axis=1, keepdims=True), np.nan, below)


def _halves(chains: Floats) -> Floats:
    """First and last halves of chains (..., C, N), without the middle of an odd number, shape (..., 2 C, N // 2)."""
    half = chains.shape[-1] // 2
    return np.concatenate([chains[..., :half], chains[..., -half:]], axis=-2)


def _rhat(chains: Floats) -> Floats:
    """Split R-hat of chains (..., C, N), shape (...)."""
    halves = _halves(chains)
    n = halves.shape[-1]
    between = n * halves.mean(axis=-1).var(axis=-1, ddof=1)
    within = halves.var(axis=-1, ddof=1).mean(axis=-1)
    return np.asarray(np.sqrt((between / within + n - 1) / n))


def _ess(chains: Floats) -> Floats:
    """Effective sample size of the mean of chains (..., C, N), shape (...).

    Autocorrelations over all halves of the chains are added up pair by pair for as long as pairs are positive, none of
    them counting for more than those before it (C. J. Geyer, Statistical Science 7 (1992) 473).
    """
    halves = _halves(chains)
    count, n = halves.shape[-2:]
    mean = halves.mean(axis=-1, keepdims=True)
    spectrum = np.fft.rfft(halves - mean, n=2 * n)
    covariance = np.fft.irfft((spectrum.real**2 + spectrum.imag**2).mean(axis=-2))[..., :n] / n
    within = covariance[..., :1] * n / (n - 1.0)
    variance = within * (n - 1.0) / n + mean[..., 0].var(axis=-1, ddof=1, keepdims=True)
    rho = 1.0 - (within - covariance) / variance
    rho[..., 0] = 1.0
    pairs = rho[..., : 2 * (n // 2)].reshape(*rho.shape[:-1], -1, 2).sum(axis=-1)[..., : max((n - 1) // 2, 1)]
    ends = pairs <= 0.0
    last = np.where(ends.any(axis=-1), ends.argmax(axis=-1), pairs.shape[-1] - 1)[..., None]
    added = np.cumsum(np.minimum.accumulate(pairs, axis=-1), axis=-1)
    before = np.where(last > 0, np.take_along_axis(added, np.maximum(last - 1, 0), axis=-1), 0.0)
    even = np.take_along_axis(rho, 2 * last, axis=-1)
    even = np.where(np.take_along_axis(pairs, last, axis=-1) < 0.0, np.maximum(even, 0.0), even)
    times = np.maximum(2.0 * before + even - 1.0, 1.0 / np.log10(count * n))[..., 0]
    flat = np.ptp(halves, axis=(-2, -1)) < np.finfo(float).resolution
    return np.asarray(np.where(flat, count * n, count * n / times))


def _quantile_error(values: Floats, ess: Floats) -> Floats:
    """Standard error [sd] of the outer quantiles of values (D, N) with so many effective draws (D,)."""
    n = values.shape[1]
    level = min(PUBLISHED_QUANTILES)
    inner, outer = 1.5 * level, 0.5 * level
    at = np.rint(np.array([outer, inner, 1.0 - inner, 1.0 - outer]) * (n - 1)).astype(np.int64)
    ends = np.partition(values, at, axis=1)[:, at]
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        slope = np.maximum(ends[:, 1] - ends[:, 0], ends[:, 3] - ends[:, 2]) / level
        return np.asarray(slope * np.sqrt(level * (1.0 - level) / ess) / values.std(axis=1))
