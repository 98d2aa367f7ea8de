r"""Evidence that numbers of sweeps have changed, which may be looked at after every cycle.

The values of one number, those of the sweeps that were fitted first, follow while nothing changes

.. math:: y_i = x_i' \beta + \sigma \sqrt{r_i} \varepsilon_i

with independent standard normal errors, a level (or a law of training) with unknown :math:`\beta`, and an unknown
scatter :math:`\sigma`, which holds all that differs from sweep to sweep: how well the specimen repeats, errors of the
thermometer, noise of readings with whatever memory. What was measured of the fitted sweeps is part of the data, so
their uncertainty is, too. A change adds :math:`\delta g_i`, a step or a ramp from some cycle on, with
:math:`\delta \sim N(0, \kappa^2 \sigma^2)`. Under the right Haar prior of :math:`(\beta, \sigma)` the ratio of both
densities up to any cycle is

.. math:: B = (1 + \kappa^2 G)^{-1/2} \left(1 - \frac{\kappa^2}{1 + \kappa^2 G} \frac{h^2}{R}\right)^{-\nu/2},

with R what least squares leave, :math:`\nu` their degrees of freedom, G and h the squared length of what is left of g
and its product with what is left of y. It is the ratio of densities of the maximal invariant, whose distribution under
the null is the same for every :math:`\beta` and :math:`\sigma`: a test martingale that begins at 1, and so is any
mixture over :math:`\kappa`, shapes and onsets. By Ville's inequality it ever exceeds :math:`1/\alpha` with a
probability of at most :math:`\alpha`. Where several laws of training are possible the least of their martingales is
taken, which is valid under each of them.

That holds for normal scatter. Where every few sweeps are far off, one of them would be taken for a change; so what is
left of each watched value by least squares is first held to `HUBER_BOUND` robust standard deviations, those of all
cycles so far. A single sweep that is far off then weighs little, while a change soon widens what it is measured by. The
price is that the rate is measured, no longer proved; of normal values nearly none is held.

References
----------
M. F. Perez-Ortiz, T. Lardy, R. de Heide, P. Gruenwald, Ann. Statist. 52 (2024) 1410, doi:10.1214/24-AOS2394 (right Haar
priors, regression); A. Ramdas, P. Gruenwald, V. Vovk, G. Shafer, Statist. Sci. 38 (2023) 576, doi:10.1214/23-STS894
(e-processes); H. Robbins, Ann. Math. Statist. 41 (1970) 1397, doi:10.1214/aoms/1177696786 (mixtures, Ville's
inequality); P. J. Huber, Ann. Math. Statist. 35 (1964) 73, doi:10.1214/aoms/1177703732 (values held to a bound).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import logsumexp

from sma_bayes.arrays import Floats
from sma_bayes.normal import MAD_TO_SD
from sma_bayes.studies.watch.schema import OnsetDocument

STEP, RAMP = "step", "ramp"
SHAPES: Final = (STEP, RAMP)
SIZES: Final = {STEP: np.array([2.0, 8.0, 32.0]), RAMP: np.array([0.05, 0.5, 5.0])}
"""Standard deviations of the prior of a change, in those of the scatter: of a step, and of a ramp per cycle."""
HUBER_BOUND: Final = 2.5
"""Robust standard deviations to which what is left of a value is held."""
SINGULAR_TOLERANCE: Final = 1e-9
"""Share of its length below which what is left of a column, or of the data, counts as nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class Watched:
    """Numbers of all sweeps, cycle by cycle: those that were fitted, then those that are watched.

    Attributes
    ----------
    value : ndarray, shape (N, K)
    weight : ndarray, shape (N,)
        One over the variance, in units of that of a fitted sweep.
    fitted : int
        How many cycles were fitted.
    designs : tuple of ndarray, shape (N, p)
        What the mean may do while nothing changes: a constant, and a law of training beside it where one is possible.
    together : ndarray, shape (C, K), optional
        Weights of further series, sums of the numbers that do not hang on their values.
    """

    value: Floats
    weight: Floats
    fitted: int
    designs: tuple[Floats, ...]
    together: Floats | None = None

    @property
    def series(self) -> Floats:
        """Numbers, and the sums of them, shape (N, K + C)."""
        if self.together is None:
            return self.value
        return np.column_stack([self.value, self.value @ self.together.T])

    @property
    def watched(self) -> int:
        """How many cycles are watched."""
        return int(self.value.shape[0] - self.fitted)


@dataclass(frozen=True, slots=True, eq=False)
class LeastSquaresOfNumbers:
    """Least squares of the first n cycles.

    Attributes
    ----------
    root : ndarray, shape (p, p)
        Of the inverse of the normal matrix.
    beta : ndarray, shape (p, K)
    left : ndarray, shape (K,)
        What is left; NaN where that is nothing, so that no scatter can be told.
    spare : int
        Degrees of freedom.
    """

    root: Floats
    beta: Floats
    left: Floats
    spare: int


def log_evidence(numbers: Watched, first: int = 0) -> Floats:
    """Logarithm of the e-process of each series after each watched cycle from one on.

    Parameters
    ----------
    numbers : Watched
    first : int
        The first cycle to tell of, from 0.

    Returns
    -------
    ndarray, shape (watched - first, K + C)
    """
    out = [evidence_after(numbers, n) for n in range(first + 1, numbers.watched + 1)]
    return np.array(out).reshape(-1, numbers.series.shape[1])


def evidence_after(numbers: Watched, watched: int) -> Floats:
    """After so many watched cycles: the least over the laws, shape (K + C,)."""
    return np.asarray(np.min([_under(numbers, d, watched) for d in numbers.designs], axis=0))


def _under(numbers: Watched, design: Floats, watched: int) -> Floats:
    """Under one law: the mixture over onsets, shapes and sizes."""
    ratios = log_ratios(numbers, design, watched)
    changed = logsumexp(ratios + log_prior(watched)[:, None, None], axis=(0, 1))
    return np.asarray(np.logaddexp(changed, -np.log(watched + 1.0)))


def log_prior(watched: int) -> Floats:
    """Prior of the onset with each watched cycle, shared out among shapes and sizes: 1 / (j (j + 1)), shape (n,)."""
    onset = np.arange(1.0, watched + 1.0)
    return np.asarray(-np.log(onset) - np.log1p(onset) - np.log(sum(SIZES[s].size for s in SHAPES)))


def log_ratios(numbers: Watched, design: Floats, watched: int) -> Floats:
    """Log Bayes factors of a change from each watched cycle on, (watched, shapes x sizes, K + C)."""
    n, series = numbers.fitted + watched, numbers.series
    y, w, x = series[:n] - series[0], numbers.weight[:n], design[:n]
    many = sum(SIZES[s].size for s in SHAPES)
    first = least_squares_of(y, w, x)
    if first is None:
        return np.zeros((watched, many, y.shape[1]))
    y = np.concatenate([y[: numbers.fitted], _held(y, x @ first.beta, w, first.spare)[numbers.fitted :]])
    least = least_squares_of(y, w, x)
    assert least is not None  # of the same design and weights
    once = _from_here(w[:, None] * np.column_stack([np.ones(n), x, y - x @ least.beta]))
    ramp = _from_here(once)
    square = 2.0 * _from_here(ramp[:, 0]) - ramp[:, 0]
    late = slice(numbers.fitted, None)
    return np.concatenate(
        [_of_shape(STEP, once[late], once[late, 0], least), _of_shape(RAMP, ramp[late], square[late], least)],
        axis=1,
    )


def _held(y: Floats, fitted: Floats, w: Floats, spare: int) -> Floats:
    """Values (n, K) whose distance from fitted ones is at most `HUBER_BOUND` robust standard deviations."""
    root = np.sqrt(w)[:, None]
    left = (y - fitted) * root
    robust = MAD_TO_SD * np.median(np.abs(left), axis=0) * np.sqrt(len(y) / spare)
    most = np.where(robust > 0.0, HUBER_BOUND * robust, np.inf)
    return np.asarray(fitted + np.clip(left, -most, most) / root)


def _of_shape(shape: str, sums: Floats, length: Floats, least: LeastSquaresOfNumbers) -> Floats:
    """Of a column g that begins at each place: from sums of it with 1, x and what is left, and of its square."""
    p = least.root.shape[0]
    kept = length - np.sum((sums[:, 1 : 1 + p] @ least.root) ** 2, axis=1)
    kept = np.where(kept > SINGULAR_TOLERANCE * length, kept, 0.0)[:, None]
    size = SIZES[shape] ** 2
    grown = 1.0 + size * kept
    along = np.where(kept > 0.0, sums[:, 1 + p :] ** 2 / least.left, 0.0)
    share = np.minimum((size / grown)[:, :, None] * along[:, None, :], 1.0 - 1e-12)
    ratio = -0.5 * np.log(grown)[:, :, None] - 0.5 * least.spare * np.log1p(-share)
    return np.asarray(np.where(np.isnan(least.left), 0.0, ratio))


def _from_here(values: Floats) -> Floats:
    """Sums from each place to the end."""
    return np.asarray(np.cumsum(values[::-1], axis=0)[::-1])


def least_squares_of(y: Floats, w: Floats, x: Floats) -> LeastSquaresOfNumbers | None:
    """Weighted least squares; None where nothing is left to tell a scatter from."""
    spare = y.shape[0] - x.shape[1]
    if spare < 1:
        return None
    weight = np.sqrt(w)[:, None]
    q, r = np.linalg.qr(x * weight)
    if np.abs(np.diag(r)).min() < SINGULAR_TOLERANCE * np.abs(r).max():
        return None
    along = q.T @ (weight * y)
    left = np.sum((weight * y - q @ along) ** 2, axis=0)
    told = left > (SINGULAR_TOLERANCE * np.abs(weight * (y - y[0])).max(axis=0)) ** 2
    inverse = np.linalg.inv(r)
    return LeastSquaresOfNumbers(inverse, inverse @ along, np.where(told, left, np.nan), spare)


def onset(numbers: Watched, which: int) -> OnsetDocument:
    """Posterior of the onset of a change of one series, under the law that leaves it the least evidence."""
    one = replace(numbers, value=numbers.series[:, [which]], together=None)
    n = one.watched
    design = min(one.designs, key=lambda d: float(_under(one, d, n)[0]))
    joint = log_ratios(one, design, n)[:, :, 0] + log_prior(n)[:, None]
    weight = np.exp(joint - logsumexp(joint))
    reached = np.cumsum(weight.sum(axis=1))
    shape = STEP if weight[:, : SIZES[STEP].size].sum() >= 0.5 else RAMP
    low, middle, high = (min(int(np.searchsorted(reached, p)) + 1, n) for p in (0.05, 0.5, 0.95))
    return OnsetDocument(low=low, median=middle, high=high, shape=shape)


def course(shape: str, begins: int, fitted: int, watched: int) -> Floats:
    """A change that begins with a watched cycle (from 1), one at the last: a step, or a ramp, shape (N,)."""
    since = np.arange(fitted + watched) - (fitted + begins - 1) + 1.0
    if shape == STEP:
        return np.asarray((since > 0.0).astype(float))
    return np.asarray(np.maximum(since, 0.0) / max(since[-1], 1.0))
