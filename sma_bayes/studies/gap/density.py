"""The posterior of a hypothesis, for the same ensembles that sample every fit.

The standard deviation of the noise of each block is integrated out under the prior ``1/sd``, which leaves

    log L = - sum over blocks of  n/2 ln (sum of squared innovations at unit sd)

The memory of the noise is held at its estimate: with hundreds of samples a block its own uncertainty moves nothing.

Where the model misses something the likelihood is raised to a power below 1, see `least_squares`.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.sampling.convergence import Target
from sma_bayes.sampling.ensembles import Draws, Plan, sample
from sma_bayes.sampling.laplace import Mode
from sma_bayes.sampling.shape import NormalShape
from sma_bayes.studies.gap.effect_coordinates import FollowingCoordinates
from sma_bayes.studies.gap.fitting import FittedHypothesis

EXPLORATION_STEPS = 50
MAX_EVALUATIONS = 400_000
"""Steps of a block of exploration, and the greatest effort: whole histories with their effects take a thousand times as
long to predict as one curve, so less is spent, and draws that do not converge by then are called so."""

GREATEST_WEIGHT = 100.0
"""Greatest importance weight, in mean weights, of independence moves: a walker stays that many steps at such a point,
out of ten thousand and more, which moves no quantile, and R-hat and effective sample sizes see it."""


@dataclass(frozen=True, eq=False)
class HypothesisDensity:
    """Log-probability of batches of parameter vectors under a hypothesis.

    Attributes
    ----------
    fitted : FittedHypothesis
        Supplies hypothesis, blocks and memory of the noise.
    readings_as_one : float
        How many readings count as one: the inverse of the power of the likelihood.
    """

    fitted: FittedHypothesis
    readings_as_one: float = 1.0

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the sampled parameters."""
        return tuple(p.name for p in self.fitted.hypothesis.space.free)

    def draw_prior(self, rng: np.random.Generator, size: int) -> Floats:
        """Draws from the prior in sampled coordinates, shape (size, D)."""
        return self.fitted.hypothesis.space.draw(rng, size)

    def shape(self) -> NormalShape:
        """The model's parameters are nearly normal once they follow those of the effects; these may be bent.

        Where several readings count as one so few are left that the curve may be bent, too.
        """
        shear = FollowingCoordinates(self.fitted, one_by_one=self.readings_as_one > 1.0)
        bent = self.fitted.z.size - (0 if shear.one_by_one else shear.count)
        return NormalShape(shear, shear.covariance, bent)

    def log_prob(self, z: Floats) -> Floats:
        """Log of the unnormalised density at each row of `z` (W, D); never NaN."""
        z = np.atleast_2d(z)
        space = self.fitted.hypothesis.space
        out = np.empty(len(z))
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            for part in self.fitted.batches(len(z)):
                out[part] = space.log_prior(z[part]) + self._log_likelihood(z[part])
        return np.where(np.isnan(out), -np.inf, out)

    def _log_likelihood(self, z: Floats) -> Floats:
        total = np.zeros(len(z))
        residual = self.fitted.residual_at(z)
        for block, noise in zip(self.fitted.blocks, self.fitted.noise, strict=True):
            w = replace(noise, sd=1.0).whiten_residual(residual[:, block.at])
            total -= 0.5 * w.shape[1] * np.log(np.einsum("ij,ij->i", w, w))
        return total / self.readings_as_one


def sample_hypothesis(
    fitted: FittedHypothesis,
    seed: np.random.SeedSequence,
    target: Target | None = None,
    *,
    readings_as_one: float = 1.0,
    checkpoint: Path | None = None,
) -> Draws:
    """Sample the posterior of a fitted hypothesis with ensembles.

    Parameters
    ----------
    fitted : FittedHypothesis
        Its mode and Gauss-Newton precision are where the ensembles begin: differences of the density, which stand in
        for the precision of other densities, mistake a bend that is narrow across for width.
    seed : numpy.random.SeedSequence
    target : Target, optional
    readings_as_one : float
        See `HypothesisDensity`; precision and mode are those beside noise that is scaled so.
    checkpoint : Path, optional
        See `sample`.

    Raises
    ------
    ResumeError
        If the file is that of another hypothesis, mode or noise.
    """
    plan = Plan(
        target=target or Target(),
        explore_block=EXPLORATION_STEPS,
        evaluations=MAX_EVALUATIONS,
        greatest_weight=GREATEST_WEIGHT,
    )
    density = HypothesisDensity(fitted, readings_as_one)
    mode = Mode(fitted.z, float(density.log_prob(fitted.z)[0]), fitted.covariance, 1)
    return sample(
        density,
        [mode],
        fitted.hypothesis.space.prior_sd(),
        seed,
        plan,
        checkpoint=checkpoint,
        fingerprint=_fingerprint(fitted) if checkpoint else "",
    )


def _fingerprint(fitted: FittedHypothesis) -> str:
    """Of what decides the density: parameters with their priors, data, predictions and noise at the mode."""
    digest = hashlib.sha256(repr(fitted.hypothesis.space.free).encode())
    for values in (fitted.z, fitted.residual, fitted.whitened):
        digest.update(values.tobytes())
    return digest.hexdigest()
