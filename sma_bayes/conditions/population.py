"""A hierarchical model over conditions: what their curves have in common, learnt from the posterior of each.

In the coordinates phi (see `coordinates`) the curve of condition c, whose settings are x_c, is

    phi_c = x_c B + tau e_c,    e_c ~ N(0, I)

with level and slopes B (Q, P) and one scatter tau_p a coordinate. What the measurements of a condition say is its
posterior over its prior, l_c = posterior_c/prior_c. A Gaussian l_c makes B and phi_c integrate out in closed form, and
only tau is sampled. Then each draw of (B, tau) is weighted by

    w = product over c of mean of [likelihood_c(phi, nu) prior(nu)] / [Gaussian l_c(phi) q(nu | phi)]

over a few phi drawn from the Gaussian answer for condition c and noise parameters nu drawn from q, their posterior
given phi: the mean estimates without bias by how much the Gaussian form misjudged the condition. That makes the answer
exact but for the number of draws. Pareto exponents, of the ratios of each condition and of w, tell whether that can be
relied on; else the Gaussian answer stands, and is called so.

Priors: the level is normal about the mean of the records' own priors, the change over the tested range of a setting
about zero, both with the standard deviation of a record's own prior. The scatter is

    tau_p = g y_p h_p,    ln g ~ N(ln `scatter`, COMMON**2),    ln h_p ~ N(0, OWN**2)

with y_p what such a curve has by itself: 1 for logarithms of spans and rates, 4.4/rate (from 10 to 90 % of the
transformation) for midpoints, the span for levels. The common g lets few conditions tell whether they scatter by a
hundredth or by half, since every coordinate has a say in it.

References
----------
C. Andrieu, G. O. Roberts, "The pseudo-marginal approach for efficient Monte Carlo computations", Annals of Statistics
37 (2009) 697, doi 10.1214/07-AOS574: estimates without bias in place of an integral.

D. Lunn, J. Barrett, M. Sweeting, S. Thompson, "Fully Bayesian hierarchical modelling in two stages, with application to
meta-analysis", Journal of the Royal Statistical Society C 62 (2013) 551, doi 10.1111/rssc.12007: posteriors of the
parts as input of the whole.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from sma_bayes.conditions.coordinates import Coordinates, coordinates_for
from sma_bayes.conditions.design import Design
from sma_bayes.conditions.draws import RecordDraws
from sma_bayes.inference.importance import WeightedDraws, importance_draws
from sma_bayes.inference.pareto import RELIABLE, smoothed_weights
from sma_bayes.quantities import Floats

Places = NDArray[np.intp]
SCATTER: Final = 0.1
"""Median of the scatter before the data, as a share of the curve's own yardsticks (`Coordinates.yardsticks`)."""
COMMON: Final = 1.0
OWN: Final = 1.0
"""Standard deviations of the logarithm of the scatter: what all coordinates have in common, and what each has alone."""
DRAWS: Final = 2000
"""Draws of level, slopes and scatter."""
INSIDE: Final = 6
"""Points at which the likelihood of each condition is evaluated for each of them."""
WIDER: Final = 1.15
"""By how much these points are drawn from wider than the Gaussian answer, so that they reach the tails."""
SHARPEST: Final = 1e-10
"""Least variance of a posterior over that of its prior: parameters that are held fixed have none."""
CHUNK: Final = 1 << 20
"""Numbers in an array of intermediate results, about."""
FEW_SPARE: Final = 3
"""Conditions beyond those that the slopes need, below which the scatter is called led by its prior."""


@dataclass(frozen=True, slots=True, eq=False)
class Summary:
    """What the measurements of one condition say, as a Gaussian ``exp(pull phi - phi precision phi/2)``.

    Attributes
    ----------
    precision : ndarray, shape (P, P)
        Never negative; zero where nothing is added to the prior.
    pull : ndarray, shape (P,)
    """

    precision: Floats
    pull: Floats


def summary_of(phi: Floats, prior_mean: Floats, prior_covariance: Floats) -> Summary:
    """Divide a Gaussian posterior by a Gaussian prior.

    Parameters
    ----------
    phi : ndarray, shape (S, P)
        Posterior draws.
    prior_mean : ndarray, shape (P,)
    prior_covariance : ndarray, shape (P, P)

    Notes
    -----
    Directions in which the draws are as wide as the prior or wider carry no information: there the precision is zero.
    """
    root = np.linalg.cholesky(prior_covariance)
    whitened = np.linalg.solve(root, (phi - prior_mean).T)  # prior N(0, I)
    mean, covariance = whitened.mean(axis=1), np.atleast_2d(np.cov(whitened))
    variance, vector = np.linalg.eigh(covariance)
    variance = np.maximum(variance, SHARPEST)
    gained = np.maximum(1.0 / variance - 1.0, 0.0)
    pull = np.where(gained > 0.0, (vector.T @ mean) / variance, 0.0)
    back = np.linalg.solve(root.T, vector)
    precision = (back * gained) @ back.T
    return Summary(precision, back @ pull + precision @ prior_mean)


@dataclass(frozen=True, eq=False)
class ScatterDensity:
    """Density of ``ln tau`` (P,), everything else integrated out.

    Attributes
    ----------
    matrix : ndarray, shape (C, Q)
        Regressors.
    summaries : tuple of Summary
        One for each condition.
    centre : ndarray, shape (P,)
        Mean of the prior of the level.
    width : ndarray, shape (P,)
        Standard deviation of the prior of level and slopes.
    scale : ndarray, shape (P,)
        Median of the prior of tau.
    labels : tuple of str
    """

    matrix: Floats
    summaries: tuple[Summary, ...]
    centre: Floats
    width: Floats
    scale: Floats
    labels: tuple[str, ...]
    precision: Floats = field(init=False, repr=False)
    pull: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "precision", np.stack([s.precision for s in self.summaries]))
        object.__setattr__(self, "pull", np.stack([s.pull for s in self.summaries]))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coordinates that are sampled."""
        return tuple(f"ln tau[{label}]" for label in self.labels)

    def draw_prior(self, rng: np.random.Generator, size: int) -> Floats:
        """Draws (size, P) of ``ln tau`` from its prior."""
        common, own = rng.standard_normal((size, 1)), rng.standard_normal((size, self.scale.size))
        return np.asarray(np.log(self.scale) + COMMON * common + OWN * own)

    def log_prior(self, log_tau: Floats) -> Floats:
        """Log density of the prior of ``ln tau`` (W, P), shape (W,)."""
        p = self.scale.size
        covariance = COMMON**2 * np.ones((p, p)) + OWN**2 * np.eye(p)
        return np.asarray(multivariate_normal.logpdf(log_tau, np.log(self.scale), covariance)).reshape(
            len(log_tau)
        )

    def log_prob(self, log_tau: Floats) -> Floats:
        """Log density at each row of ``ln tau`` (W, P), shape (W,); never NaN."""
        log_tau = np.atleast_2d(log_tau)
        with np.errstate(over="ignore", invalid="ignore"):
            value = self.log_prior(log_tau)
            usable = np.isfinite(value) & (np.abs(log_tau) < 300.0).all(axis=-1)
            rows = np.flatnonzero(usable)
            for part in self._chunks(rows.size):
                value[rows[part]] += self._given(np.exp(log_tau[rows[part]]))[2]
        return np.where(usable & ~np.isnan(value), value, -np.inf)

    def _given(self, tau: Floats) -> tuple[Floats, Floats, Floats]:
        """Precision (W, QP, QP) and pull (W, QP) of level and slopes, and the log marginal likelihood (W,)."""
        p, q = self.width.size, self.matrix.shape[1]
        variance = tau[:, None, :] ** 2  # (W, 1, P)
        inner = np.eye(p) + variance[..., None] * self.precision  # I + T Lambda, (W, C, P, P)
        inverse = np.linalg.inv(inner)
        m = self.precision @ inverse  # Lambda (I + T Lambda)^-1
        h = np.einsum("wcji,cj->wci", inverse, self.pull)  # (I + Lambda T)^-1 eta
        fixed = -0.5 * np.linalg.slogdet(inner)[1] + 0.5 * np.einsum("ci,wci,wci->wc", self.pull, variance, h)
        precision = np.einsum("ca,cb,wcij->waibj", self.matrix, self.matrix, m).reshape(-1, q * p, q * p)
        pull = np.einsum("ca,wci->wai", self.matrix, h).reshape(-1, q * p)
        prior = np.tile(1.0 / self.width**2, q)
        precision = precision + np.diag(prior)
        pull = pull + prior * self._centre(q)
        solved = np.linalg.solve(precision, pull[..., None])[..., 0]
        log_likelihood = fixed.sum(axis=1) + 0.5 * np.einsum("wi,wi->w", pull, solved)
        log_likelihood -= 0.5 * np.linalg.slogdet(precision)[1] - 0.5 * np.log(prior).sum()
        log_likelihood -= 0.5 * float(np.sum(prior * self._centre(q) ** 2))
        return precision, pull, log_likelihood

    def _centre(self, q: int) -> Floats:
        return np.concatenate([self.centre, np.zeros((q - 1) * self.centre.size)])

    def coefficients(self, rng: np.random.Generator, tau: Floats) -> Floats:
        """Draw level and slopes (W, Q, P) given scatters ``tau`` (W, P)."""
        out = np.empty((len(tau), self.matrix.shape[1] * self.width.size))
        for part in self._chunks(len(tau)):
            precision, pull, _ = self._given(tau[part])
            root = np.linalg.cholesky(precision)
            mean = np.linalg.solve(precision, pull[..., None])
            noise = np.linalg.solve(np.swapaxes(root, 1, 2), rng.standard_normal(mean.shape))
            out[part] = (mean + noise)[..., 0]
        return out.reshape(len(tau), self.matrix.shape[1], -1)

    def _chunks(self, rows: int) -> Iterator[slice]:
        """Rows that are worked out at a time, so that memory does not grow with the number of conditions."""
        size = max(16, CHUNK // self.precision.size)
        for start in range(0, rows, size):
            yield slice(start, min(start + size, rows))

    def condition(
        self, place: int, mean: Floats, tau: Floats, rng: np.random.Generator, size: int, wider: float = 1.0
    ) -> tuple[Floats, Floats]:
        """Draw what one condition's coordinates are, given level, slopes and scatter.

        Parameters
        ----------
        place : int
            Which condition.
        mean, tau : ndarray, shape (W, P)
            ``x_c B`` and scatters.
        rng : Generator
        size : int
            Draws for each.
        wider : float
            By how much they are drawn from wider.

        Returns
        -------
        phi : ndarray, shape (W, size, P)
            About the product of N(mean, tau**2) and the Gaussian of the condition.
        log_ratio : ndarray, shape (W, size)
            Log of that product, as a density, over the density that they are drawn from.
        """
        s = self.summaries[place]
        whole = s.precision + np.eye(self.width.size) / tau[:, None, :] ** 2
        root = np.linalg.cholesky(whole)
        centre = np.linalg.solve(whole, (s.pull + mean / tau**2)[..., None])
        noise = rng.standard_normal((len(tau), self.width.size, size))
        phi = centre + wider * np.linalg.solve(np.swapaxes(root, 1, 2), noise)
        log_ratio = 0.5 * (1.0 - wider**2) * np.sum(noise**2, axis=1) + self.width.size * np.log(wider)
        return np.swapaxes(phi, 1, 2), log_ratio


@dataclass(frozen=True, slots=True)
class Correction:
    """How far the Gaussian form of what each condition says was corrected by its likelihood.

    Attributes
    ----------
    applied : bool
    k : float
        Pareto exponent of the weights.
    k_of : mapping of str to float
        By condition, Pareto exponent of its ratios.
    effective : float
        Effective number of draws after weighting.
    why_not : str
        Empty where it was applied.
    """

    applied: bool
    k: float
    k_of: dict[str, float]
    effective: float
    why_not: str


@dataclass(frozen=True, slots=True, eq=False)
class Population:
    """Posterior of the hierarchical model for one branch.

    Attributes
    ----------
    design : Design
    records : tuple of RecordDraws
        One for each condition of the design.
    coordinates : Coordinates
    density : ScatterDensity
    coefficients : ndarray, shape (S, Q, P)
        Level and slopes.
    scatter : ndarray, shape (S, P)
    phi : ndarray, shape (C, S, P)
        Coordinates of each measured condition, partially pooled.
    sampling : WeightedDraws
        Of ``ln tau``.
    correction : Correction
    """

    design: Design
    records: tuple[RecordDraws, ...]
    coordinates: Coordinates
    density: ScatterDensity
    coefficients: Floats
    scatter: Floats
    phi: Floats
    sampling: WeightedDraws
    correction: Correction

    @property
    def prior_led(self) -> bool:
        """Whether so few conditions are to spare that the scatter is led by its prior."""
        return self.design.spare < FEW_SPARE


def population_of(
    design: Design,
    records: Sequence[RecordDraws],
    seed: np.random.SeedSequence,
    *,
    scatter: float = SCATTER,
) -> Population:
    """Learn the hierarchical model.

    Parameters
    ----------
    design : Design
    records : sequence of RecordDraws
        Of one branch, one for each condition of the design, with the same channels and units.
    seed : numpy.random.SeedSequence
    scatter : float
        Median of the prior of the scatter, as a share of the curves' own yardsticks.
    """
    coordinates = coordinates_for(records)
    moments = [coordinates.prior_moments(r.priors) for r in records]
    density = ScatterDensity(
        matrix=design.matrix,
        summaries=tuple(
            summary_of(coordinates.to_coordinates(r.curve_theta), *m)
            for r, m in zip(records, moments, strict=True)
        ),
        centre=np.mean([m for m, _ in moments], axis=0),
        width=np.mean([np.sqrt(np.diag(c)) for _, c in moments], axis=0),
        scale=scatter * coordinates.yardsticks(records),
        labels=coordinates.labels,
    )
    sample_seed, draw_seed = seed.spawn(2)
    starts = [np.log(density.scale), np.log(0.1 * density.scale), np.log(3.0 * density.scale)]
    sampling = importance_draws(density, starts, np.full(density.scale.size, 2.0), sample_seed)
    rng = np.random.default_rng(draw_seed)
    tau = np.exp(sampling.z[_resample(rng, sampling.log_weight, DRAWS)])
    coefficients = density.coefficients(rng, tau)
    phi, kept, correction = _corrected(density, coordinates, records, coefficients, tau, rng)
    return Population(
        design,
        tuple(records),
        coordinates,
        density,
        coefficients[kept],
        tau[kept],
        phi[:, kept],
        sampling,
        correction,
    )


def _corrected(
    density: ScatterDensity,
    coordinates: Coordinates,
    records: Sequence[RecordDraws],
    coefficients: Floats,
    tau: Floats,
    rng: np.random.Generator,
) -> tuple[Floats, Places, Correction]:
    """Coordinates of each condition (C, W, P), and which draws to keep: by the likelihood where it can be relied on."""
    mean = np.einsum("cq,sqp->csp", density.matrix, coefficients)
    everything, count = np.arange(len(tau)), float(len(tau))
    gaussian = np.stack([density.condition(c, mean[c], tau, rng, 1)[0][:, 0] for c in range(len(records))])
    calibrated = [r.key for r in records if r.record.calibration]
    if calibrated:
        why = f"errors of a calibration are in the draws of {', '.join(calibrated)}, not in the likelihood"
        return gaussian, everything, Correction(False, np.nan, {}, count, why)
    log_weight, k_of, phi = np.zeros(len(tau)), {}, []
    for place, record in enumerate(records):
        own, ratio = density.condition(place, mean[place], tau, rng, INSIDE, WIDER)
        points = own.reshape(-1, own.shape[-1])
        ratio = ratio + log_ratio(density.summaries[place], coordinates, record, points, rng).reshape(
            ratio.shape
        )
        k_of[record.condition.id] = float(smoothed_weights(ratio.reshape(-1, 1))[1][0])
        log_weight += logsumexp(ratio, axis=1)
        chosen = np.argmax(ratio + rng.gumbel(size=ratio.shape), axis=1)  # a draw in proportion to exp(ratio)
        phi.append(own[everything, chosen])
    smooth, k = smoothed_weights(log_weight[:, None])
    bad = [name for name, value in k_of.items() if value > RELIABLE]
    if bad or k[0] > RELIABLE:
        why = (
            f"the weights can't be relied on: Pareto k of {', '.join(bad) or 'all together'} above {RELIABLE}"
        )
        return gaussian, everything, Correction(False, float(k[0]), k_of, count, why)
    effective = float(np.exp(-logsumexp(2.0 * smooth[:, 0])))
    kept = _resample(rng, smooth[:, 0], len(tau))
    return np.stack(phi), kept, Correction(True, float(k[0]), k_of, effective, "")


def log_ratio(
    summary: Summary, coordinates: Coordinates, record: RecordDraws, phi: Floats, rng: np.random.Generator
) -> Floats:
    """Log of the likelihood of a record over its Gaussian form, at each of ``phi`` (W, P), shape (W,).

    Up to a constant, and estimated: noise parameters are drawn once for each, given ``phi``.
    """
    posterior, layout = record.posterior, record.posterior.layout[0]
    space = posterior.space
    z = space.to_sampled(record.theta)
    noise = np.flatnonzero(space.free_index >= len(layout.model))
    nu, log_q = _given_curve(coordinates.to_coordinates(record.curve_theta), z[:, noise], phi, rng)
    theta = np.empty((len(phi), len(space.parameters)))
    theta[:, layout.model] = coordinates.to_parameters(phi)
    log_p = np.zeros(len(phi))
    for at, values in zip(noise.tolist(), nu.T, strict=True):
        prior = space.free[at].prior
        physical = prior.transform.to_physical(values)
        theta[:, space.free_index[at]] = physical
        log_p += prior.log_density(physical) + prior.transform.log_jacobian(values)
    for i, parameter in enumerate(space.parameters):
        if parameter.fixed is not None:
            theta[:, i] = parameter.fixed
    gaussian = phi @ summary.pull - 0.5 * np.einsum("wi,ij,wj->w", phi, summary.precision, phi)
    value = posterior.log_likelihood(theta) + log_p - log_q - gaussian
    return np.where(np.isnan(value), -np.inf, value)


def _given_curve(phi: Floats, nu: Floats, at: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Draw noise coordinates given those of the curve, by linear regression on posterior draws; and their log density.

    Parameters
    ----------
    phi, nu : ndarray, shape (S, P), (S, k)
        Posterior draws.
    at : ndarray, shape (W, P)
        Given coordinates of the curve.
    rng : Generator
    """
    count = nu.shape[1]
    if count == 0:
        return np.empty((len(at), 0)), np.zeros(len(at))
    centre, spread = phi.mean(axis=0), phi.std(axis=0)
    design = np.column_stack([np.ones(len(phi)), (phi - centre) / spread])
    slopes, *_ = np.linalg.lstsq(design, nu, rcond=None)
    left = nu - design @ slopes
    root = WIDER * np.linalg.cholesky(np.atleast_2d(np.cov(left.T)))
    far = np.clip(
        (at - centre) / spread, -4.0, 4.0
    )  # a line is not meant for what the record itself rules out
    mean = np.column_stack([np.ones(len(at)), far]) @ slopes
    e = rng.standard_normal((len(at), count))
    log_q = -0.5 * np.sum(e**2, axis=1) - float(np.sum(np.log(np.diag(root))))
    return mean + e @ root.T, log_q


def _resample(rng: np.random.Generator, log_weight: Floats, size: int) -> Places:
    """Positions of draws by their weights, in the fewest copies (systematic resampling), in random order."""
    edges = np.cumsum(np.exp(log_weight - logsumexp(log_weight)))
    points = (np.arange(size) + rng.random()) / size
    found = np.minimum(np.searchsorted(edges, points), len(log_weight) - 1)
    return np.asarray(rng.permutation(found), dtype=np.intp)
