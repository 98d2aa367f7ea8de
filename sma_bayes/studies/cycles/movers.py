"""Which of several things change, where it is not known how many do.

Each changes with one probability p, of which not even the order of magnitude is known: its prior is 1/p, given that at
least one changes. Integrated over p, the number k of those that do has a prior that goes as 1/k, and all choices of k
are equally probable: what stays costs those that change little, be it much or not. Sums over all choices are elementary
symmetric polynomials of the odds, which a recursion gives exactly.

References
----------
J. G. Scott and J. O. Berger, Ann. Stat. 38 (2010) 2587, sec. 2 (an unknown p, with a uniform prior there, and how it
allows for there being many).
"""

from __future__ import annotations

import numpy as np
from scipy.special import gammaln, logsumexp

from sma_bayes.arrays import Bools, Floats, Ints


class Movers:
    """Which of n things change.

    Parameters
    ----------
    log_odds : ndarray, shape (n, K)
        Log likelihood of each where it changes, less that where it stays, under each of K laws.

    Attributes
    ----------
    log_odds : ndarray, shape (K,)
        The same of all together: where at least one changes, less that where all stay.
    """

    def __init__(self, log_odds: Floats) -> None:
        self._each = log_odds
        n, laws = log_odds.shape
        self._sums = np.full((n + 1, n + 1, laws), -np.inf)
        """Log of the sum, over all choices of k of the first i, of the product of odds, shape (i, k, K)."""
        self._sums[0, 0] = 0.0
        for i in range(n):
            self._sums[i + 1] = self._sums[i]
            self._sums[i + 1, 1:] = np.logaddexp(self._sums[i, 1:], self._sums[i, :-1] + log_odds[i])
        count = np.arange(1.0, n + 1.0)
        choices = gammaln(n + 1.0) - gammaln(count + 1.0) - gammaln(n - count + 1.0)
        prior = -np.log(count) - np.log(np.sum(1.0 / count))
        self._by_count = self._sums[n, 1:] + (prior - choices)[:, None]
        self.log_odds = np.asarray(logsumexp(self._by_count, axis=0))

    def draw(self, law: Ints, rng: np.random.Generator) -> Bools:
        """Draw which ones change, at least one.

        Parameters
        ----------
        law : ndarray of int, shape (S,)
            Law of each draw, from 0 to K - 1.
        rng : numpy.random.Generator

        Returns
        -------
        changes : ndarray of bool, shape (n, S)
        """
        n = len(self._each)
        reached = np.cumsum(np.exp(self._by_count - self.log_odds), axis=0)[:-1, law]
        left = 1 + np.sum(rng.random(law.size) > reached, axis=0)
        changes = np.zeros((n, law.size), dtype=bool)
        # where none are left to change, odds are those of n of the first i, which there are not: no more do
        for i in reversed(range(n)):
            odds = self._each[i, law] + self._sums[i, left - 1, law] - self._sums[i + 1, left, law]
            changes[i] = (rng.random(law.size) < np.exp(odds)) | (left == i + 1)
            left -= changes[i]
        return changes
