"""What a posterior is drawn from before any draw of it is known.

In coordinates where it is nearly normal, a mixture: what is linear is normal, and the noise of each channel has its
linearised marginal. Where data tell little of the curve, its prior.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from sma_bayes.arrays import Floats, Ints
from sma_bayes.fitting.posterior import Posterior
from sma_bayes.fitting.posterior_coordinates import NoiseScaledCoordinates
from sma_bayes.parameters.space import ParameterSpace
from sma_bayes.sampling.proposals import FactorisedMixture, StudentMixture
from sma_bayes.sampling.shape import spread
from sma_bayes.sampling.weighted import Weights, tempered

MARGINAL_GRID = np.linspace(-5.0, 5.0, 41)
"""Where the marginal of a single noise parameter is looked at, in standard deviations of the Laplace approximation."""
GRID_POINTS = 441
"""Points of such a grid for several noise parameters of a channel."""
MAX_GRID_PARAMETERS = 2
"""Noise parameters of a channel, at most, for which there is a grid."""
MAX_MIXTURE_REFITS, REFIT_DRAWS, COMPONENTS = 4, 1000, 8
"""How often, at most, a mixture for more parameters than that is fitted once more to points drawn from itself, how many
these are, and its components."""
GOOD_EFFICIENCY = 0.8
"""Share of such points that count from which a mixture is left as it is."""
NEARLY_NORMAL_DF = 30.0
"""Degrees of freedom of what is normal where the response is linear."""


def first_mixture(
    coordinates: NoiseScaledCoordinates, z: Floats, covariance: Floats, rng: np.random.Generator
) -> FactorisedMixture:
    """Unit normal in the scaled coordinates of the model; for each channel's noise a fit to its marginal.

    Parameters
    ----------
    coordinates : NoiseScaledCoordinates
    z : ndarray, shape (D,)
        Where the posterior was linearised.
    covariance : ndarray, shape (D, D)
        Of the posterior there.
    rng : numpy.random.Generator
    """
    posterior, m = coordinates.equations.posterior, coordinates.count
    place = {int(f): i for i, f in enumerate(posterior.space.free_index)}
    centre = z[m:]
    channels = [at for record_place in posterior.layout for at in record_place.blocks()]
    noise = [np.array([place[int(i)] for i in at if int(i) in place], dtype=np.int64) for at in channels]
    noise = [block for block in noise if block.size]
    alone = [int(block[0]) for block in noise if block.size == 1]
    fits = iter(_fit_alone(coordinates, centre, np.array(alone) - m, np.diag(covariance)[alone]))
    parts = [StudentMixture(np.ones(1), np.zeros((1, m)), _standard(m), NEARLY_NORMAL_DF)]
    for block in noise:
        if block.size == 1:
            parts.append(next(fits))
            continue
        marginal = coordinates.log_noise_marginal
        if block.size > MAX_GRID_PARAMETERS and not posterior.noise.is_gaussian:
            # what is linear and normal tells little of the noise
            marginal = partial(_marginal_along_the_ridge, posterior, coordinates)
        parts.append(_fit_together(marginal, centre, block - m, covariance[np.ix_(block, block)], rng))
    return FactorisedMixture((np.arange(m), *noise), tuple(parts))


def _standard(m: int) -> Floats:
    """Root (1, m, m) of the scale matrix with which what is nearly normal has unit variance."""
    return math.sqrt((NEARLY_NORMAL_DF - 2.0) / NEARLY_NORMAL_DF) * np.eye(m)[None]


def _fit_alone(
    coordinates: NoiseScaledCoordinates, centre: Floats, at: Ints, variance: Floats
) -> list[StudentMixture]:
    """Noise parameters that are the only ones of their channels: mean and variance of their linearised marginals.

    Each is looked at on a grid, with all others at the mode.
    """
    if at.size == 0:
        return []
    x = centre[at, None] + np.sqrt(variance)[:, None] * MARGINAL_GRID
    noise_z = np.tile(centre, (at.size, MARGINAL_GRID.size, 1))
    noise_z[np.arange(at.size), :, at] = x
    log_marginal = coordinates.log_noise_marginal(noise_z.reshape(-1, centre.size)).reshape(x.shape)
    fits = []
    for values, log_weight, least in zip(
        x, log_marginal, variance * (MARGINAL_GRID[1] - MARGINAL_GRID[0]) ** 2, strict=True
    ):
        weight = Weights(log_weight).normalised
        mean = float(weight @ values)
        sd = math.sqrt(max(float(weight @ (values - mean) ** 2), least))
        fits.append(StudentMixture(np.ones(1), np.full((1, 1), mean), sd * _standard(1), NEARLY_NORMAL_DF))
    return fits


def _marginal_along_the_ridge(
    posterior: Posterior, coordinates: NoiseScaledCoordinates, noise_z: Floats
) -> Floats:
    """Log posterior of the noise parameters (W,), up to a constant.

    The model's are taken as normal: it is the density itself at the centre of their coordinates, times their volume.
    """
    u = np.concatenate([np.zeros((len(noise_z), coordinates.count)), noise_z], axis=1)
    z, log_jacobian, found = coordinates.inverse(u)
    value = np.full(len(u), -np.inf)
    value[found] = posterior.log_prob(z[found]) - log_jacobian[found]
    return value


def _fit_together(
    marginal: Callable[[Floats], Floats],
    centre: Floats,
    block: Ints,
    covariance: Floats,
    rng: np.random.Generator,
) -> StudentMixture:
    """Several noise parameters of one channel: a mixture fitted to their linearised marginal, all others at the mode.

    The marginal is looked at on a grid along the axes of its covariance, which is that of the Laplace approximation
    at first, then that of the grid before.
    """
    if block.size <= MAX_GRID_PARAMETERS:
        axis = np.linspace(MARGINAL_GRID[0], MARGINAL_GRID[-1], round(GRID_POINTS ** (1.0 / block.size)))
        grid = np.stack(np.meshgrid(*[axis] * block.size), axis=-1).reshape(-1, block.size)
        log_q = np.zeros(len(grid))
    else:  # a grid would be too coarse: points drawn from heavy tails, each by its weight
        heavy = StudentMixture(np.ones(1), np.zeros((1, block.size)), np.eye(block.size)[None], 4.0)
        grid = heavy.draw(rng, GRID_POINTS)
        log_q = heavy.log_density(grid)

    def at(x: Floats) -> Floats:
        noise_z = np.tile(centre, (len(x), 1))
        noise_z[:, block] = x
        return marginal(noise_z)

    mean = centre[block]
    for _ in range(3):
        x = mean + grid @ np.linalg.cholesky(covariance).T
        weights = Weights(at(x) - log_q)
        weight = weights.normalised if block.size <= MAX_GRID_PARAMETERS else tempered(weights)
        mean = weight @ x
        covariance = ((x - mean) * weight[:, None]).T @ (x - mean) + 1e-3 * covariance
    first = StudentMixture.from_covariances(np.ones(1), mean[None], covariance[None], 5.0)
    fitted = spread(first, rng, 4).refitted(x, weight, rounds=15)
    mixture = _reaching_out(fitted, first)
    return mixture if block.size <= MAX_GRID_PARAMETERS else _fitted_again(mixture, at, rng.spawn(1)[0])


def _reaching_out(fitted: StudentMixture, about: StudentMixture) -> StudentMixture:
    """A mixture with a tenth of a single component that is three times as wide as another."""
    return StudentMixture(
        np.append(0.9 * fitted.weight, 0.1),
        np.concatenate([fitted.mean, about.mean]),
        np.concatenate([fitted.root, 3.0 * about.root]),
        about.df,
    )


def _fitted_again(
    mixture: StudentMixture, log_density: Callable[[Floats], Floats], rng: np.random.Generator
) -> StudentMixture:
    """The best of a mixture and of those fitted in turn to points drawn from the one before, until one is good.

    Of a bent density in four dimensions a few points about its mode tell little of the tails.
    """
    best, greatest = mixture, 0.0
    points, shares = [], []
    for _ in range(MAX_MIXTURE_REFITS):
        x = mixture.draw(rng, REFIT_DRAWS)
        weights = Weights(log_density(x) - mixture.log_density(x))
        if weights.efficiency > greatest:
            best, greatest = mixture, weights.efficiency
        if weights.efficiency >= GOOD_EFFICIENCY:
            break
        weight = tempered(weights)
        points.append(x)
        shares.append(weight / np.sum(weight**2))  # draws of a good mixture count for more
        every, share = np.concatenate(points), np.concatenate(shares)
        share = share / share.sum()
        mean = share @ every
        covariance = ((every - mean) * share[:, None]).T @ (every - mean)
        about = StudentMixture.from_covariances(np.ones(1), mean[None], covariance[None], mixture.df)
        mixture = _reaching_out(spread(about, rng, COMPONENTS).refitted(every, share, rounds=20), about)
    return best


@dataclass(frozen=True, slots=True, eq=False)
class PriorOfCurve:
    """The prior for the parameters of the curve, and a Student t for those of the noise.

    Where the data hardly tell a curve, its posterior is nearly its prior, whatever the coordinates, while the noise is
    known well.

    Attributes
    ----------
    space : ParameterSpace
        Of all parameters.
    curve : ParameterSpace
        Of those of the curve.
    at : ndarray of int
        Coordinates of the noise.
    noise : StudentMixture
    """

    space: ParameterSpace
    curve: ParameterSpace
    at: Ints
    noise: StudentMixture

    @staticmethod
    def of(posterior: Posterior, z: Floats, covariance: Floats) -> PriorOfCurve:
        """With the noise as it is at a mode (D,), where the posterior has a covariance (D, D), a little wider."""
        space, size = posterior.space, posterior.sampled_model.size
        at = np.arange(size, space.dimension)
        wider = 2.0 * covariance[np.ix_(at, at)]
        mixture = StudentMixture.from_covariances(np.ones(1), z[None, at], wider[None], 5.0)
        return PriorOfCurve(space, ParameterSpace(space.free[:size]), at, mixture)

    def draw(self, rng: np.random.Generator, size: int) -> tuple[Floats, Floats]:
        """Points (size, D) and their log density (size,)."""
        z = self.space.draw(rng, size)
        z[:, self.at] = self.noise.draw(rng, size)
        return z, self.log_density(z)

    def log_density(self, z: Floats) -> Floats:
        """Log density at any points, shape (W,)."""
        curve = np.delete(z, self.at, axis=1)
        return np.asarray(self.curve.log_prior(curve) + self.noise.log_density(z[:, self.at]))
