"""What each sweep has of its own shape, beside the common curve and its four numbers.

Sweeps of a real specimen are one curve with four numbers only nearly: a first cycle bursts where later ones creep.
What curve and numbers leave of sweep i is

    r_i = D_i e + B_i v_i + noise,    v_i ~ N(0, size_i**2),

with errors e of the common curve, and what the sweep has of its own: a discrepancy (`sma_bayes.fitting.discrepancy`)
beside its own curve, orthogonal to what its four numbers do. Each sweep has a size of its own, since the first ones
differ from all others by more than these from each other; a priori the logarithm of one is normal about a mean that
all sweeps tell together. Sizes and the standard deviation of the noise are their most
probable values once e and v_i are integrated out, found by expectation and maximisation over e. Noise is white, so that
what is slow within a sweep is its own. A sweep to come has the shape of one of the later half of those that were
measured: where a shape has settled it is what these have in common, and where each differs it may be any of these.

References
----------
A. P. Dempster, N. M. Laird and D. B. Rubin, J. R. Stat. Soc. B 39 (1977) 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import softmax

from sma_bayes.arrays import Floats, Ints
from sma_bayes.fitting.discrepancy import MEDIAN_SIZE, SIGMA_OF_SIZE, DiscrepancyBasis
from sma_bayes.fitting.discrepancy_weights import LN_SIZE_GRID

NUMBERS_OF_A_SWEEP: Final = 4
"""Samples of a sweep that its numbers account for."""
LEAST_NOISE: Final = 1e-5
"""Least noise that is reckoned with [spans]."""
LN_TOLERANCE: Final = 1e-2
"""To which the logarithms of the standard deviations are found."""
SD_OF_LN_SIZE: Final = 1.0
"""Standard deviation of the logarithms of the sizes of sweeps about their mean, a priori."""
MAX_ROUNDS: Final = 50
"""Most rounds of expectation and maximisation."""


@dataclass(frozen=True, slots=True, eq=False)
class SweepResidual:
    """What the common curve leaves of one sweep.

    Attributes
    ----------
    residual : ndarray, shape (n,)
        What curve and numbers leave [unit of the channel].
    common : ndarray, shape (n, k)
        What errors of the common curve do, less what numbers follow.
    basis : DiscrepancyBasis
        Of what the sweep may have of its own, against temperature.
    """

    residual: Floats
    common: Floats
    basis: DiscrepancyBasis


@dataclass(frozen=True, slots=True, eq=False)
class OwnShape:
    """What one sweep has of its own.

    Attributes
    ----------
    basis : DiscrepancyBasis
        m functions of temperature.
    expected, sd : ndarray, shape (m,)
        Of their weights, beside the expected common curve.
    follows : ndarray, shape (k, m)
        By how much weights change with each error of the common curve.
    """

    basis: DiscrepancyBasis
    expected: Floats
    sd: Floats
    follows: Floats

    def draw(self, errors: Floats | None, count: int, rng: np.random.Generator) -> Floats:
        """Weights (count, m) given errors (count, k) of the common curve."""
        own = self.expected + self.sd * rng.standard_normal((count, self.sd.size))
        return own if errors is None else own + errors @ self.follows


@dataclass(frozen=True, slots=True, eq=False)
class OwnShapeToCome:
    """What a sweep to come has of its own: the shape of one of some measured sweeps, which one is not known.

    Attributes
    ----------
    shapes : tuple of OwnShape
        Of these sweeps, in order.
    basis : DiscrepancyBasis
        Their functions, one sweep's after the other's, m in all.
    """

    shapes: tuple[OwnShape, ...]
    basis: DiscrepancyBasis

    @staticmethod
    def of(shapes: Sequence[OwnShape]) -> OwnShapeToCome:
        """One of these, told at the nodes of the last."""
        nodes = shapes[-1].basis.temperature
        values = np.hstack([s.basis.at(nodes) for s in shapes])
        return OwnShapeToCome(tuple(shapes), DiscrepancyBasis.tabulated(nodes, values, np.empty(0)))

    @property
    def expected(self) -> Floats:
        """The mean of them, weights (m,)."""
        return np.concatenate([s.expected for s in self.shapes]) / len(self.shapes)

    def draw(self, errors: Floats | None, count: int, rng: np.random.Generator) -> Floats:
        """Weights (count, m) given errors (count, k) of the common curve: of one sweep in each, else 0."""
        which = rng.integers(len(self.shapes), size=count)
        return np.hstack(
            [
                np.where((which == i)[:, None], s.draw(errors, count, rng), 0.0)
                for i, s in enumerate(self.shapes)
            ]
        )


@dataclass(frozen=True, slots=True, eq=False)
class CycleScatter:
    """Standard deviations that sweeps of a common curve have.

    Attributes
    ----------
    noise : float
        Of a reading about the curve of its sweep [unit of the channel].
    sizes : ndarray, shape (n,)
        Root mean square of what each sweep has of its own over its samples [unit of the channel].
    usual_size : float
        About which these are a priori.
    """

    noise: float
    sizes: Floats
    usual_size: float

    def own(self, sweeps: Sequence[SweepResidual], common: Floats) -> list[OwnShape]:
        """What each sweep has of its own beside a common curve with expected weights (k,)."""
        found = []
        for s, size in zip(sweeps, self.sizes, strict=True):
            rows = s.basis.rows
            gain = size**2 / (self.noise**2 + size**2 * np.sum(rows**2, axis=1))
            expected = gain * (rows @ (s.residual - s.common @ common))
            follows = -(gain[:, None] * (rows @ s.common)).T
            found.append(OwnShape(s.basis, expected, np.sqrt(gain) * self.noise, follows))
        return found


def scatter_of(sweeps: Sequence[SweepResidual], missed: int, span: float, noise: float) -> CycleScatter:
    """Most probable scatter of sweeps.

    Parameters
    ----------
    sweeps : sequence of SweepResidual
    missed : int
        How many errors of the common curve, the first, are of what its model misses. Their weights have a size a
        priori, which is found beside; others are free.
    span : float
        Of the common curve [unit of the channel]; what sizes are relative to a priori.
    noise : float
        To start from [unit of the channel].
    """
    known = _Known.of(sweeps)
    ln_usual = usual = float(np.log(MEDIAN_SIZE * span))
    ln_size = usual + SIGMA_OF_SIZE * LN_SIZE_GRID
    grid = np.exp(ln_size)
    of_common = float(np.exp(usual))
    sizes, noise = np.full(len(sweeps), of_common), max(noise, LEAST_NOISE * span)
    for _ in range(MAX_ROUNDS):
        variance = noise**2 + sizes[known.sweep] ** 2 * known.power
        error, spread = known.common(variance, noise, of_common, missed)
        along, beside = known.squares(error, spread)
        before = np.array([noise, np.exp(ln_usual), *sizes])
        each = grid[:, None] ** 2 * known.power + noise**2
        cost = np.zeros((grid.size, len(sweeps)))
        np.add.at(cost.T, known.sweep, (np.log(each) + along / each).T)
        density = -0.5 * cost - 0.5 * ((ln_size - ln_usual) / SD_OF_LN_SIZE)[:, None] ** 2
        sizes = grid[np.argmax(density, axis=0)]
        ln_usual = _mean_ln_size(ln_size @ softmax(density, axis=0), usual)
        if missed:
            square = float(error[:missed] @ error[:missed] + np.trace(spread[:missed, :missed]))
            of_common = grid[np.argmax(-0.5 * LN_SIZE_GRID**2 - missed * ln_size - 0.5 * square / grid**2)]
        own = sizes[known.sweep] ** 2 * known.power
        noise = _likeliest_noise(own, along, beside, known.free, noise, LEAST_NOISE * span)
        if np.all(np.abs(np.log(np.array([noise, np.exp(ln_usual), *sizes]) / before)) < LN_TOLERANCE):
            break
    return CycleScatter(noise, sizes, float(np.exp(ln_usual)))


def _mean_ln_size(expected: Floats, usual: float) -> float:
    """Mean of ln sizes of sweeps, from what is expected of each and what is usual."""
    precision = expected.size / SD_OF_LN_SIZE**2
    return float((usual / SIGMA_OF_SIZE**2 + precision * expected.mean()) / (SIGMA_OF_SIZE**-2 + precision))


@dataclass(frozen=True, slots=True, eq=False)
class _Known:
    """Sums over the samples of all sweeps, along their own functions (M of all sweeps) and beside these.

    Attributes
    ----------
    sweep : ndarray of int, shape (M,)
        Which each function is of.
    power : ndarray, shape (M,)
        Square of each over its samples.
    pull : ndarray, shape (M,)
    along : ndarray, shape (M, k)
        Residuals, and errors of the common curve, along each.
    square, pulled, whole
        Products of all residuals, of these with errors of the common curve, (k,), and of these, (k, k).
    free : int
        Samples beyond numbers and own functions.
    """

    sweep: Ints
    power: Floats
    pull: Floats
    along: Floats
    square: float
    pulled: Floats
    whole: Floats
    free: int

    @staticmethod
    def of(sweeps: Sequence[SweepResidual]) -> _Known:
        power = [np.sum(s.basis.rows**2, axis=1) for s in sweeps]
        unit = [
            s.basis.rows[p > 0.0] / np.sqrt(p[p > 0.0])[:, None] for s, p in zip(sweeps, power, strict=True)
        ]
        values = [np.column_stack([s.common, s.residual]) for s in sweeps]
        products = sum((v.T @ v for v in values[1:]), values[0].T @ values[0])
        along = np.vstack([u @ v for u, v in zip(unit, values, strict=True)])
        samples = sum(max(s.residual.size - NUMBERS_OF_A_SWEEP, 1) for s in sweeps)
        return _Known(
            np.repeat(np.arange(len(sweeps)), [len(u) for u in unit]),
            np.concatenate([p[p > 0.0] for p in power]),
            along[:, -1],
            along[:, :-1],
            float(products[-1, -1]),
            products[:-1, -1],
            products[:-1, :-1],
            max(samples - len(along), 0),
        )

    def common(self, variance: Floats, noise: float, size: float, missed: int) -> tuple[Floats, Floats]:
        """Expected errors (k,) of the common curve and their covariance (k, k)."""
        share = 1.0 - noise**2 / variance
        information = (self.whole - (self.along.T * share) @ self.along) / noise**2
        precision = np.where(np.arange(len(self.whole)) < missed, size**-2.0, 0.0)
        rounding = 1e-12 * np.trace(information) / max(len(information), 1)
        spread = np.asarray(np.linalg.inv(information + np.diag(precision + rounding)))
        toward = (self.pulled - self.along.T @ (share * self.pull)) / noise**2
        return np.asarray(spread @ toward), spread

    def squares(self, error: Floats, spread: Floats) -> tuple[Floats, float]:
        """Expected squares of what is left along each function, (M,), and of what is left beside all of them."""
        uncertain = np.sum((self.along @ spread) * self.along, axis=1)
        along = (self.pull - self.along @ error) ** 2 + uncertain
        whole = (
            self.square - 2.0 * self.pulled @ error + error @ self.whole @ error + np.sum(self.whole * spread)
        )
        return along, max(float(whole - np.sum(along)), 0.0)


def _likeliest_noise(
    own: Floats, along: Floats, beside: float, free: int, noise: float, least: float
) -> float:
    """Standard deviation of the noise beside variances of own functions, given expected squares."""

    def cost(ln_noise: float) -> float:
        variance = np.exp(2.0 * ln_noise)
        each = variance + own
        return float(np.sum(np.log(each) + along / each) + 2.0 * free * ln_noise + beside / variance)

    middle = np.log(noise)
    found = minimize_scalar(cost, bounds=(middle - 1.0, middle + 1.0), method="bounded")
    return max(float(np.exp(found.x)), least)
