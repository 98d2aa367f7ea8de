"""Weights of a discrepancy, and of what sweeps have of their own: integrated out of a likelihood, or drawn again.

Given the curve and the parameters of the noise, residuals are linear in the weights, which are normal a priori. Where
the noise is normal, too, their posterior is, and the density of the residuals without them is exact; for other noise
it is Laplace's. The parameters of the noise differ from row to row of what is asked for, so that there is a system of
normal equations for each.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from sma_bayes.arrays import Floats
from sma_bayes.fitting.discrepancy import MEDIAN_SIZE, SIGMA_OF_SIZE
from sma_bayes.fitting.sweep_functions import SweepFunctions
from sma_bayes.noise import NoiseModel, Steps

GREATEST_INFORMATION = 1e14
"""Information about weights, in units of that of their prior, beyond which a point counts as impossible."""
STEPS = 6
"""Steps of Fisher scoring to the likeliest weights under noise that is not normal."""
SIZES = np.linspace(-2.5, 2.5, 41)
"""Sizes over which is summed where a curve stands, in standard deviations of the logarithm about its median."""


@dataclass(frozen=True, slots=True, eq=False)
class Whitened:
    """Standardised residuals of one channel, with the basis of its discrepancy in the same units.

    Attributes
    ----------
    noise : NoiseModel
    shape : ndarray, shape (W, k)
        Parameters of the noise after ``sd``.
    steps : Steps
    e : ndarray, shape (W, n)
        Residuals, each over the standard deviation of its noise.
    scale : ndarray, shape (W, n) or (W, 1)
        That standard deviation [unit of the channel].
    rows : ndarray, shape (m, n)
        Basis functions at the samples, orthogonal to each other.
    size : ndarray, shape (W, m) or (W, 1)
        Standard deviation of each weight a priori [unit of the channel].
    sweep_functions : SweepFunctions or None
        What each sweep has of its own. Its weights, S of q functions, follow those of the rows.
    between : ndarray, shape (W,), or None
        Standard deviation of these [unit of the channel].
    """

    noise: NoiseModel
    shape: Floats
    steps: Steps
    e: Floats
    scale: Floats
    rows: Floats
    size: Floats
    sweep_functions: SweepFunctions | None = None
    between: Floats | None = None

    def _system(self) -> _Weights:
        """Normal equations of the weights in units of their prior."""
        noise, shape = self.noise, self.shape
        a = noise.decorrelate(self.e, shape, self.steps)
        inverse = 1.0 / self.scale
        if self.sweep_functions is not None:
            return _WithSweeps(self, a, inverse)
        if self.scale.shape[1] == 1 and not noise.autocorrelated:
            count = noise.location_information(shape)
            power = np.einsum("mn,mn->m", self.rows, self.rows)
            return _Apart(self, a, inverse, count[:, None] * (self.size * inverse) ** 2 * power)
        gram = noise.weighted_gram(self.rows, shape, self.steps, inverse)
        return _Coupled(self, a, inverse, gram * (self.size[:, :, None] * self.size[:, None, :]))

    def _likeliest(self, weights: _Weights) -> Floats:
        """Likeliest weights (W, m) in units of their prior."""
        v = weights.solve(weights.project(weights.a))
        if self.noise.is_gaussian:
            return v
        damping = self.noise.damping(self.shape)[:, None]
        for _ in range(STEPS):
            left = self.noise.decorrelate(self.e - weights.series(v), self.shape, self.steps)
            v = v + damping * weights.solve(weights.project(self.noise.score(left, self.shape)) - v)
        return v

    def marginal_log_density(self) -> Floats:
        """Log density (W,) of the residuals with the weights integrated out; exact where the noise is normal.

        Otherwise by Laplace's method with the expected information, at the likeliest weights.
        """
        noise, shape, steps = self.noise, self.shape, self.steps
        weights = self._system()
        v = self._likeliest(weights)
        if noise.is_gaussian:
            density = noise.total_log_density(self.e, shape, steps)
            density = density + 0.5 * np.einsum("wm,wm->w", v, weights.project(weights.a))
        else:
            density = noise.total_log_density(self.e - weights.series(v), shape, steps)
            density = density - 0.5 * np.einsum("wm,wm->w", v, v)
        if self.scale.shape[1] == 1:
            log_scale = self.e.shape[1] * np.log(self.scale[:, 0])
        else:
            log_scale = np.log(self.scale).sum(axis=1)
        return np.asarray(density - weights.half_log_determinant() - log_scale)

    def likeliest_weights(self) -> Floats:
        """Likeliest weights (W, m) of the rows [unit of the channel]."""
        return np.asarray(self.size * self._likeliest(self._system())[:, : len(self.rows)])

    def likeliest_series(self) -> Floats:
        """What is likeliest beside the curve (W, n), that of sweeps included, in standard deviations of the noise."""
        weights = self._system()
        return weights.series(self._likeliest(weights))

    def draw_weights(self, rng: np.random.Generator) -> Floats:
        """Weights (W, m) of the rows [unit of the channel] drawn given everything else."""
        return np.asarray(self.size * self._drawn(rng)[:, : len(self.rows)])

    def _drawn(self, rng: np.random.Generator) -> Floats:
        """All weights in units of their prior, drawn given everything else."""
        weights = self._system()
        return self._likeliest(weights) + weights.draw(rng)

    def draw_weights_of_sweeps(self, rng: np.random.Generator) -> Floats:
        """Weights (W, S, q) of what sweeps have of their own [unit of the channel], drawn given everything else."""
        own, between = self.sweep_functions, self.between
        assert own is not None
        assert between is not None
        drawn = self._drawn(rng)[:, len(self.rows) :]
        return np.asarray(between[:, None, None] * drawn.reshape(len(drawn), len(own.parts), -1))


def safe_cholesky(information: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Cholesky factors (W, m, m) of ``1 + H``, and which are usable: `H` finite, positive definite beyond rounding."""
    diagonal = np.einsum("wmm->wm", information)
    usable = np.isfinite(information).all(axis=(1, 2)) & (diagonal.sum(axis=1) < GREATEST_INFORMATION)
    matrix = np.where(usable[:, None, None], information, 0.0)
    np.einsum("wmm->wm", matrix)[:] *= 1.0 + 1e-13
    np.einsum("wmm->wm", matrix)[:] += 1.0
    try:
        return np.asarray(np.linalg.cholesky(matrix)), usable
    except np.linalg.LinAlgError:
        least = np.linalg.eigvalsh(matrix)[:, 0]
        usable &= least > 1e-15 * np.einsum("wmm->w", matrix)
        matrix[~usable] = np.eye(matrix.shape[1])
        return np.asarray(np.linalg.cholesky(matrix)), usable


def summing_to_zero(roots: Floats, across: Floats) -> tuple[Floats, Floats, Floats]:
    """What it takes to make weights of several groups sum to zero that a priori are independent of unit variance.

    Parameters
    ----------
    roots : ndarray, shape (W, S, q, q)
        Cholesky factors of the precision ``D`` of each group.
    across : ndarray, shape (W, q, k)
        Sums over groups.

    Returns
    -------
    returned : ndarray, shape (W, S, q, q)
        ``D**-1 A**-1`` of each group, ``A = sum of D**-1``: its part of a sum that is taken back.
    half_log_determinant : ndarray, shape (W,)
        ``ln |A/S|/2``, by which that of the precision grows, relative to that of the prior.
    multiplier : ndarray, shape (W, q, k)
        ``A**-1`` times the sums.
    """
    half = np.linalg.inv(roots)
    covariance = np.swapaxes(half, 2, 3) @ half
    total = covariance.sum(axis=1)
    returned = np.swapaxes(np.linalg.solve(total[:, None], covariance), 2, 3)
    half_log_determinant = 0.5 * np.linalg.slogdet(total / roots.shape[1])[1]
    return returned, half_log_determinant, np.linalg.solve(total, across)


class _Weights:
    """Normal equations ``(1 + H) v = b`` of the weights ``v = w/size``.

    Parameters
    ----------
    whitened : Whitened
    a : ndarray, shape (W, n)
        Innovations of its residuals.
    inverse : ndarray, shape (W, n) or (W, 1)
        One over the standard deviation of the noise.
    """

    def __init__(self, whitened: Whitened, a: Floats, inverse: Floats) -> None:
        self.whitened = whitened
        self.a = a
        self.inverse = inverse

    def project(self, innovation: Floats) -> Floats:
        """Inner products (W, m) of the decorrelated basis with a series (W, n)."""
        w = self.whitened
        back = w.noise.decorrelate_adjoint(innovation, w.shape, w.steps)
        return np.asarray(((back * self.inverse) @ w.rows.T) * w.size)

    def series(self, v: Floats) -> Floats:
        """Discrepancy (W, n) of weights (W, m), over the standard deviation of the noise."""
        return np.asarray(((v * self.whitened.size) @ self.whitened.rows) * self.inverse)

    @abstractmethod
    def solve(self, right: Floats) -> Floats:
        """Solutions (W, m)."""
        ...

    @abstractmethod
    def half_log_determinant(self) -> Floats:
        """``ln |1 + H|/2``, shape (W,)."""
        ...

    @abstractmethod
    def draw(self, rng: np.random.Generator) -> Floats:
        """Draws (W, m) of ``N(0, (1 + H)**-1)``."""
        ...


class _Apart(_Weights):
    """Weights that the samples tell apart from each other: ``H`` is diagonal, with `information` (W, m)."""

    def __init__(self, whitened: Whitened, a: Floats, inverse: Floats, information: Floats) -> None:
        super().__init__(whitened, a, inverse)
        self.precision = 1.0 + information

    def solve(self, right: Floats) -> Floats:
        return np.asarray(right / self.precision)

    def half_log_determinant(self) -> Floats:
        return np.asarray(0.5 * np.log(self.precision).sum(axis=1))

    def draw(self, rng: np.random.Generator) -> Floats:
        return np.asarray(rng.standard_normal(self.precision.shape) / np.sqrt(self.precision))


class _Coupled(_Weights):
    """Weights that the samples tell together: ``H`` is `information` (W, m, m)."""

    def __init__(self, whitened: Whitened, a: Floats, inverse: Floats, information: Floats) -> None:
        super().__init__(whitened, a, inverse)
        self.root, usable = safe_cholesky(information)
        self.unusable = np.where(usable, 0.0, np.nan)

    @cached_property
    def _columns(self) -> Floats:
        """The factors as (m, m, W): LAPACK has no triangles in batches, so each step is made for all at once."""
        return np.ascontiguousarray(np.moveaxis(self.root, 0, -1))

    def solve(self, right: Floats) -> Floats:
        left, y = self._columns, right.T.copy()
        for k in range(len(y)):
            y[k] /= left[k, k]
            y[k + 1 :] -= left[k + 1 :, k] * y[k]
        return self._back(y)

    def _back(self, y: Floats) -> Floats:
        """Solutions (W, m) with the transposed factors for `y` (m, W), which is overwritten."""
        left = self._columns
        for k in reversed(range(len(y))):
            y[k] /= left[k, k]
            y[:k] -= left[k, :k] * y[k]
        return np.ascontiguousarray(y.T)

    def half_log_determinant(self) -> Floats:
        return np.asarray(np.log(np.einsum("wmm->wm", self.root)).sum(axis=1) + self.unusable)

    def draw(self, rng: np.random.Generator) -> Floats:
        return self._back(rng.standard_normal(self.root.shape[:2]).T.copy())


class _WithSweeps(_Weights):
    """Weights of all samples, and of each sweep alone: those of one sweep know of another's through the first alone.

    Weights of sweeps are eliminated sweep by sweep, so that what this costs grows with the number of samples. With
    `D`, `B` and `C` the parts of ``1 + H`` of one sweep, between sweep and all, and of all, what is left is
    ``C - sum of B' D**-1 B``.

    Where they sum to zero, that holds with ``D**-1 - D**-1 A**-1 D**-1``, ``A = sum of D**-1``, between sweeps.

    Parameters
    ----------
    whitened : Whitened
        With what sweeps have of their own.
    """

    def __init__(self, whitened: Whitened, a: Floats, inverse: Floats) -> None:
        super().__init__(whitened, a, inverse)
        own, between = whitened.sweep_functions, whitened.between
        assert own is not None
        assert between is not None
        self.sweep_functions = own
        self.own_size = between[:, None, None]
        m, q = len(whitened.rows), len(own.samples)
        size = np.broadcast_to(whitened.size, (len(a), m))
        all_sizes = np.concatenate([size, np.repeat(between[:, None], q, axis=1)], axis=1)
        every = np.concatenate([whitened.rows, own.samples])
        total = np.zeros((len(a), m, m))
        roots, shares, usable = [], [], np.ones(len(a), dtype=bool)
        for part in own.parts:
            gram = self._gram(every[:, part], part) * (all_sizes[:, :, None] * all_sizes[:, None, :])
            root, fine = safe_cholesky(gram[:, m:, m:])
            across = np.where(fine[:, None, None], gram[:, m:, :m], 0.0)
            half = np.linalg.solve(root, across)
            total += gram[:, :m, :m] - np.swapaxes(half, 1, 2) @ half
            roots.append(root)
            shares.append(np.linalg.solve(np.swapaxes(root, 1, 2), half))
            usable &= fine
        self.roots, self.shares = np.stack(roots, axis=1), np.stack(shares, axis=1)
        self.unusable = np.where(usable, 0.0, np.nan)
        self.returned: Floats | None = None
        self.half_log_of_sum = np.zeros(len(a))
        if own.sum_to_zero:
            sum_of_shares = self.shares.sum(axis=1)
            self.returned, self.half_log_of_sum, multiplier = summing_to_zero(self.roots, sum_of_shares)
            total += np.swapaxes(sum_of_shares, 1, 2) @ multiplier
            self.shares = self._less_sum(self.shares, sum_of_shares)
        self.common = _Coupled(whitened, a, inverse, total)

    def _less_sum(self, own: Floats, total: Floats) -> Floats:
        """What sweeps have of their own (W, S, q, k), less what makes it sum to zero; its sum is (W, q, k)."""
        return own if self.returned is None else own - self.returned @ total[:, None]

    def _gram(self, rows: Floats, part: slice) -> Floats:
        """Information (W, m + q, m + q) of the samples of one sweep about weights of rows."""
        w = self.whitened
        inverse = self.inverse if self.inverse.shape[1] == 1 else self.inverse[:, part]
        return w.noise.weighted_gram(rows, w.shape, w.steps.part(part), inverse)

    def _apart(self, v: Floats) -> tuple[Floats, Floats]:
        """Weights of all samples (W, m), and of the sweeps (W, S, q)."""
        m = len(self.whitened.rows)
        return v[:, :m], v[:, m:].reshape(len(v), *self.roots.shape[1:3])

    def project(self, innovation: Floats) -> Floats:
        w = self.whitened
        back = w.noise.decorrelate_adjoint(innovation, w.shape, w.steps) * self.inverse
        starts = [part.start for part in self.sweep_functions.parts]
        of_sweeps = (
            np.add.reduceat(back[:, None, :] * self.sweep_functions.samples, starts, axis=2) * self.own_size
        )
        joined = np.swapaxes(of_sweeps, 1, 2).reshape(len(back), -1)
        return np.concatenate([(back @ w.rows.T) * w.size, joined], axis=1)

    def series(self, v: Floats) -> Floats:
        common, own = self._apart(v)
        of_sweeps = np.einsum(
            "wnq,qn->wn", (own * self.own_size)[:, self.sweep_functions.sweep], self.sweep_functions.samples
        )
        return np.asarray(((common * self.whitened.size) @ self.whitened.rows + of_sweeps) * self.inverse)

    def solve(self, right: Floats) -> Floats:
        of_all, of_sweeps = self._apart(right)
        held = of_sweeps[..., None]
        held = np.asarray(np.linalg.solve(np.swapaxes(self.roots, 2, 3), np.linalg.solve(self.roots, held)))
        held = self._less_sum(held, held.sum(axis=1))[..., 0]
        common = self.common.solve(of_all - np.einsum("wsqm,wsq->wm", self.shares, of_sweeps))
        own = held - np.einsum("wsqm,wm->wsq", self.shares, common)
        return np.concatenate([common, own.reshape(len(own), -1)], axis=1)

    def half_log_determinant(self) -> Floats:
        of_sweeps = np.log(np.einsum("wsqq->wsq", self.roots)).sum(axis=(1, 2))
        return np.asarray(
            self.common.half_log_determinant() + of_sweeps + self.half_log_of_sum + self.unusable
        )

    def draw(self, rng: np.random.Generator) -> Floats:
        common = self.common.draw(rng)
        fresh = rng.standard_normal(self.roots.shape[:3])[..., None]
        own = np.asarray(np.linalg.solve(np.swapaxes(self.roots, 2, 3), fresh))
        own = self._less_sum(own, own.sum(axis=1))[..., 0]
        own = own - np.einsum("wsqm,wm->wsq", self.shares, common)
        return np.concatenate([common, own.reshape(len(own), -1)], axis=1)


@dataclass(frozen=True, slots=True, eq=False)
class WeightsGivenResiduals:
    """Weights of basis functions given residuals of independent normal noise, their size integrated out.

    A mixture of normals over a grid of sizes, along the axes on which the information of the residuals is diagonal.

    Attributes
    ----------
    axes : ndarray, shape (m, m)
        Eigenvectors of the information.
    size : ndarray, shape (G,)
        Standard deviation of the weights a priori.
    mean, variance : ndarray, shape (G, m)
        Of the weights along each of them, for each size.
    probability : ndarray, shape (G,)
        Of each size, given the residuals.
    """

    axes: Floats
    size: Floats
    mean: Floats
    variance: Floats
    probability: Floats

    @property
    def degrees_of_freedom(self) -> float:
        """How many weights the residuals determine rather than their prior: expected trace of the smoother."""
        return float(self.probability @ np.sum(1.0 - self.variance / self.size[:, None] ** 2, axis=1))

    @property
    def expected(self) -> Floats:
        """Expected weights, shape (m,)."""
        return np.asarray(self.axes @ (self.probability @ self.mean))

    def draw(self, count: int, rng: np.random.Generator) -> Floats:
        """Weights, shape (count, m)."""
        size = rng.choice(self.probability.size, count, p=self.probability)
        drawn = self.mean[size] + np.sqrt(self.variance[size]) * rng.standard_normal((count, len(self.axes)))
        return np.asarray(drawn @ self.axes.T)


def weights_given_residuals(rows: Floats, residual: Floats, span: float) -> WeightsGivenResiduals:
    """Weights of a discrepancy about a curve that stands.

    Parameters
    ----------
    rows : ndarray, shape (m, n)
        Basis functions at the samples, over the standard deviation of the noise there.
    residual : ndarray, shape (n,)
        What the curve leaves, in the same units.
    span : float
        Of the curve [unit of the channel]; what the size is relative to a priori, as in `size_fact`.
    """
    information, axes = np.linalg.eigh(rows @ rows.T)
    information = np.maximum(information, 0.0)
    pull = axes.T @ (rows @ residual)
    size = MEDIAN_SIZE * span * np.exp(SIGMA_OF_SIZE * SIZES)
    variance = 1.0 / (information + size[:, None] ** -2)
    log_density = 0.5 * np.sum(variance * pull**2 - np.log1p(size[:, None] ** 2 * information), axis=1)
    return WeightsGivenResiduals(axes, size, variance * pull, variance, softmax(log_density - 0.5 * SIZES**2))
