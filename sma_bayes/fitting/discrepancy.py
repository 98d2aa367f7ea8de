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
the likelihood and drawn again, given everything else, where the curve is wanted
(`sma_bayes.fitting.discrepancy_weights`).

What each sweep of a record may have of its own stands beside it (`sma_bayes.fitting.sweep_functions`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import eigh

from sma_bayes.arrays import Floats
from sma_bayes.fitting.sweep_functions import SweepFunctions, seen_changes
from sma_bayes.parameters.space import QUANTITY, ParameterSpec

EIGENFUNCTIONS = 30
"""Eigenfunctions of the smoothing spline that are kept; the next has 1/170 of the first."""
EXTRA_AMPLITUDE_POWER = 1.0
"""Power of their number by which eigenfunctions are larger than those of a cubic smoothing spline: amplitudes fall as
``k**-1`` for ``k**-2``. Intervals of the spline itself are too narrow where the misfit is local."""
NODES = 161
"""Temperatures at which they are tabulated; a natural cubic spline runs between them and goes on straight beyond."""
NEGLIGIBLE_POWER = 1e-12
"""Power of a basis function at the samples, over that of the greatest, from which it is rounding: not orthogonal to
others, it would explain more than there is to be explained wherever a noise is small enough."""
GREATEST_BETWEEN_SAMPLES = 10.0
"""Root mean square of a discrepancy over the range of temperature, over that at the samples, beyond which there is
none: where a curve takes nearly all that a few places tell, the rest says nothing of what lies between them."""
MEDIAN_SIZE, SIGMA_OF_SIZE = 0.01, 1.5
"""Median of the size of a discrepancy a priori, over the span of its curve, and standard deviation of its logarithm."""


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
    sweep_functions : SweepFunctions or None
        What each sweep has of its own beside it; None where sweeps are alike.
    """

    temperature: Floats
    values: Floats
    rows: Floats
    sweep_functions: SweepFunctions | None = None

    @property
    def rows_with_sweeps(self) -> Floats:
        """Basis functions at the samples, then those of the sweep that each is of, shape (m, n) or (m + q, n)."""
        return (
            self.rows
            if self.sweep_functions is None
            else np.concatenate([self.rows, self.sweep_functions.samples])
        )

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
        return DiscrepancyBasis(
            self.temperature, self.values * scale, self.rows * scale[:, None], self.sweep_functions
        )

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


def build_basis(
    temperature: Floats,
    nodes: Floats,
    curve: Floats,
    tangents: Floats,
    tangents_at_nodes: Floats,
    functions: int = EIGENFUNCTIONS,
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
        None where there are too few samples beyond those that the parameters need, or too few places of them.
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
    seen = seen_changes(temperature, nodes, tangents, tangents_at_nodes)
    mix = np.linalg.lstsq(seen.at_samples, at_samples, rcond=1e-10)[0]
    rows = (at_samples - seen.at_samples @ mix).T
    functions_at_nodes = raw - seen.at_nodes @ mix
    power, axes = np.linalg.eigh(rows @ rows.T)
    axes = axes[:, ::-1][:, :m]
    total = float(power[::-1][:m].sum())
    if not total > 1e-12 * float(np.sum(at_samples**2)):
        return None
    root = np.sqrt(temperature.size / total)
    values = functions_at_nodes @ axes * root
    if np.sum(values**2) > GREATEST_BETWEEN_SAMPLES**2 * nodes.size:
        return None
    return DiscrepancyBasis(nodes, values, turned(rows, axes, power[::-1][:m]) * root)


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
        Zero where samples see nothing of a function (`NEGLIGIBLE_POWER`).
    """
    found = np.asarray(axes.T @ rows)
    found[power < NEGLIGIBLE_POWER * power.max()] = 0.0
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
    kept = (NODES - EIGENFUNCTIONS - 2, NODES - 1)
    variance, vectors = eigh(_spline_kernel(u), subset_by_index=kept)
    size = (
        np.sqrt(np.maximum(variance[::-1], 0.0))
        * np.arange(1.0, variance.size + 1.0) ** EXTRA_AMPLITUDE_POWER
    )
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
