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
from sma_bayes.noise.information import Information

GREATEST_INFORMATION = 1e14
"""Information about weights, in units of that of their prior, beyond which a point counts as impossible."""
MAX_STEPS = 40
"""Steps to the likeliest weights under noise that is not normal, at most."""
TOLERANCE = 1e-3
"""Gain in log density that the next step promises, to first order, below which weights count as the likeliest."""
LEAST_SHARE_LEFT = 1e-12
"""Least share of an innovation that the weights leave, beyond rounding."""
LN_SIZE_GRID = np.linspace(-2.5, 2.5, 41)
"""Sizes over which is summed where a curve stands, in standard deviations of the logarithm about its median."""


@dataclass(frozen=True, slots=True, eq=False)
class NormalWeights:
    """Weights of a discrepancy given measurements and everything else, where the noise is normal.

    Attributes
    ----------
    mean : ndarray, shape (W, m)
        [unit of the channel]
    root : ndarray, shape (W, m, m)
        Their covariance is ``root root'`` [unit of the channel].
    """

    mean: Floats
    root: Floats


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
        gram = noise.information(shape, self.steps, inverse).gram(self.rows)
        return _Coupled(self, a, inverse, gram * (self.size[:, :, None] * self.size[:, None, :]))

    def _likeliest(self, weights: _Weights) -> Floats:
        """Likeliest weights (W, m) in units of their prior.

        Where the noise is not normal by conjugate gradients, the expected information their metric: the score of heavy
        tails changes sign of slope, and Fisher's own steps go to and fro where many samples lie close to the curve.
        """
        v = weights.solve(weights.project(weights.a))
        if self.noise.is_gaussian:
            return v
        noise, shape, steps = self.noise, self.shape, self.steps
        left = noise.decorrelate(self.e - weights.series(v), shape, steps)
        direction, before, gain_before = np.zeros_like(v), np.zeros_like(v), np.full(len(v), np.inf)
        for _ in range(MAX_STEPS):
            weight = noise.weight(left, shape)
            gradient = weights.project(weight * left) - v
            step = weights.solve(gradient)
            gain = _dot(gradient, step)
            going = gain > TOLERANCE
            if not going.any():
                break
            turned = np.maximum(_dot(gradient, step - before) / gain_before, 0.0)
            turned = np.where(_dot(gradient, direction) * turned > -gain, turned, 0.0)  # not downhill
            direction = np.where(going[:, None], step + turned[:, None] * direction, 0.0)
            moved = noise.decorrelate(weights.series(direction), shape, steps)
            length = self._length(left, weight, moved, v, direction)[:, None]
            v, left = v + length * direction, left - length * moved
            before, gain_before = step, np.where(going, gain, np.inf)
        return v

    def _length(self, left: Floats, weight: Floats, moved: Floats, v: Floats, direction: Floats) -> Floats:
        """How far (W,) to go from weights `v` along `direction`, by which innovations `left` become less by `moved`.

        To the top of the parabola that touches the log density and, where the noise is a mixture of normals, lies
        nowhere above it; from there once more, or back by the rule of false position where that was too far.
        """
        own = _dot(direction, direction)
        at_first = _dot(weight * left, moved) - _dot(v, direction)
        length = at_first / _curvature(weight, moved, own)
        left = left - length[:, None] * moved
        weight = self.noise.weight(left, self.shape)
        slope = _dot(weight * left, moved) - _dot(v, direction) - length * own
        back = length * at_first / np.where(slope < 0.0, at_first - slope, 1.0)
        return np.where(slope < 0.0, back, length + slope / _curvature(weight, moved, own))

    def marginal_log_density(self) -> Floats:
        """Log density (W,) of the residuals with the weights integrated out; exact where the noise is normal.

        Otherwise by Laplace's method with the expected information, at the likeliest weights.
        """
        weights = self._system()
        return self._density(weights, self._likeliest(weights))

    def marginal_with_likeliest_series(self) -> tuple[Floats, Floats]:
        """`marginal_log_density` and `likeliest_series`, of one solution."""
        weights = self._system()
        v = self._likeliest(weights)
        return self._density(weights, v), weights.series(v)

    def _density(self, weights: _Weights, v: Floats) -> Floats:
        """Log density (W,) with the weights integrated out about the likeliest (W, m)."""
        noise, shape, steps = self.noise, self.shape, self.steps
        if noise.is_gaussian:
            density = noise.total_log_density(self.e, shape, steps)
            density = density + 0.5 * _dot(v, weights.project(weights.a))
        else:
            density = noise.total_log_density(self.e - weights.series(v), shape, steps)
            density = density - 0.5 * _dot(v, v)
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

    def normal_weights(self) -> NormalWeights:
        """The weights of the rows given everything else; the noise must be normal."""
        weights, m = self._system(), len(self.rows)
        mean = self.size * self._likeliest(weights)[:, :m]
        return NormalWeights(mean, self.size[:, :, None] * weights.covariance_root())

    def predictive_log_density(self, weights: NormalWeights) -> Floats:
        """Log density (W, n) of each sample, weights integrated out that other samples have told.

        Given the weights innovations are ``a ~ N(0, 1)``; with them unknown they have the variance ``1 + q``, as far as
        the rows move each. What sweeps have of their own must be no part of them.
        """
        density, a, q = self._about(weights)
        return density + 0.5 * (a * a * q / (1.0 + q) - np.log1p(q))

    def left_out_log_density(self) -> Floats:
        """Log density (W, n) of each sample given all others, the weights integrated out.

        By the leverage h of each innovation, its share in what the likeliest weights say of it: left out it is
        predicted with the error ``a/(1 - h)`` and the variance ``1/(1 - h)`` [1]_.

        References
        ----------
        .. [1] S. Sundararajan, S. S. Keerthi, Neural Computation 13 (2001) 1103, doi 10.1162/08997660151134343.
        """
        density, a, h = self._about(self.normal_weights())
        left = np.maximum(1.0 - h, LEAST_SHARE_LEFT)
        return density + 0.5 * (a * a - a * a / left + np.log(left))

    def _about(self, weights: NormalWeights) -> tuple[Floats, Floats, Floats]:
        """Log density, innovations and variance of these by the weights, (W, n) each, at the mean of weights."""
        inverse = 1.0 / self.scale
        e = self.e - (weights.mean @ self.rows) * inverse
        white = [self.noise.decorrelate(row * inverse, self.shape, self.steps) for row in self.rows]
        spread = np.stack([np.broadcast_to(w, e.shape) for w in white], axis=-1) @ weights.root
        density = self.noise.log_density(e, self.shape, self.steps) - np.log(self.scale)
        return (
            density,
            self.noise.decorrelate(e, self.shape, self.steps),
            np.einsum("wnm,wnm->wn", spread, spread),
        )

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


def _curvature(weight: Floats, moved: Floats, own: Floats) -> Floats:
    """Curvature (W,) along what moves innovations by `moved`; 1 where nothing does."""
    found = _dot(np.maximum(weight, 0.0) * moved, moved) + own
    return np.asarray(np.where(found > 0.0, found, 1.0))


def _dot(a: Floats, b: Floats) -> Floats:
    """Inner products (W,) of the rows of two arrays."""
    return np.asarray(np.einsum("wm,wm->w", a, b))


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

    @abstractmethod
    def covariance_root(self) -> Floats:
        """R (W, m, m) with the covariance ``R R'`` of the weights that all samples share."""
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

    def covariance_root(self) -> Floats:
        return np.asarray(np.eye(self.precision.shape[1]) / np.sqrt(self.precision)[:, :, None])


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

    @cached_property
    def _inverse_root(self) -> Floats:
        return np.asarray(np.linalg.inv(self.root))

    @cached_property
    def _covariance(self) -> Floats:
        """``(1 + H)**-1``, worth its time where a step after the other asks for it."""
        return np.asarray(np.swapaxes(self._inverse_root, 1, 2) @ self._inverse_root)

    def solve(self, right: Floats) -> Floats:
        if not self.whitened.noise.is_gaussian:
            return np.asarray((self._covariance @ right[..., None])[..., 0])
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

    def covariance_root(self) -> Floats:
        return np.asarray(np.swapaxes(self._inverse_root, 1, 2) + self.unusable[:, None, None])


class WithoutSweeps:
    """Normal equations from which the weights of what sweeps have of their own are eliminated, sweep by sweep.

    Those of one sweep know of another's through the weights of all samples alone, so that what this costs grows with
    the number of samples. With ``1 + D``, `B` and `C` the parts of one sweep, between it and all, and of all samples,
    what is left is ``C - sum of B' (1 + D)**-1 B``. Where weights of sweeps sum to zero, their covariance
    ``V = (1 + D)**-1`` between two sweeps is ``-V A**-1 V`` and that of one ``V - V A**-1 V``, ``A = sum of V``.

    Parameters
    ----------
    information : Information
        Of the samples, for W values of the noise.
    rows : ndarray, shape (m, n)
        Series whose weights stay.
    own : SweepFunctions
        What sweeps have of their own: q functions of each of S sweeps.
    size : ndarray, shape (W,)
        Standard deviation of their weights a priori.

    Attributes
    ----------
    left : ndarray, shape (W, m, m)
        Information about the weights that stay.
    inverse_root : ndarray, shape (W, S, q, q)
        Inverses of the Cholesky factors of ``1 + D``.
    shares : ndarray, shape (W, S, q, m)
        Covariance of the sweeps' weights times all `B`.
    half_log_determinant : ndarray, shape (W,)
        Of the precision of all sweeps, relative to the prior's; not a number where it can't be factored.
    """

    def __init__(self, information: Information, rows: Floats, own: SweepFunctions, size: Floats) -> None:
        q, m, sweeps = len(own.samples), len(rows), len(own.parts)
        scale = size[:, None, None, None]
        every = np.concatenate([own.samples, rows])
        parts = np.stack([information.products(own.samples, every, part) for part in own.parts], axis=1)
        blocks = (parts[..., :q] * (scale * scale)).reshape(-1, q, q)
        root, usable = safe_cholesky(blocks)
        usable = usable.reshape(-1, sweeps)
        across = np.where(usable[..., None, None], parts[..., q:] * scale, 0.0)
        self.inverse_root = np.linalg.inv(root).reshape(-1, sweeps, q, q)
        half = self.inverse_root @ across
        self.shares = np.swapaxes(self.inverse_root, 2, 3) @ half
        taken = half.reshape(len(half), sweeps * q, m)
        self.left = information.gram(rows) - np.swapaxes(taken, 1, 2) @ taken
        log_determinant = np.log(np.einsum("wqq->wq", root)).reshape(-1, sweeps * q).sum(axis=1)
        self.half_log_determinant = np.where(usable.all(axis=1), log_determinant, np.nan)
        self._returned: Floats | None = None
        if own.sum_to_zero:
            covariance = np.swapaxes(self.inverse_root, 2, 3) @ self.inverse_root
            of_sum = covariance.sum(axis=1)
            self._returned = np.swapaxes(np.linalg.solve(of_sum[:, None], covariance), 2, 3)
            self.half_log_determinant += 0.5 * np.linalg.slogdet(of_sum / sweeps)[1]
            sum_of_shares = self.shares.sum(axis=1)
            self.left += np.swapaxes(sum_of_shares, 1, 2) @ np.linalg.solve(of_sum, sum_of_shares)
            self.shares = self._less_sum(self.shares)

    def solve(self, right: Floats) -> Floats:
        """Covariance of the sweeps' weights times columns (W, S, q, k)."""
        return self._less_sum(np.swapaxes(self.inverse_root, 2, 3) @ (self.inverse_root @ right))

    def draw(self, rng: np.random.Generator) -> Floats:
        """Weights (W, S, q) of sweeps about their likeliest ones, given all others."""
        fresh = rng.standard_normal(self.inverse_root.shape[:3])[..., None]
        return self._less_sum(np.swapaxes(self.inverse_root, 2, 3) @ fresh)[..., 0]

    def _less_sum(self, own: Floats) -> Floats:
        """Columns (W, S, q, k), less what makes them sum to zero."""
        return own if self._returned is None else own - self._returned @ own.sum(axis=1)[:, None]


class _WithSweeps(_Weights):
    """Weights of all samples, and of each sweep alone: see `WithoutSweeps`.

    Parameters
    ----------
    whitened : Whitened
        With what sweeps have of their own.
    """

    def __init__(self, whitened: Whitened, a: Floats, inverse: Floats) -> None:
        super().__init__(whitened, a, inverse)
        own, between, size = whitened.sweep_functions, whitened.between, whitened.size
        assert own is not None
        assert between is not None
        self.sweep_functions = own
        self.own_size = between[:, None, None]
        information = whitened.noise.information(whitened.shape, whitened.steps, inverse)
        self.sweeps = WithoutSweeps(information, whitened.rows, own, between)
        self.shares = self.sweeps.shares * size[:, None, None, :]
        self.common = _Coupled(whitened, a, inverse, self.sweeps.left * (size[:, :, None] * size[:, None, :]))

    def _apart(self, v: Floats) -> tuple[Floats, Floats]:
        """Weights of all samples (W, m), and of the sweeps (W, S, q)."""
        m = len(self.whitened.rows)
        return v[:, :m], v[:, m:].reshape(len(v), *self.shares.shape[1:3])

    def project(self, innovation: Floats) -> Floats:
        w = self.whitened
        back = w.noise.decorrelate_adjoint(innovation, w.shape, w.steps) * self.inverse
        samples = self.sweep_functions.samples.T
        of_sweeps = np.stack([back[:, part] @ samples[part] for part in self.sweep_functions.parts], axis=1)
        joined = (of_sweeps * self.own_size).reshape(len(back), -1)
        return np.concatenate([(back @ w.rows.T) * w.size, joined], axis=1)

    def series(self, v: Floats) -> Floats:
        common, own = self._apart(v)
        found, samples = (common * self.whitened.size) @ self.whitened.rows, self.sweep_functions.samples
        own = own * self.own_size
        for sweep, part in enumerate(self.sweep_functions.parts):
            found[:, part] += own[:, sweep] @ samples[:, part]
        return np.asarray(found * self.inverse)

    def solve(self, right: Floats) -> Floats:
        of_all, of_sweeps = self._apart(right)
        held = self.sweeps.solve(of_sweeps[..., None])[..., 0]
        shares = self.shares.reshape(len(right), of_sweeps[0].size, of_all.shape[1])
        pull = (np.swapaxes(shares, 1, 2) @ of_sweeps.reshape(len(right), -1, 1))[..., 0]
        common = self.common.solve(of_all - pull)
        own = held.reshape(len(right), -1) - (shares @ common[..., None])[..., 0]
        return np.concatenate([common, own], axis=1)

    def half_log_determinant(self) -> Floats:
        return np.asarray(self.common.half_log_determinant() + self.sweeps.half_log_determinant)

    def draw(self, rng: np.random.Generator) -> Floats:
        common = self.common.draw(rng)
        own = self.sweeps.draw(rng)
        own = own - np.einsum("wsqm,wm->wsq", self.shares, common)
        return np.concatenate([common, own.reshape(len(own), -1)], axis=1)

    def covariance_root(self) -> Floats:
        return self.common.covariance_root()


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
    size = MEDIAN_SIZE * span * np.exp(SIGMA_OF_SIZE * LN_SIZE_GRID)
    variance = 1.0 / (information + size[:, None] ** -2)
    log_density = 0.5 * np.sum(variance * pull**2 - np.log1p(size[:, None] ** 2 * information), axis=1)
    return WeightsGivenResiduals(
        axes, size, variance * pull, variance, softmax(log_density - 0.5 * LN_SIZE_GRID**2)
    )
