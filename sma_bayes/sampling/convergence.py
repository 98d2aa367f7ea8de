"""Convergence: rank-normalised split R-hat, and bulk and tail effective sample size.

Formulae of A. Vehtari, A. Gelman, D. Simpson, B. Carpenter, P.-C. Bürkner, "Rank-normalization, folding, and
localization: an improved R-hat for assessing convergence of MCMC", Bayesian Analysis 16 (2021) 667,
doi 10.1214/20-BA1221; arviz computes the same, one parameter at a time, and tests compare.

A chain here is one *independent ensemble* with its walkers joined end to end. Walkers of one ensemble are not
independent of each other, so they are never counted as chains.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.special import ndtri

from sma_bayes.quantities import Floats

FEW, SOME = 16, 32
"""Lags of an autocovariance to begin with, and to go on to by doubling them; up to there they are plain sums."""
OUTER = (0.025, 0.975)
"""Quantiles that are published as the ends of intervals."""
NORMAL_ERROR = 3.5
"""Standard error [sd] of these, of a normal distribution, times the root of the number of draws: 2.7, and a third more
for the greatest of some twenty estimates."""
LONG = 100
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
    """

    rhat: float = 1.01
    ess: float = 1000.0
    quantile_error: float = math.inf

    @property
    def draws(self) -> float:
        """Effective draws of a normal distribution that reach the target."""
        return max(self.ess, (NORMAL_ERROR / self.quantile_error) ** 2)


PUBLISHED = Target(quantile_error=0.06)
"""Target of a posterior whose 2.5 and 97.5 % quantiles are published. The greatest of some twenty estimated errors is a
third above the true ones, so that 0.2 sd are four standard errors and more: met by chance in one of 300 records."""


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
    """

    rhat: Floats
    ess_bulk: Floats
    ess_tail: Floats
    converged: bool
    quantile_error: Floats


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
        a stuck walker nor a drift of the whole ensemble goes unseen. From `LONG` steps on, effective sample sizes
        are also estimated from the means over walkers, which sees walkers that move together; the lesser counts.
    """
    values = _parameters_first(draws)
    # ranks do not depend on the order of the draws, and sorting is most of the work: once serves all orders
    scores, folded, tails = _ranked(values)
    both = np.concatenate([scores, folded])
    by_walker = _by_walker(both)
    rhat = np.maximum(_rhat(_split(by_walker)), _rhat(_split(_by_step(both)))).reshape(2, -1).max(axis=0)
    in_tails = _by_walker(values) <= tails[:, :, None, None]
    told = np.concatenate([by_walker[: len(values)], *in_tails])
    ess = _ess(_split(told))
    if draws.shape[1] >= LONG:
        in_tails = values <= tails[:, :, None, None, None]
        ess = np.minimum(ess, _ess_of_ensembles(np.concatenate([scores, *in_tails])))
    bulk, low, high = np.split(ess, 3)
    tail = np.minimum(low, high)
    error = _quantile_error(values.reshape(len(values), -1), tail)
    with np.errstate(invalid="ignore"):
        finite = bool(np.all(np.isfinite(draws)))
        reached = np.all(rhat <= target.rhat) and np.all(np.minimum(bulk, tail) >= target.ess)
        reached &= np.all(error <= target.quantile_error)
    return Convergence(rhat, bulk, tail, finite and bool(reached), error)


def rank_rhat(chains: Floats) -> Floats:
    """Rank-normalised split R-hat, the greater of bulk and folded; `chains` (C, N, D) gives (D,)."""
    halves = _split(_parameters_first(chains))
    scores, folded, _ = _ranked(halves)
    return np.maximum(_rhat(scores), _rhat(folded))


def ess_bulk(chains: Floats) -> Floats:
    """Effective sample size of the rank-normalised draws; `chains` (C, N, D) gives (D,)."""
    return _ess(_ranked(_split(_parameters_first(chains)))[0])


def ess_tail(chains: Floats) -> Floats:
    """Lesser of the effective sample sizes of the 5 % and 95 % quantiles; `chains` (C, N, D) gives (D,)."""
    values = _parameters_first(chains)
    halves, tails = _split(values), _ranked(values)[2]
    return np.minimum(*(_ess((halves <= q[:, None, None]).astype(float)) for q in tails))


# What follows has the parameters first, so that the draws of each lie together in memory.
def _parameters_first(draws: Floats) -> Floats:
    return np.ascontiguousarray(np.moveaxis(draws, -1, 0))


def _by_walker(values: Floats) -> Floats:
    """Walkers of each ensemble end to end: (D, G, S, W) to (D, G, W S)."""
    return np.swapaxes(values, 2, 3).reshape(*values.shape[:2], -1)


def _by_step(values: Floats) -> Floats:
    """Steps of each ensemble one after the other: (D, G, S, W) to (D, G, S W)."""
    return values.reshape(*values.shape[:2], -1)


def _split(chains: Floats) -> Floats:
    """Halves of chains (D, C, N) as chains of their own: (D, 2 C, N // 2), without the middle of an odd number."""
    d, c, n = chains.shape
    if n % 2 == 0:
        return chains.reshape(d, 2 * c, -1)
    half = n // 2
    return np.concatenate([chains[:, :, :half], chains[:, :, half + 1 :]], axis=1)


def _ess_of_ensembles(values: Floats) -> Floats:
    """Effective sample size of `values` (D, G, S, W) from the means over the walkers of each ensemble."""
    means = values.mean(axis=3)
    with np.errstate(invalid="ignore", divide="ignore"):
        gain = values.var(axis=(1, 2, 3)) / means.var(axis=(1, 2))
    return np.asarray(_ess(_split(means)) * gain)


def _ranked(values: Floats) -> tuple[Floats, Floats, Floats]:
    """Normal scores, those of the distances from the median, and the 5 % and 95 % quantiles, by one sort.

    Parameters
    ----------
    values : ndarray, shape (D, ...)

    Returns
    -------
    scores, folded : ndarray, shape (D, ...)
        Normal quantiles of the ranks over all draws (Blom's formula); ties share their mean rank.
    tails : ndarray, shape (2, D)
    """
    flat = values.reshape(len(values), -1)
    scores, folded = np.empty_like(flat), np.empty_like(flat)
    size = flat.shape[1]
    quantile = _quantiles_of_ranks(size)
    middle = (size - 1) // 2, size // 2
    below, part = np.divmod(np.multiply((0.05, 0.95), size - 1), 1.0)
    at = below.astype(np.int64)
    above = np.minimum(at + 1, size - 1)
    tails = np.empty((2, len(flat)))
    for k, column in enumerate(flat):  # one by one they stay in the processor's cache
        order = column.argsort()
        in_order = column[order]
        scores[k, order] = _scores_in_order(in_order, quantile)
        distance = np.abs(in_order - 0.5 * (in_order[middle[0]] + in_order[middle[1]]))
        outwards = distance.argsort(kind="stable")  # two runs, one falling and one rising: soon sorted
        folded[k, order[outwards]] = _scores_in_order(distance[outwards], quantile)
        tails[:, k] = in_order[at] + part * (in_order[above] - in_order[at])
    return scores.reshape(values.shape), folded.reshape(values.shape), tails


def _quantile_error(values: Floats, ess: Floats) -> Floats:
    """Standard error [sd] of the outer quantiles of values (D, N) with so many effective draws (D,)."""
    n = values.shape[1]
    level = min(OUTER)
    inner, outer = 1.5 * level, 0.5 * level
    at = np.rint(np.array([outer, inner, 1.0 - inner, 1.0 - outer]) * (n - 1)).astype(np.int64)
    ends = np.partition(values, at, axis=1)[:, at]
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        slope = np.maximum(ends[:, 1] - ends[:, 0], ends[:, 3] - ends[:, 2]) / level
        return np.asarray(slope * np.sqrt(level * (1.0 - level) / ess) / values.std(axis=1))


def _quantiles_of_ranks(size: int) -> Floats:
    """Normal quantiles of the ranks 1, 1.5, 2 ... `size`."""
    return np.asarray(ndtri((0.5 * np.arange(2.0, 2.0 * size + 1.0) - 0.375) / (size + 0.25)))


def _scores_in_order(in_order: Floats, quantile: Floats) -> Floats:
    """Normal scores of sorted values."""
    new = np.empty(in_order.size + 1, dtype=bool)
    new[0] = new[-1] = True
    np.not_equal(in_order[1:], in_order[:-1], out=new[1:-1])
    starts = new.nonzero()[0]  # the last one is the end
    ties = starts[1:] - starts[:-1]
    return np.repeat(quantile[starts[1:] + starts[:-1] - 1], ties)


def _rhat(chains: Floats) -> Floats:
    n = chains.shape[2]
    means = chains.mean(axis=2)
    squares = (
        np.einsum("dcn,dcn->dc", chains, chains) / n
    )  # scores are about zero: nothing is lost by subtracting
    within = np.maximum(squares - means**2, 0.0).mean(axis=1) * (n / (n - 1.0))
    between = means.var(axis=1, ddof=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.sqrt((n - 1) / n + between / within))


def _ess(chains: Floats, lags: int = FEW) -> Floats:
    """Effective sample size of chains (D, C, N) by Geyer's initial monotone sequence.

    The sequence seldom goes beyond the first few lags. Where it does, it is begun anew with more of them.
    """
    d, c, n = chains.shape
    lags = min(lags, n)
    means = chains.mean(axis=2)
    autocovariance = _autocovariance(chains, means, lags)
    mean_variance = autocovariance[:, 0] * n / (n - 1.0)
    total = mean_variance * (n - 1.0) / n
    if c > 1:
        total = total + means.var(axis=1, ddof=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        rho = 1.0 - (mean_variance[:, None] - autocovariance) / total[:, None]
    rho[:, 0] = 1.0
    count = lags // 2
    pairs = rho[:, : 2 * count].reshape(d, count, 2).sum(axis=2)
    last = max((n - 3) // 2, 0)  # the end of the series is too noisy to use
    ends = pairs < 0
    ended = ends.any(axis=1)
    stop = np.where(ended, np.minimum(ends.argmax(axis=1), last), last)
    longest = min(int(stop.max(initial=0)), count)
    monotone = np.minimum.accumulate(pairs[:, :longest], axis=1)
    tau = -1.0 + 2.0 * np.where(np.arange(longest) < stop[:, None], monotone, 0.0).sum(axis=1)
    at = np.minimum(stop, count - 1)[:, None]
    first = np.take_along_axis(rho, 2 * at, axis=1)[:, 0]  # half of the pair that ended the sequence
    counted = (stop < count) & ((first > 0) | (np.take_along_axis(pairs, at, axis=1)[:, 0] >= 0))
    tau = np.where(counted, tau + first, tau)
    ess = np.where(total > 0, c * n / np.maximum(tau, 1.0 / np.log10(c * n)), np.nan)
    if lags < n and not ended.all():
        ess[~ended] = _ess(chains[~ended], 2 * lags if lags < SOME else n)
    return np.asarray(ess)


def _autocovariance(chains: Floats, means: Floats, lags: int) -> Floats:
    """Mean over chains of the autocovariance at the first lags: (D, C, N) about (D, C) gives (D, lags)."""
    d, c, n = chains.shape
    if lags <= SOME:
        # zeros keep the end of a chain from the beginning of the next, and fill up its last block
        apart = np.zeros((d, c, (math.ceil(n / lags) + 1) * lags))
        np.subtract(chains, means[:, :, None], out=apart[:, :, :n])
        blocks = apart.reshape(d, -1, lags)
        # in products of a block with itself and the next, element (i, i + k) is of lag k: in rows one longer, column k
        sums = np.empty((d, lags * (2 * lags + 1)))
        products = sums[:, : 2 * lags * lags].reshape(d, lags, 2 * lags)
        turned = np.swapaxes(blocks, 1, 2)
        np.matmul(turned, blocks, out=products[:, :, :lags])
        np.matmul(turned[:, :, :-1], blocks[:, 1:], out=products[:, :, lags:])
        return np.asarray(sums.reshape(d, lags, -1)[:, :, :lags].sum(axis=1) / (n * c))
    length = next_fast_len(2 * n, real=True)
    spectrum = rfft(chains - means[:, :, None], n=length)
    # only the mean over chains is used, and it may as well be taken before the transform back
    power = (spectrum.real**2 + spectrum.imag**2).mean(axis=1)
    return np.asarray(irfft(power, n=length)[:, :lags] / n)
