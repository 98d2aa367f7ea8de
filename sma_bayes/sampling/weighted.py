"""What weighted draws say: evidence, copies of equal weight, and quantiles.

How good a proposal is shows in its importance weights: the efficiency ``(sum w)**2 / (n sum w**2)`` is the share
of draws that count, and the greatest weight tells whether there is mass that the proposal hardly visits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from sma_bayes.arrays import Floats, Ints

LEAST_EFFICIENCY = 0.1
"""Least efficiency of weights that a fit takes as they are; below, they are tempered."""


@dataclass(frozen=True, slots=True, eq=False)
class Weights:
    """Importance weights of draws from a proposal.

    Attributes
    ----------
    log_weight : ndarray, shape (n,)
        Log of density over proposal; minus infinity for draws of no weight.
    normalised : ndarray, shape (n,)
        Weights that sum to one; equal ones where no draw has any.
    efficiency : float
        Effective share of the draws, between 0 and 1.
    greatest : float
        Greatest weight as a multiple of the mean weight.
    """

    log_weight: Floats
    normalised: Floats = field(init=False, repr=False)
    efficiency: float = field(init=False)
    greatest: float = field(init=False)

    def __post_init__(self) -> None:
        n, most = self.log_weight.size, self.log_weight.max()
        w = np.exp(self.log_weight - most) if np.isfinite(most) else np.ones(n)
        w /= w.sum()
        object.__setattr__(self, "normalised", w)
        object.__setattr__(self, "efficiency", 1.0 / (n * float(w @ w)) if np.isfinite(most) else 0.0)
        object.__setattr__(self, "greatest", float(w.max()) * n)

    def log_evidence(self) -> tuple[float, float]:
        """Log of the integral of the density, and its standard error."""
        n, most = self.log_weight.size, int(self.log_weight.argmax())
        value = float(self.log_weight[most] - np.log(n * self.normalised[most]))
        return value, float(np.sqrt(max(1.0 / max(self.efficiency, 1e-12) - 1.0, 0.0) / n))


@dataclass(frozen=True, eq=False)
class ImportanceSample:
    """Draws from a proposal, and what they weigh.

    Attributes
    ----------
    z : ndarray, shape (n, D)
    log_prob : ndarray, shape (n,)
        Of the density there; minus infinity where `log_q` is not finite.
    log_q : ndarray, shape (n,)
        Log density of the proposal there.
    """

    z: Floats
    log_prob: Floats
    log_q: Floats

    @staticmethod
    def of(density: Callable[[Floats], Floats], z: Floats, log_q: Floats) -> ImportanceSample:
        """Evaluate a log density at points (n, D) of a proposal, where `log_q` (n,) is finite."""
        usable = np.isfinite(log_q)
        if usable.all():
            return ImportanceSample(z, density(z), log_q)
        log_prob = np.full(len(z), -np.inf)
        if usable.any():
            log_prob[usable] = density(z[usable])
        return ImportanceSample(z, log_prob, log_q)

    @cached_property
    def log_weight(self) -> Floats:
        """Log of density over proposal, shape (n,)."""
        with np.errstate(invalid="ignore"):
            return np.where(np.isfinite(self.log_prob), self.log_prob - self.log_q, -np.inf)

    @cached_property
    def weights(self) -> Weights:
        """Density over proposal."""
        return Weights(self.log_weight)

    def chosen(self, groups: int, size: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """Points (groups, size, D) by weight, each group's out of a share of its own, and `log_prob` there."""
        count = len(self.z) // groups
        shares = self.log_weight[: count * groups].reshape(count, groups)
        at = (groups * resampled_columns(shares, size, rng) + np.arange(groups)).T
        return self.z[at], self.log_prob[at]


def tempered(weights: Weights) -> Floats:
    """Weights raised to the greatest power that leaves the least share of the draws in effect."""
    low, high = 0.0, 1.0
    if weights.efficiency >= LEAST_EFFICIENCY:
        return weights.normalised
    for _ in range(20):
        middle = 0.5 * (low + high)
        if Weights(middle * weights.log_weight).efficiency >= LEAST_EFFICIENCY:
            low = middle
        else:
            high = middle
    powers = np.full_like(weights.log_weight, -np.inf)
    usable = np.isfinite(weights.log_weight)  # a draw of no weight stays so, also where the power is zero
    powers[usable] = low * weights.log_weight[usable]
    return Weights(powers).normalised


def resampled(log_weight: Floats, size: int, rng: np.random.Generator) -> Ints:
    """Numbers of draws of equal weight, by systematic resampling, in random order.

    Parameters
    ----------
    log_weight : ndarray, shape (S,)
        Logarithms of weights, up to a constant.
    size : int
        How many are taken.
    rng : numpy.random.Generator

    Returns
    -------
    ndarray of int, shape (size,)
        Each draw in as many copies as its weight says, to within one.
    """
    passed = np.cumsum(np.exp(log_weight - log_weight.max()))
    at = (np.arange(size) + rng.random()) / size * passed[-1]
    return rng.permutation(np.searchsorted(passed, at, side="right").clip(max=log_weight.size - 1))


def resampled_columns(
    log_weight: Floats, size: int, rng: np.random.Generator | np.random.RandomState
) -> Ints:
    """The same for each column of few draws (S, W): numbers (size, W) of draws."""
    passed = np.cumsum(np.exp(log_weight - log_weight.max(axis=0)), axis=0)
    at = (np.arange(size)[:, None] + rng.random(log_weight.shape[1])) / size * passed[-1]
    chosen = (at[:, None] > passed[:-1]).sum(axis=1)
    return np.take_along_axis(chosen, np.argsort(rng.random(chosen.shape), axis=0), axis=0)


def weighted_quantiles(values: Floats, log_weight: Floats, levels: Sequence[float]) -> Floats:
    """Quantiles of weighted draws.

    Parameters
    ----------
    values : ndarray, shape (S, m)
        Undefined ones count as greater than all others.
    log_weight : ndarray, shape (S,)
        Logarithms of weights that sum to one.
    levels : sequence of float

    Returns
    -------
    ndarray, shape (len(levels), m)
    """
    order = np.argsort(values, axis=0)
    passed = np.cumsum(np.exp(log_weight)[order], axis=0)
    at = [np.minimum((passed < level * passed[-1]).sum(axis=0), len(values) - 1) for level in levels]
    ordered = np.take_along_axis(values, order, axis=0)
    return np.stack([ordered[i, np.arange(values.shape[1])] for i in at])
