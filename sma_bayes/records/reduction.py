r"""Long records made short: averages of consecutive rows, by a rule that is stated and tested.

Within each sweep consecutive rows are averaged in blocks of ``m`` rows (the last ones of a sweep are made
equal: a sweep of ``n`` rows has ``ceil(n / m)`` blocks that differ by one row at most). ``m`` is the smallest
number with which the branch has no more samples than asked for. A block over which the temperature moves by
more than a stated share of the sweep is divided further. That limit has precedence, so that a branch of very
many sweeps keeps more samples than asked for; the finding says so.

Bias
    The mean of a curve f over a block of width d is not its value at the mean temperature: it is off by
    ``d**2 / 24 * f''`` to leading order. For a logistic curve of amplitude A and steepness a,
    ``max |f''| = a**2 A / (6 sqrt(3))``, so a block of share s of a sweep of width W biases by at most

    .. math:: \frac{(s W a)^2}{144 \sqrt 3} A,

    that is 0.3 % of A for s = 0.02 and W a = 44 (a transformation that takes a tenth of the sweep).

Correlation
    The average of m samples of white noise has variance / m, but residuals of records are not white. The mean
    of m rows of an AR(1) series with coefficient phi is an ARMA(1, 1) series with autoregressive coefficient
    ``phi**m`` and variance

    .. math:: \frac{\sigma^2}{m} \left[\frac{1 + \phi}{1 - \phi} - \frac{2 \phi (1 - \phi^m)}{m (1 -
    \phi)^2}\right],

    which stays near sigma**2 while ``m (1 - phi) << 1``. So nothing here divides a variance by m: an averaged
    sample is a sample, and scale and correlation of its noise are inferred from the averaged record itself.
    Blocks that were divided further are somewhat noisier than the rest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sma_bayes.arrays import Floats, Ints
from sma_bayes.records.segmentation import noise_sd

MAX_BLOCK_GROWTH = 8
"""Blocks grow to at most this many times the rows that an equal share would have."""


@dataclass(frozen=True, slots=True, eq=False)
class Blocks:
    """Consecutive rows that become one sample each.

    Attributes
    ----------
    first : ndarray of int, shape (k,)
        First row of each block.
    rows : int
        Number of rows in all.
    largest : int
        Rows of the largest block; 1 where nothing is averaged.
    """

    first: Ints
    rows: int
    largest: int

    @property
    def n(self) -> int:
        """Number of samples."""
        return int(self.first.size)


def blocks_of(temperature: Floats, segment: Floats, max_samples: int, block_span: float) -> Blocks:
    """Decide which consecutive rows are averaged.

    Parameters
    ----------
    temperature : ndarray, shape (n,)
        In order of acquisition within each sweep [unit of temperature].
    segment : ndarray, shape (n,)
        Number of the sweep; equal numbers are consecutive.
    max_samples : int
        Samples wanted at most.
    block_span : float
        Largest move of the temperature within a block over its range [1].

    Examples
    --------
    >>> ramp = np.linspace(20.0, 80.0, 1000)
    >>> blocks_of(ramp, np.zeros(1000), 400, 0.02).n
    334
    """
    rows = temperature.size
    if rows <= max_samples:
        return Blocks(np.arange(rows), rows, 1)
    widest = block_span * float(np.ptp(temperature))
    share = math.ceil(rows / max_samples)
    size, first = share, _starts(temperature, segment, share, widest)
    while first.size > max_samples and size < MAX_BLOCK_GROWTH * share:
        size += max(1, size // 16)
        first = _starts(temperature, segment, size, widest)
    if first.size > max_samples:  # the limit on the width of a block wins: no use in blocks larger than fair
        first = _starts(temperature, segment, share, widest)
    return Blocks(first, rows, int(np.diff(np.r_[first, rows]).max()))


def _starts(temperature: Floats, segment: Floats, size: int, widest: float) -> Ints:
    """First rows of blocks of at most `size` rows, over which the temperature moves by `widest` at most."""
    sweep = np.flatnonzero(np.r_[True, np.diff(segment) != 0])
    first = _divide(sweep, _lengths(sweep, temperature), -(-_lengths(sweep, temperature) // size))
    noise = noise_sd(temperature)
    while widest > 0:
        length = _lengths(first, temperature)
        parts = np.clip(np.ceil(_net_move(temperature, first, length, noise) / widest), 1, length)
        if parts.max() == 1:
            break
        first = _divide(first, length, parts.astype(np.int64))
    return first


def _lengths(first: Ints, temperature: Floats) -> Ints:
    return np.asarray(np.diff(np.r_[first, temperature.size]), dtype=np.int64)


def _divide(first: Ints, length: Ints, parts: Ints) -> Ints:
    """First rows when each stretch of rows is divided into parts that differ by one row at most."""
    owner = np.repeat(np.arange(first.size), parts)
    within = np.arange(owner.size) - np.repeat(np.cumsum(parts) - parts, parts)
    return np.asarray(first[owner] + within * length[owner] // parts[owner], dtype=np.int64)


def _net_move(temperature: Floats, first: Ints, length: Ints, noise: float) -> Floats:
    """Twice the difference between the means of the two halves, less what noise may account for.

    That is the width of a ramp; where the temperature moves in one end of a block only it is too small, and
    shows when the halves are looked at in their turn.
    """
    middle = np.minimum(first + (length + 1) // 2, first + length - 1)
    head, tail = np.maximum(middle - first, 1), first + length - middle
    total = np.r_[0.0, np.cumsum(temperature - temperature.mean())]
    move = (total[first + length] - total[middle]) / tail - (total[middle] - total[first]) / head
    spurious = 3.0 * noise * np.sqrt(1.0 / head + 1.0 / tail)
    return np.where(length > 1, 2.0 * np.maximum(np.abs(move) - spurious, 0.0), 0.0)


def average(values: Floats, blocks: Blocks) -> Floats:
    """Mean of each block.

    Parameters
    ----------
    values : ndarray, shape (n,)
    blocks : Blocks

    Returns
    -------
    ndarray, shape (k,)
    """
    if blocks.largest == 1:
        return values
    length = np.diff(np.r_[blocks.first, blocks.rows])
    return np.asarray(np.add.reduceat(values, blocks.first) / length)
