"""Whether ranks of truths among posterior draws are uniform, as they are where the draws are those of the posterior.

A truth that is drawn from a distribution has a rank among draws of the same distribution that is uniform, whatever the
distribution is. Its place ``u`` in (0, 1) then has mean 1/2 and variance 1/12. Of n places are tested

- the mean, which differs where draws are shifted: ``(mean(u) - 1/2) sqrt(12 n)``,
- the spread, which differs where draws are too narrow or too wide: ``(mean((u - 1/2)**2) - 1/12) sqrt(180 n)``,
- the distribution: the greatest distance of their empirical distribution from the uniform one, after Kolmogorov,

the first two against the standard normal distribution. Holm's rule over all tests of all quantities keeps the chance of
one false alarm or more below a stated rate, whatever depends on what.

References
----------
S. Talts, M. Betancourt, D. Simpson, A. Vehtari, A. Gelman, "Validating Bayesian inference algorithms with
simulation-based calibration", arXiv:1804.06788 (2018); M. A. Stephens, J. R. Stat. Soc. B 32 (1970) 115 (Kolmogorov's
distance of few ranks); S. Holm, "A simple sequentially rejective multiple test
procedure", Scandinavian Journal of Statistics 6 (1979) 65; C. J. Clopper, E. S. Pearson, Biometrika 26 (1934) 404
(intervals of coverages).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.special import betaincinv, kolmogi, kolmogorov, ndtr, ndtri

from sma_bayes.arrays import Floats
from sma_bayes.assess.holm import holm_limits
from sma_bayes.document_part import DocumentPart, Number

FALSE_ALARMS: Final = 0.01
"""Chance that ranks which are uniform are called otherwise, over all quantities of a record together."""
COVERAGE_INTERVAL_LEVEL: Final = 0.95
"""Probability of the intervals of coverages."""


class Coverage(DocumentPart):
    """Share of truths within central intervals."""

    level: Number = Field(description="probability of the intervals [1]")
    share: Number = Field(description="share of truths in them [1]")
    low: Number = Field(description="lower end of its exact binomial 95 % interval [1]")
    high: Number = Field(description="upper end of it [1]")


@dataclass(frozen=True, slots=True)
class Uniformity:
    """What places (n,) in (0, 1) say of uniformity.

    Attributes
    ----------
    shift : float
        Mean of their normal quantiles: how far truths lie above the draws, about [posterior sd]; 0 is right.
    spread : float
        Standard deviation of these: spread of truths over that of the draws, about [1]; 1 is right.
    p_values : tuple of float
        Of location, spread and distribution.
    coverage : tuple of Coverage
        At 50 % and 90 %.
    """

    shift: float
    spread: float
    p_values: tuple[float, ...]
    coverage: tuple[Coverage, ...]


def places(values: Floats, log_weight: Floats, rng: np.random.Generator) -> Floats:
    """Place of the truth among weighted draws, for each quantity.

    Parameters
    ----------
    values : ndarray, shape (1 + S, Q)
        The truth, then the draws; what is not a number counts as greater than all others.
    log_weight : ndarray, shape (S,)
        Logarithms of weights that sum to one.
    rng : numpy.random.Generator
        Orders what is equal, and places the truth between the draws beside it.

    Returns
    -------
    ndarray, shape (Q,)
        In (0, 1): uniform where the truth is exchangeable with the draws.
    """
    w = np.exp(log_weight)
    effective = 1.0 / float(w @ w)
    values = np.where(np.isnan(values), np.inf, values)
    truth, draws = values[0], values[1:]
    below, equal = w @ (draws < truth), w @ (draws == truth)
    share = np.clip(below + rng.random(truth.size) * equal, 0.0, 1.0)
    return np.asarray((effective * share + rng.uniform(1e-12, 1.0, truth.size)) / (effective + 1.0))


def uniformity(u: Floats) -> Uniformity:
    """Tests of uniformity of places (n,).

    Examples
    --------
    >>> even = uniformity((np.arange(1000) + 0.5) / 1000)
    >>> round(even.spread, 2), [c.share for c in even.coverage], min(even.p_values) > 0.9
    (1.0, [0.5, 0.9], True)
    """
    n = u.size
    score = ndtri(np.clip(u, 1e-12, 1.0 - 1e-12))
    z = np.array([
        (u.mean() - 0.5) * np.sqrt(12.0 * n),
        (np.mean((u - 0.5) ** 2) - 1.0 / 12.0) * np.sqrt(180.0 * n),
    ])  # fmt: skip
    ordered, steps = np.sort(u), np.arange(n + 1) / n
    distance = float(max(np.max(steps[1:] - ordered), np.max(ordered - steps[:-1])))
    two_sided = 2.0 * ndtr(-np.abs(z))
    coverage = []
    for level in (0.5, 0.9):
        inside = int(np.sum(np.abs(u - 0.5) <= 0.5 * level))
        low, high = _proportion(inside, n)
        coverage.append(Coverage(level=level, share=inside / n, low=low, high=high))
    p_values = (float(two_sided[0]), float(two_sided[1]), float(kolmogorov(distance * _effective_root(n))))
    return Uniformity(float(score.mean()), float(score.std()), p_values, tuple(coverage))


def rejected(p_values: Floats, rate: float = FALSE_ALARMS) -> NDArray[np.bool_]:
    """Which of several tests (any shape) are rejected by Holm's rule, with at most `rate` for one false alarm or more.

    Examples
    --------
    >>> rejected(np.array([0.004, 0.02, 0.001]), 0.01).tolist()
    [True, False, True]
    """
    flat = np.asarray(p_values, dtype=float).ravel()
    return np.asarray(flat <= holm_limits(flat, rate)).reshape(np.shape(p_values))


def band_half_width(n: int, quantities: int, rate: float = FALSE_ALARMS) -> float:
    """How far the empirical distribution of n uniform places may lie from the uniform one, for all quantities at once.

    Kolmogorov's distribution with Bonferroni's correction.
    """
    return float(kolmogi(rate / quantities)) / _effective_root(n)


def _effective_root(n: int) -> float:
    """What Kolmogorov's distance is multiplied by to have its limiting distribution at any n (Stephens, 1970)."""
    root = float(np.sqrt(n))
    return root + 0.12 + 0.11 / root


def _proportion(inside: int, n: int) -> tuple[float, float]:
    """Exact binomial interval of a share."""
    tail = 0.5 * (1.0 - COVERAGE_INTERVAL_LEVEL)
    low = betaincinv(inside, n - inside + 1, tail) if inside else 0.0
    high = betaincinv(inside + 1, n - inside, 1.0 - tail) if inside < n else 1.0
    return float(low), float(high)
