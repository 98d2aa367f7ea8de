"""What samples tell of series along them: inner products weighted by the inverse of the covariance of the noise.

Where a sample depends on the one before it alone, that inverse couples neighbours only: two weights for each sample,
or for each kind of sample where they are few, give the products for every value of the noise.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np

from sma_bayes.arrays import Floats, Ints

ALL_SAMPLES = slice(None)
"""All samples."""


class Information(ABC):
    """Expected information of samples about series along them, for each of W values of the noise."""

    @abstractmethod
    def products(self, rows: Floats, others: Floats, samples: slice = ALL_SAMPLES) -> Floats:
        """Weighted inner products of series.

        Parameters
        ----------
        rows, others : ndarray, shape (a, n) and (b, n)
            Along all samples.
        samples : slice
            Those over which is summed: whole sweeps.

        Returns
        -------
        ndarray, shape (W, a, b)
            ``rows @ inv(R) @ others.T`` for Gaussian noise of covariance R; its expectation under the noise's own
            density otherwise.
        """
        ...

    @abstractmethod
    def scaled(self, factor: Floats) -> Information:
        """So many times (W,) the information."""
        ...

    def gram(self, rows: Floats) -> Floats:
        """Products of series (m, n) with each other, shape (W, m, m)."""
        return self.products(rows, rows)


class KindsOfSample(Information):
    """Of samples of few kinds.

    Parameters
    ----------
    own : ndarray, shape (W, g)
        Weight of the products of samples with themselves, by kind.
    kinds : ndarray, shape (g, n)
        1 where a sample is of a kind and 0 elsewhere; it may be of several.
    beside : ndarray, shape (W,), optional
        Weight of their products with the sample before.
    linked : ndarray, shape (n,), optional
        1 where a sample depends on the one before it.
    """

    def __init__(
        self, own: Floats, kinds: Floats, beside: Floats | None = None, linked: Floats | None = None
    ) -> None:
        self.own, self.kinds, self.beside, self.linked = own, kinds, beside, linked

    def products(self, rows: Floats, others: Floats, samples: slice = ALL_SAMPLES) -> Floats:
        x, y = rows[:, samples], others[:, samples]
        terms = [(x * kind[samples]) @ y.T for kind in self.kinds]
        weights = self.own
        if self.beside is not None and self.linked is not None:
            linked = self.linked[samples]
            terms.append((x * linked) @ _before(y).T + _before(x) @ (y * linked).T)
            weights = np.concatenate([weights, self.beside[:, None]], axis=1)
        # who asks wants one entry of all matrices together
        return np.moveaxis(np.tensordot(np.stack(terms), weights.T, axes=(0, 0)), -1, 0)

    def scaled(self, factor: Floats) -> KindsOfSample:
        beside = None if self.beside is None else factor * self.beside
        return KindsOfSample(factor[:, None] * self.own, self.kinds, beside, self.linked)


class EachSample(Information):
    """Of samples each of which has weights of its own.

    Parameters
    ----------
    own : ndarray, shape (W, n)
        Weight of the product of a sample with itself.
    beside : ndarray, shape (W, n), optional
        Weight of its products with the sample before; zero where a sweep begins.
    """

    def __init__(self, own: Floats, beside: Floats | None = None) -> None:
        self.own, self.beside = own, beside

    def products(self, rows: Floats, others: Floats, samples: slice = ALL_SAMPLES) -> Floats:
        i, j = (x.ravel() for x in np.indices((len(rows), len(others))))
        return self._of_pairs(rows, others, i, j, samples).reshape(len(self.own), len(rows), len(others))

    def gram(self, rows: Floats) -> Floats:
        m = len(rows)
        i, j = np.triu_indices(m)
        place = np.empty((m, m), dtype=np.intp)
        place[i, j] = place[j, i] = np.arange(i.size)
        return np.take(self._of_pairs(rows, rows, i, j, ALL_SAMPLES), place.ravel(), axis=1).reshape(
            len(self.own), m, m
        )

    def _of_pairs(self, rows: Floats, others: Floats, i: Ints, j: Ints, samples: slice) -> Floats:
        """Products (W, p) of rows `i` with others `j`: those of the samples serve all weights."""
        x, y = rows[:, samples], others[:, samples]
        found = self.own[:, samples] @ (x[i] * y[j]).T
        if self.beside is not None:
            before, before_other = _before(x), _before(y)
            found += self.beside[:, samples] @ (x[i] * before_other[j] + before[i] * y[j]).T
        return np.asarray(found)

    def scaled(self, factor: Floats) -> EachSample:
        beside = None if self.beside is None else factor[:, None] * self.beside
        return EachSample(factor[:, None] * self.own, beside)


class OfDecorrelated(Information):
    """Of samples that depend on each other in any way.

    Parameters
    ----------
    decorrelate : callable
        Linear map of series (W, m, n) that leaves independent samples of unit variance.
    inverse : ndarray, shape (W, n) or (W, 1)
        One over the standard deviation of the noise.
    factor : ndarray, shape (W,)
        Information of one sample.
    """

    def __init__(self, decorrelate: Callable[[Floats], Floats], inverse: Floats, factor: Floats) -> None:
        self.decorrelate, self.inverse, self.factor = decorrelate, inverse, factor

    def products(self, rows: Floats, others: Floats, samples: slice = ALL_SAMPLES) -> Floats:
        left, right = (self.decorrelate(x * self.inverse[:, None, :])[..., samples] for x in (rows, others))
        return np.asarray(self.factor[:, None, None] * (left @ np.swapaxes(right, 1, 2)))

    def scaled(self, factor: Floats) -> OfDecorrelated:
        return OfDecorrelated(self.decorrelate, self.inverse, factor * self.factor)


def of_independent_samples(count: int, factor: Floats, inverse: Floats | None) -> Information:
    """Of independent samples.

    Parameters
    ----------
    count : int
        Number n of samples.
    factor : ndarray, shape (W,)
        Information of each, where its noise is of unit scale.
    inverse : ndarray, shape (W, n) or (W, 1), or None
        One over the scale of the noise; 1 where there is none.
    """
    if is_even(inverse):
        return KindsOfSample(factor[:, None] * squared(inverse, len(factor))[:, None], np.ones((1, count)))
    assert inverse is not None
    return EachSample(factor[:, None] * inverse * inverse)


def is_even(inverse: Floats | None) -> bool:
    """Whether all samples are of one scale."""
    return inverse is None or inverse.shape[1] == 1


def squared(inverse: Floats | None, count: int) -> Floats:
    """Square (W,) of one scale for all samples, for so many values of the noise."""
    return np.ones(count) if inverse is None else inverse[:, 0] ** 2


def _before(rows: Floats) -> Floats:
    """The sample before each; zero before the first."""
    return np.concatenate([np.zeros((len(rows), 1)), rows[:, :-1]], axis=1)
