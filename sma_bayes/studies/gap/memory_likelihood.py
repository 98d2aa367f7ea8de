"""How long noise remembers, by restricted likelihood: that of residuals less what given columns describe of them.

Ordinary likelihood would take the freedom that columns use up for less noise and a shorter memory (H. D. Patterson and
R. Thompson, Biometrika 58 (1971) 545-554).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.special import logsumexp

from sma_bayes.arrays import Floats
from sma_bayes.noise.ar1 import memory_innovations, memory_log_scale
from sma_bayes.studies.gap.noise import CORRELATION_GRID, BlockNoise, ChannelBlock

LEAST_RELATIVE_LIKELIHOOD = 1e-3
"""A memory that is less likely than the likeliest one by more than this factor is left out of account."""
CHANGE_SD_GRID = np.geomspace(0.03, 1000.0, 13)
"""Sizes of changes of the curve that are tried, in standard deviations of the noise."""
CURVE_CHANGE_P = 1e-6
"""The same for these, which are many; where they are weighed by their evidence, its inverse is the Bayes factor."""
RELATIVE_PRECISION = 1e-9
"""Precision by which coefficients of which nothing is known are held, over the mean information on them."""


def likeliest_noise(
    residual: Floats,
    block: ChannelBlock,
    smooth: Floats,
    scale: Floats | float = 1.0,
    random: Floats | None = None,
    noisy: NDArray[np.bool_] | slice = slice(None),
) -> tuple[BlockNoise, Floats]:
    """Noise of greatest restricted likelihood for given scales, and the innovations without their scales.

    Parameters
    ----------
    residual : ndarray, shape (n,)
    block : ChannelBlock
    smooth : ndarray, shape (n, k)
    scale : ndarray, shape (n,), or float
    random : ndarray, shape (n, j), optional
        Columns with normal coefficients of the standard deviation of the noise.
    noisy : ndarray of bool, shape (n,), optional
        Innovations that have noise; by these its size is told.
    """
    held = np.zeros(smooth.shape[1])
    if random is not None:
        smooth = np.concatenate([smooth, random], axis=1)
        held = np.concatenate([held, np.ones(random.shape[1])])
    width = np.broadcast_to(scale, residual.shape)[:, None]
    products = _products(np.column_stack([smooth, residual]), block, width)
    memories, possible = _memories(block)
    log_scale = np.array([memory_log_scale(m).sum() for m in memories])
    value, sd = _restricted(products, log_scale, residual.size, held)
    likeliest = int(np.argmax(value))
    shorter = np.array([m.max() for m in memories]) <= memories[likeliest].max()
    probability = np.exp(value - value.max())
    probability = np.where(
        (possible | shorter) & (probability >= LEAST_RELATIVE_LIKELIHOOD), probability, 0.0
    )
    probability = probability / probability.sum()
    best = BlockNoise(float(sd[likeliest]), memories[likeliest], scale)
    w, columns = best.whiten(residual), best.whiten(smooth.T).T
    left = w - columns @ np.linalg.solve(*_normal_equations(products[likeliest], held))
    whole = float(np.mean(left**2))
    size = math.sqrt(float(np.mean(left[noisy] ** 2)) / whole) if whole else 1.0
    others = tuple(
        (float(probability[i]), BlockNoise(size * float(sd[i]), memories[i], scale))
        for i in np.flatnonzero(probability).tolist()
    )
    return replace(best, sd=size * best.sd, others=others), np.asarray(left / size * scale)


def noise_as_it_is(residual: Floats, block: ChannelBlock) -> BlockNoise:
    """AR(1) noise of greatest likelihood of a series with nothing taken out: what a model misses is in it.

    Parameters
    ----------
    residual : ndarray, shape (n,)
    block : ChannelBlock
    """
    memories, _ = _memories(block)
    sds = [float(np.sqrt(np.mean(memory_innovations(residual, m) ** 2))) for m in memories]
    value = [
        -residual.size * math.log(max(sd, 1e-300)) - memory_log_scale(m).sum()
        for sd, m in zip(sds, memories, strict=True)
    ]
    likeliest = int(np.argmax(value))
    return BlockNoise(sds[likeliest], memories[likeliest])


def beyond_noise(
    residual: Floats,
    block: ChannelBlock,
    smooth: Floats,
    sets: Sequence[Floats],
    log_prior: Floats | None = None,
) -> Floats | None:
    """The likeliest of some sets of columns at its likeliest size, if they describe more than noise does beyond doubt.

    Coefficients are normal, of a common size; sets, sizes and memories are averaged over. That average is compared with
    the likeliest memory of noise alone, whatever it is. So noise that is AR(1) is taken for columns with a probability
    of `CURVE_CHANGE_P` at most, however many columns there are and however little is known of its memory (by
    Markov's inequality, as the expected Bayes factor against the truth is 1).

    Parameters
    ----------
    residual : ndarray, shape (n,)
    block : ChannelBlock
    smooth : ndarray, shape (n, k)
    sets : sequence of ndarray, shape (n, j)
    log_prior : ndarray, shape (sets,), optional
        Logarithms of their probabilities a priori; all the same by default.

    Returns
    -------
    ndarray, shape (n, j), or None
        For coefficients of the size of the noise.
    """
    if not sets:
        return None
    memories, _ = _memories(block)
    log_scale = np.array([memory_log_scale(m).sum() for m in memories])
    alone = _restricted(_products(np.column_stack([smooth, residual]), block), log_scale, residual.size)[0]
    found = np.stack([_with_random(residual, block, smooth, columns, log_scale) for columns in sets])
    prior = np.full(len(sets), -np.log(len(sets))) if log_prior is None else log_prior
    found = found + prior[:, None, None]
    average = logsumexp(found) - np.log(found[0].size)
    if average < alone.max() - math.log(CURVE_CHANGE_P):
        return None
    which, size = divmod(int(np.argmax(logsumexp(found, axis=2))), CHANGE_SD_GRID.size)
    return np.asarray(sets[which] * CHANGE_SD_GRID[size])


def _with_random(
    residual: Floats, block: ChannelBlock, smooth: Floats, random: Floats, log_scale: Floats
) -> Floats:
    """Restricted log likelihoods beside columns with normal coefficients, by `CHANGE_SD_GRID` and memory, (S, m)."""
    k, j = smooth.shape[1], random.shape[1]
    products = _products(np.column_stack([smooth, random, residual]), block)
    fixed, across, own = products[:, :k, :k].copy(), products[:, :k, k:], products[:, k:, k:]
    place = np.arange(k)
    fixed[:, place, place] += RELATIVE_PRECISION * np.trace(fixed, axis1=1, axis2=2)[:, None] / k
    left = own - np.swapaxes(across, 1, 2) @ np.linalg.solve(fixed, across)
    information, axes = np.linalg.eigh(left[:, :j, :j])
    information = np.maximum(information, 0.0)
    pull = np.einsum("mij,mi->mj", axes, left[:, :j, j]) ** 2
    precision = CHANGE_SD_GRID[:, None, None] ** -2.0
    squares = left[:, j, j] - np.sum(pull / (information + precision), axis=2)
    free = max(residual.size - k, 1)
    volume = np.linalg.slogdet(fixed)[1] + np.log1p(information / precision).sum(axis=2)
    variance = np.maximum(squares, 1e-300) / free
    return np.asarray(-0.5 * free * np.log(variance) - log_scale - 0.5 * volume)


def by_chance(residual: Floats, noise: BlockNoise, fewer: Floats, columns: Floats) -> float:
    """Probability that noise puts as much into columns beyond the first of them as was found there."""
    described = _squares(residual, noise, fewer) - _squares(residual, noise, columns)
    return float(stats.chi2.sf(described, columns.shape[1] - fewer.shape[1]))


def _squares(residual: Floats, noise: BlockNoise, columns: Floats) -> float:
    """Sum of squared innovations that columns leave."""
    w = noise.whiten(np.column_stack([columns, residual]).T)
    products = w @ w.T
    gram, pull = _normal_equations(products)
    return float(products[-1, -1] - pull @ np.linalg.solve(gram, pull))


def _memories(block: ChannelBlock) -> tuple[list[Floats], NDArray[np.bool_]]:
    """Memories of a block that are tried, each (n,), and which of them chance may have: by sample, and in time."""
    follows = ~block.first
    memories = [np.where(follows, phi, 0.0) for phi in CORRELATION_GRID]
    possible = block.possible
    if block.uneven:
        memories += [
            np.where(follows, phi ** np.maximum(block.dt, 1e-3), 0.0)
            for phi in CORRELATION_GRID[CORRELATION_GRID > 0.0]
        ]
        possible = np.concatenate([possible, possible[CORRELATION_GRID > 0.0]])
    return memories, possible


def _restricted(
    products: Floats, log_scale: Floats, n: int, held: Floats | None = None
) -> tuple[Floats, Floats]:
    """Restricted log likelihoods of memories, up to a constant, with the standard deviations that go with them.

    Parameters
    ----------
    products : ndarray, shape (m, k + 1, k + 1)
        Of the innovations of the columns and, last, of the residuals.
    log_scale : ndarray, shape (m,)
        Sum over samples of the logarithm of the scale of an innovation at unit standard deviation.
    n : int
        Samples.
    held : ndarray, shape (k,), optional
        Precisions of the coefficients, over that of the innovations; 0, of what nothing is known of, if not given.
    """
    held = np.zeros(products.shape[-1] - 1) if held is None else held
    gram, pull = _normal_equations(products, held)
    free = max(n - int(np.sum(held == 0.0)), 1)
    explained = np.sum(pull * np.linalg.solve(gram, pull[..., None])[..., 0], axis=1)
    sd = np.sqrt(np.maximum(products[:, -1, -1] - explained, 1e-300) / free)
    return -free * np.log(sd) - log_scale - 0.5 * np.linalg.slogdet(gram)[1], sd


def _products(series: Floats, block: ChannelBlock, width: Floats | None = None) -> Floats:
    """Products of the innovations of series (n, k) under each memory that is tried, shape (m, k, k).

    An innovation ``x[i] - phi x[i-1]`` is ``(x[i] - x[i-1]) + (1 - phi) x[i-1]``, so three matrices of products serve
    all memories by sample, without loss of digits where these are near 1.

    Parameters
    ----------
    series : ndarray, shape (n, k)
    block : ChannelBlock
    width : ndarray, shape (n, 1), optional
        Scales of the innovations; 1 if not given.
    """
    scales = np.ones((len(series), 1)) if width is None else width
    later = np.flatnonzero(~block.first)
    first = series[block.first] / scales[block.first]
    before = series[later - 1] / scales[later]
    step = series[later] / scales[later] - before
    crossed = step.T @ before
    forgotten = (1.0 - CORRELATION_GRID)[:, None, None]
    squares = step.T @ step + forgotten * (crossed + crossed.T) + forgotten**2 * (before.T @ before)
    products = np.asarray(first.T @ first + squares / (1.0 - CORRELATION_GRID**2)[:, None, None])
    in_time = _memories(block)[0][CORRELATION_GRID.size :]
    if not in_time:
        return products
    innovations = [memory_innovations(series.T, m, scales[:, 0]) for m in in_time]
    return np.concatenate([products, [w @ w.T for w in innovations]])


def _normal_equations(products: Floats, held: Floats | float = 0.0) -> tuple[Floats, Floats]:
    """Of columns (k) and, last, a series: their products among each other, hardly held, and with the series.

    Parameters
    ----------
    products : ndarray, shape (..., k + 1, k + 1)
    held : ndarray, shape (k,), or float
        Precisions of the coefficients, over that of the innovations.
    """
    gram = products[..., :-1, :-1].copy()
    place = np.arange(gram.shape[-1])
    gram[..., place, place] += (
        RELATIVE_PRECISION * np.trace(gram, axis1=-2, axis2=-1)[..., None] / place.size + held
    )
    return gram, products[..., :-1, -1]
