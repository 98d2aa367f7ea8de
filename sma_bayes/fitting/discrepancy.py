"""What a curve misses: a smooth function of temperature beside it, kept off the tangents of the curve.

A measurement is ``y = mu(T; theta) + delta(T) + noise``. Were ``delta`` free to be anything smooth, curve and
discrepancy could change places (M. C. Kennedy and A. O'Hagan, J. R. Stat. Soc. B 63 (2001) 425; J. Brynjarsdottir and
A. O'Hagan, Inverse Problems 30 (2014) 114007). Here it is orthogonal, over the measured samples, to the derivatives
of the curve with respect to its parameters (M. Plumlee, J. Am. Stat. Assoc. 112 (2017) 1274): what a change of the
parameters could describe stays with them, and they are those of the curve of the model that is nearest to the truth
(R. Tuo and C. F. J. Wu, Ann. Stat. 43 (2015) 2331).

``delta`` is a priori a smoothing spline, a little rougher than the cubic one (G. Wahba, J. R. Stat. Soc. B 40 (1978)
364): a Gaussian process without a length, whose size alone is a parameter, decided by evidence. It is smooth in a
coordinate that runs evenly through the range of temperature, the response and its slope, since misfit changes where the
curve does, and fastest where it bends. Its leading eigenfunctions, less their share along the tangents, are the basis,

    delta(T) = sum of w_k psi_k(T),    w_k ~ N(0, size**2),

scaled so that ``size`` is the root mean square of ``delta`` over the samples. The weights ``w`` are integrated out of
the likelihood (`marginal_log_density`) and drawn again, given everything else, where the curve is wanted
(`draw_weights`).

Sweeps of one record need not repeat each other: training, a grip that slips, an ambient that drifts. What a sweep has
of its own is a small change of the parameters of its curve, along their tangents, independent from sweep to sweep
(`SweepFunctions`). Its size is a parameter. The curve is that of the mean over sweeps, as sure as so many of them make
it: functions that the curve's own shape does not consist of would leave it as sure as all readings, by what it has and
they have not. A new reading is one of a new sweep.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.linalg import eigh
from scipy.special import softmax

from sma_bayes.arrays import Floats, Ints
from sma_bayes.noise import NoiseModel, Steps
from sma_bayes.noise.base import weighted_products
from sma_bayes.parameters.space import QUANTITY, ParameterSpec

FUNCTIONS = 30
"""Eigenfunctions of the smoothing spline that are kept; the next has 1/170 of the first."""
ROUGHER = 1.0
"""Power of their number by which eigenfunctions are larger than those of a cubic smoothing spline: amplitudes fall as
``k**-1`` for ``k**-2``. Intervals of the spline itself are too narrow where the misfit is local."""
NODES = 161
"""Temperatures at which they are tabulated; a natural cubic spline runs between them and goes on straight beyond."""
UNSEEN = 1e-12
"""Power of a basis function at the samples, over that of the greatest, from which it is rounding: not orthogonal to
others, it would explain more than there is to be explained wherever a noise is small enough."""
GREATEST_INFORMATION = 1e14
"""Information about weights, in units of that of their prior, beyond which a point counts as impossible."""
MOST_SWEEPS = 48
"""Sweeps of a record, at most, that may have something of their own."""
HARDLY_TOLD = 1e-6
"""Part of the greatest of what parameters do to the samples that is rounding."""
SWEEP = "sweep"
"""Input of a part of a record: the segment of the whole one that each sample is from."""
STEPS = 6
"""Steps of Fisher scoring to the likeliest weights under noise that is not normal."""
MEDIAN_SIZE, SIGMA_OF_SIZE = 0.01, 1.5
"""Median of the size of a discrepancy a priori, over the span of its curve, and standard deviation of its logarithm."""
SIZES = np.linspace(-2.5, 2.5, 41)
"""Sizes over which is summed where a curve stands, in standard deviations of the logarithm about its median."""


def size_fact(channel: str, unit: str) -> ParameterSpec:
    """The size of the discrepancy of a channel, a parameter beside those of its noise."""
    return _size_of(
        "discrepancy",
        channel,
        unit,
        f"root mean square of what the curve of {QUANTITY} misses",
        "curves of real specimens miss by 0.3 to 3 % of the range; 90 % between 0.08 and 12 %",
    )


def between_sweeps_fact(channel: str, unit: str) -> ParameterSpec:
    """How much sweeps of a channel differ, a parameter beside the size of its discrepancy."""
    return _size_of(
        "between_sweeps",
        channel,
        unit,
        f"root mean square of what a sweep has of its own in {QUANTITY}",
        "cycles of trained specimens repeat within 0.1 %, first cycles differ by 10 % of the range",
    )


def _size_of(role: str, channel: str, unit: str, meaning: str, source: str) -> ParameterSpec:
    """A size of something beside the curve, relative to the span of the channel a priori."""
    return ParameterSpec(
        f"{channel}_{role}",
        unit,
        meaning,
        role,
        channel,
        positive=True,
        prior={
            "family": "lognormal",
            "median": MEDIAN_SIZE,
            "sigma": SIGMA_OF_SIZE,
            "relative_to": "span(channel)",
            "source": source,
        },
    )


@dataclass(frozen=True, eq=False)
class SweepFunctions:
    """What a sweep may have of its own, in one channel of one record: changes of offset, stroke, midpoint, rate.

    Orthogonal combinations of the tangents of the curve, all of one size.

    Attributes
    ----------
    temperature : ndarray, shape (G,)
        Nodes, ascending.
    values : ndarray, shape (G, q)
        Functions there; natural cubic splines through them.
    samples : ndarray, shape (q, n)
        Functions at the samples of the record, of a mean square over them that is one for all together.
    sweep : ndarray of int, shape (n,)
        Which sweep each sample belongs to, from 0.
    """

    temperature: Floats
    values: Floats
    samples: Floats
    sweep: Ints

    @staticmethod
    def of(
        inputs: Mapping[str, Floats], nodes: Floats, tangents: Floats, tangents_at_nodes: Floats
    ) -> SweepFunctions | None:
        """Those of samples of 2 to `MOST_SWEEPS` sweeps; None of others, and where no parameter does anything.

        Parameters
        ----------
        inputs : mapping of str to ndarray, shape (n,)
            Of the samples.
        nodes : ndarray, shape (G,)
            Temperatures, ascending.
        tangents, tangents_at_nodes : ndarray, shape (n, p) and (G, p)
            Derivatives of the response with respect to the parameters of the curve, at samples and nodes.
        """
        if not 2 <= int(sweeps_of(inputs).max(initial=0)) + 1 <= MOST_SWEEPS:
            return None
        scale = np.abs(tangents).max(axis=0)
        usable = np.isfinite(scale) & (scale > 0.0) & np.isfinite(tangents_at_nodes).all(axis=0)
        _, singular, axes = np.linalg.svd(tangents[:, usable] / scale[usable], full_matrices=False)
        kept = singular > HARDLY_TOLD * singular.max(initial=0.0)
        if not kept.any():
            return None
        turned_by = axes[kept].T / singular[kept] * np.sqrt(len(tangents) / kept.sum())
        return SweepFunctions.tabulated(
            nodes, tangents_at_nodes[:, usable] / scale[usable] @ turned_by, inputs
        )

    @staticmethod
    def tabulated(nodes: Floats, values: Floats, inputs: Mapping[str, Floats]) -> SweepFunctions:
        """Functions from their values (G, q) at nodes (G,), for samples with these inputs."""
        no_samples = SweepFunctions(nodes, values, np.empty((0, 0)), np.empty(0, dtype=np.int64))
        at_samples = np.ascontiguousarray(no_samples.at(inputs["temperature"]).T)
        return SweepFunctions(nodes, values, at_samples, sweeps_of(inputs))

    @cached_property
    def parts(self) -> tuple[slice, ...]:
        """Samples of each sweep, which follow each other."""
        starts = np.flatnonzero(np.diff(self.sweep, prepend=-1))
        return tuple(map(slice, starts.tolist(), [*starts[1:].tolist(), self.sweep.size]))

    def part(self, samples: slice) -> SweepFunctions:
        """Those of the samples of one sweep."""
        sweep = np.zeros(samples.stop - samples.start, dtype=np.int64)
        return SweepFunctions(self.temperature, self.values, self.samples[:, samples], sweep)

    @cached_property
    def rows(self) -> Floats:
        """Functions of each sweep, zero in the others, shape (sweeps q, n)."""
        inside = np.arange(int(self.sweep.max()) + 1)[:, None, None] == self.sweep
        return np.ascontiguousarray((inside * self.samples).reshape(-1, self.sweep.size))

    @cached_property
    def _spline(self) -> CubicSpline:
        return CubicSpline(self.temperature, self.values, bc_type="natural")

    def at(self, temperature: Floats) -> Floats:
        """Functions, shape (..., q), at temperatures of any shape; as at the nearest node beyond these."""
        return np.asarray(self._spline(np.clip(temperature, self.temperature[0], self.temperature[-1])))

    def of_new_sweep(self, rng: np.random.Generator, size: Floats, temperature: Floats) -> Floats:
        """What new sweeps have of their own, of sizes (W,), at temperatures (g,) or (W, g); shape (W, g).

        Each reading is of another sweep.
        """
        deviations = np.sqrt(np.sum(self.at(temperature) ** 2, axis=-1))
        drawn = size[:, None] * deviations
        return np.asarray(drawn * rng.standard_normal(drawn.shape))


def sweeps_of(inputs: Mapping[str, Floats]) -> Ints:
    """Which sweep each sample belongs to, shape (n,), from 0 without gaps."""
    number = inputs[SWEEP] if SWEEP in inputs else inputs["segment"]
    return np.asarray(np.unique(number, return_inverse=True)[1], dtype=np.int64).reshape(-1)


@dataclass(frozen=True, eq=False)
class DiscrepancyBasis:
    """Basis of the discrepancy of one channel of one record.

    Attributes
    ----------
    temperature : ndarray, shape (G,)
        Nodes, ascending.
    values : ndarray, shape (G, m)
        Basis functions there; natural cubic splines through them.
    rows : ndarray, shape (m, n)
        Basis functions at the samples of the record, orthogonal to each other; zero where the samples see nothing of
        one, as of what happens in a gap between them.
    own : SweepFunctions or None
        What each sweep has of its own beside it; None where sweeps are alike.
    """

    temperature: Floats
    values: Floats
    rows: Floats
    own: SweepFunctions | None = None

    @property
    def all_rows(self) -> Floats:
        """Basis functions at the samples, then those of the sweep that each is of, shape (m, n) or (m + q, n)."""
        return self.rows if self.own is None else np.concatenate([self.rows, self.own.samples])

    @staticmethod
    def tabulated(nodes: Floats, values: Floats, temperature: Floats) -> DiscrepancyBasis:
        """Basis from its values (G, m) at nodes (G,), for samples at temperatures (n,)."""
        at_samples = DiscrepancyBasis(nodes, values, np.empty((values.shape[1], 0))).at(temperature)
        return DiscrepancyBasis(nodes, values, np.ascontiguousarray(at_samples.T))

    def smoother(self, power: float) -> DiscrepancyBasis:
        """The same functions, each smaller by a power of its number, of the same mean square over the samples."""
        square = np.sum(self.rows**2, axis=1)
        scale = square ** (0.5 * power)
        scale = scale * np.sqrt(square.sum() / np.sum(scale**2 * square))
        return DiscrepancyBasis(self.temperature, self.values * scale, self.rows * scale[:, None], self.own)

    @property
    def count(self) -> int:
        """Number m of basis functions."""
        return int(self.values.shape[1])

    @cached_property
    def _spline(self) -> CubicSpline:
        return CubicSpline(self.temperature, self.values, bc_type="natural")

    @cached_property
    def _derivative(self) -> CubicSpline:
        return self._spline.derivative()

    def at(self, temperature: Floats) -> Floats:
        """Basis functions, shape (..., m), at temperatures of any shape; straight beyond the nodes."""
        inside = np.clip(temperature, self.temperature[0], self.temperature[-1])
        beyond = (np.asarray(temperature) - inside)[..., None]
        value = np.asarray(self._spline(inside))
        return np.asarray(value + beyond * self._derivative(inside)) if np.any(beyond) else value

    def slope(self, temperature: Floats) -> Floats:
        """Their derivatives with respect to temperature, shape (..., m)."""
        return np.asarray(self._derivative(np.clip(temperature, self.temperature[0], self.temperature[-1])))

    def function(self, weights: Floats, temperature: Floats) -> Floats:
        """Discrepancy (W, g) for weights (W, m) at temperatures (g,) or (W, g)."""
        basis = self.at(temperature)
        return np.asarray(weights @ basis.T if basis.ndim == 2 else np.einsum("wgm,wm->wg", basis, weights))

    def function_slope(self, weights: Floats, temperature: Floats) -> Floats:
        """Its derivative with respect to temperature, shape (W, g)."""
        basis = self.slope(temperature)
        return np.asarray(weights @ basis.T if basis.ndim == 2 else np.einsum("wgm,wm->wg", basis, weights))


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


def build_basis(
    temperature: Floats,
    nodes: Floats,
    curve: Floats,
    tangents: Floats,
    tangents_at_nodes: Floats,
    functions: int = FUNCTIONS,
    *,
    with_response: bool = False,
) -> DiscrepancyBasis | None:
    """Basis for the samples of one channel of one record.

    Parameters
    ----------
    temperature : ndarray, shape (n,)
        Of the samples.
    nodes : ndarray, shape (G,)
        Temperatures, ascending, at which the basis is tabulated, from `nodes_of`.
    curve : ndarray, shape (G,)
        Response of the model there.
    tangents, tangents_at_nodes : ndarray, shape (n, p) and (G, p)
        Derivatives of the response with respect to the parameters that are fitted, at samples and nodes.
    functions : int
        Number m of basis functions, at most.
    with_response : bool
        Whether they change only where the response does: their coordinate runs evenly through it alone.

    Returns
    -------
    DiscrepancyBasis or None
        None where there are too few samples beyond those that the parameters need.
    """
    room = np.unique(temperature).size - tangents.shape[1]
    m = min(functions, room // 2)  # as many samples again tell the noise apart from what is smooth
    if m < 1:
        return None
    even, leading = _eigenfunctions()
    raw = CubicSpline(even, leading[:, : m + 2], bc_type="natural")(
        _passed(curve) if with_response else _coordinate(nodes, curve)
    )
    at_samples = np.asarray(CubicSpline(nodes, raw, bc_type="natural")(temperature))
    scale = np.abs(tangents).max(axis=0)
    usable = np.isfinite(scale) & (scale > 0.0)
    q = tangents[:, usable] / scale[usable]
    mix = np.linalg.lstsq(q, at_samples, rcond=1e-10)[0]
    rows = (at_samples - q @ mix).T
    functions_at_nodes = raw - (tangents_at_nodes[:, usable] / scale[usable]) @ mix
    power, axes = np.linalg.eigh(rows @ rows.T)
    axes = axes[:, ::-1][:, :m]
    total = float(power[::-1][:m].sum())
    if not total > 1e-12 * float(np.sum(at_samples**2)):
        return None
    root = np.sqrt(temperature.size / total)
    return DiscrepancyBasis(
        nodes, functions_at_nodes @ axes * root, turned(rows, axes, power[::-1][:m]) * root
    )


def turned(rows: Floats, axes: Floats, power: Floats) -> Floats:
    """Functions at samples along eigenvectors of their Gram matrix, so that they are orthogonal there.

    Parameters
    ----------
    rows : ndarray, shape (m, n)
    axes : ndarray, shape (m, k)
        Eigenvectors of ``rows @ rows.T``, that of the greatest eigenvalue among them.
    power : ndarray, shape (k,)
        Their eigenvalues.

    Returns
    -------
    ndarray, shape (k, n)
        Zero where samples see nothing of a function (`UNSEEN`).
    """
    found = np.asarray(axes.T @ rows)
    found[power < UNSEEN * power.max()] = 0.0
    return found


def nodes_of(low: float, high: float, temperature: Floats, curve: Floats) -> Floats:
    """Temperatures (G,) that lie evenly in the coordinate of the discrepancy.

    Parameters
    ----------
    low, high : float
        Ends of the range.
    temperature, curve : ndarray, shape (k,)
        A fine grid between them, and the response of the model there.
    """
    u = _coordinate(temperature, curve)
    nodes = np.interp(np.linspace(0.0, 1.0, NODES), u, temperature)
    nodes[0], nodes[-1] = low, high
    return np.asarray(np.unique(nodes))


def _coordinate(temperature: Floats, curve: Floats) -> Floats:
    """Coordinate from 0 to 1: the mean of those that run evenly through temperatures, response and slope."""
    paths = [(temperature - temperature[0]) / (temperature[-1] - temperature[0])]
    for series in (curve, np.gradient(curve, temperature)):
        passed = _passed(series)
        if passed[-1] == 1.0:
            paths.append(passed)
    return np.asarray(np.mean(paths, axis=0))


def _passed(series: Floats) -> Floats:
    """Share of all changes of a series that is behind each of its points; zero where it has none."""
    passed = np.concatenate([np.zeros(1), np.cumsum(np.abs(np.diff(series)))])
    return passed / passed[-1] if np.isfinite(passed[-1]) and passed[-1] > 0.0 else np.zeros(series.size)


@cache
def _eigenfunctions() -> tuple[Floats, Floats]:
    """Coordinates (G,) and the leading eigenfunctions (G, k) there, each times the root of its variance."""
    u = np.linspace(0.0, 1.0, NODES)
    kept = (NODES - FUNCTIONS - 2, NODES - 1)
    variance, vectors = eigh(_spline_kernel(u), subset_by_index=kept)
    size = np.sqrt(np.maximum(variance[::-1], 0.0)) * np.arange(1.0, variance.size + 1.0) ** ROUGHER
    return u, np.asarray(vectors[:, ::-1] * size)


def _spline_kernel(u: Floats) -> Floats:
    """Covariance (G, G) of a cubic smoothing spline on [0, 1], constant and straight parts included.

    With the Bernoulli polynomials ``k1 = u - 1/2``, ``k2 = (k1**2 - 1/12)/2`` and ``k4``, the covariance of what is
    neither constant nor straight is ``k2(u) k2(v) - k4(|u - v|)`` (C. Gu, Smoothing Spline ANOVA Models, 2013,
    section 2.3); it and the straight part are scaled to a mean variance of one.
    """
    k1 = u - 0.5
    k2 = 0.5 * (k1 * k1 - 1.0 / 12.0)
    apart = np.abs(u[:, None] - u) - 0.5
    k4 = (apart**4 - 0.5 * apart**2 + 7.0 / 240.0) / 24.0
    bent = np.outer(k2, k2) - k4
    straight = np.outer(k1, k1)
    return np.asarray(1.0 + straight / np.mean(k1 * k1) + bent / np.mean(np.diag(bent)))


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
    own : SweepFunctions or None
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
    own: SweepFunctions | None = None
    between: Floats | None = None

    def _system(self) -> _Weights:
        """Normal equations of the weights in units of their prior."""
        noise, shape = self.noise, self.shape
        a = noise.decorrelate(self.e, shape, self.steps)
        count = noise.location_information(shape)
        inverse = 1.0 / self.scale
        even = self.scale.shape[1] == 1
        if self.own is not None:
            return _Nested(self, a, inverse)
        if even and not noise.autocorrelated:
            power = np.einsum("mn,mn->m", self.rows, self.rows)
            return _Apart(self, a, inverse, count[:, None] * (self.size * inverse) ** 2 * power)
        if even:
            gram = noise.weighted_gram(self.rows, shape, self.steps) * inverse[:, :, None] ** 2
        elif not noise.autocorrelated:
            gram = count[:, None, None] * weighted_products(inverse * inverse, self.rows)
        else:
            white = noise.decorrelate(self.rows * inverse[:, None, :], shape[:, None, :], self.steps)
            gram = count[:, None, None] * (white @ np.swapaxes(white, 1, 2))
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
        weights = self._system()
        drawn = self._likeliest(weights) + weights.draw(rng)
        return np.asarray(self.size * drawn[:, : len(self.rows)])


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


class _Nested(_Weights):
    """Weights of all samples, and of each sweep alone: those of one sweep know of another's through the first alone.

    Weights of sweeps are eliminated sweep by sweep, so that what this costs grows with the number of samples. With
    `D`, `B` and `C` the parts of ``1 + H`` of one sweep, between sweep and all, and of all, what is left is
    ``C - sum of B' D**-1 B``.

    Parameters
    ----------
    whitened : Whitened
        With what sweeps have of their own.
    """

    def __init__(self, whitened: Whitened, a: Floats, inverse: Floats) -> None:
        super().__init__(whitened, a, inverse)
        own, between = whitened.own, whitened.between
        assert own is not None
        assert between is not None
        self.own = own
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
        self.common = _Coupled(whitened, a, inverse, total)
        self.unusable = np.where(usable, 0.0, np.nan)

    def _gram(self, rows: Floats, part: slice) -> Floats:
        """Information (W, m + q, m + q) of the samples of one sweep about weights of rows."""
        w = self.whitened
        noise, shape = w.noise, w.shape
        steps = w.steps.part(part)
        if self.inverse.shape[1] == 1:
            return np.asarray(noise.weighted_gram(rows, shape, steps) * self.inverse[:, :, None] ** 2)
        inverse, count = self.inverse[:, part], noise.location_information(shape)[:, None, None]
        if not noise.autocorrelated:
            return np.asarray(count * weighted_products(inverse * inverse, rows))
        white = noise.decorrelate(rows * inverse[:, None, :], shape[:, None, :], steps)
        return np.asarray(count * (white @ np.swapaxes(white, 1, 2)))

    def _apart(self, v: Floats) -> tuple[Floats, Floats]:
        """Weights of all samples (W, m), and of the sweeps (W, S, q)."""
        m = len(self.whitened.rows)
        return v[:, :m], v[:, m:].reshape(len(v), *self.roots.shape[1:3])

    def project(self, innovation: Floats) -> Floats:
        w = self.whitened
        back = w.noise.decorrelate_adjoint(innovation, w.shape, w.steps) * self.inverse
        starts = [part.start for part in self.own.parts]
        of_sweeps = np.add.reduceat(back[:, None, :] * self.own.samples, starts, axis=2) * self.own_size
        joined = np.swapaxes(of_sweeps, 1, 2).reshape(len(back), -1)
        return np.concatenate([(back @ w.rows.T) * w.size, joined], axis=1)

    def series(self, v: Floats) -> Floats:
        common, own = self._apart(v)
        of_sweeps = np.einsum("wnq,qn->wn", (own * self.own_size)[:, self.own.sweep], self.own.samples)
        return np.asarray(((common * self.whitened.size) @ self.whitened.rows + of_sweeps) * self.inverse)

    def solve(self, right: Floats) -> Floats:
        of_all, of_sweeps = self._apart(right)
        held = of_sweeps[..., None]
        held = np.linalg.solve(np.swapaxes(self.roots, 2, 3), np.linalg.solve(self.roots, held))[..., 0]
        common = self.common.solve(of_all - np.einsum("wsqm,wsq->wm", self.shares, of_sweeps))
        own = held - np.einsum("wsqm,wm->wsq", self.shares, common)
        return np.concatenate([common, own.reshape(len(own), -1)], axis=1)

    def half_log_determinant(self) -> Floats:
        of_sweeps = np.log(np.einsum("wsqq->wsq", self.roots)).sum(axis=(1, 2))
        return np.asarray(self.common.half_log_determinant() + of_sweeps + self.unusable)

    def draw(self, rng: np.random.Generator) -> Floats:
        common = self.common.draw(rng)
        fresh = rng.standard_normal(self.roots.shape[:3])[..., None]
        own = np.linalg.solve(np.swapaxes(self.roots, 2, 3), fresh)[..., 0]
        own = own - np.einsum("wsqm,wm->wsq", self.shares, common)
        return np.concatenate([common, own.reshape(len(own), -1)], axis=1)
