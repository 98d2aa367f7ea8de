"""The posterior of a model that misses something: least squares, with as few readings as its misfit leaves.

Beside noise alone the likelihood of the noise gives sizes and intervals. What a model misses is no such noise: it is
the same the next time. Where it is left, or passes for noise that hardly changes from reading to reading, levels
count for little beside that noise, and intervals hold its steps and not the misfit. So parameters are those of least
squares there [1]_, whose covariance is that of a sandwich [2]_,

    H^-1 (P + J' V J) H^-1,    H = P + J' J,

with the precision P of the prior, the Jacobian J in standard deviations of the residuals, and the covariance V of an
AR(1) series as large and as lasting as the residuals as they are, misfit included, and larger by what the
parameters have taken out of it. The likelihood is raised to the
power 1/k, with the least k that makes no number of an effect better known than that [3]_: k readings count as one.

References
----------
.. [1] R. Tuo and C. F. J. Wu, Efficient calibration for imperfect computer models, Ann. Stat. 43 (2015) 2331.
.. [2] H. White, Maximum likelihood estimation of misspecified models, Econometrica 50 (1982) 1; with correlated
   residuals: W. K. Newey and K. D. West, Econometrica 55 (1987) 703.
.. [3] F. Pauli, W. Racugno and L. Ventura, Bayesian composite marginal likelihoods, Stat. Sin. 21 (2011) 149.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.studies.gap.fitting import FittedHypothesis, fit_hypothesis
from sma_bayes.studies.gap.memory_likelihood import noise_as_it_is
from sma_bayes.studies.gap.noise import BlockNoise, Noise

ROUNDS = 3
"""How often the parameters and the sizes of the residuals of each channel are found in turn."""


def least_squares_of(fitted: FittedHypothesis) -> tuple[FittedHypothesis, float]:
    """The same hypothesis by least squares, and how many readings count as one.

    Parameters
    ----------
    fitted : FittedHypothesis
        With effects; at a mode beside noise.

    Returns
    -------
    FittedHypothesis
        Its noise has no memory; scales of innovations make so many readings one.
    float
        At least 1.
    """
    plain = fitted
    for _ in range(ROUNDS):
        plain = fit_hypothesis(plain.hypothesis, plain.z, _without_memory(plain))
    alike = readings_as_one(plain)
    return fit_hypothesis(plain.hypothesis, plain.z, _scaled(plain.noise, math.sqrt(alike))), alike


def _without_memory(fitted: FittedHypothesis) -> Noise:
    """White noise as large as the residuals of each block."""
    return tuple(
        BlockNoise(
            float(np.sqrt(np.mean(fitted.residual[block.at] ** 2))) or own.sd, np.zeros_like(own.memory)
        )
        for block, own in zip(fitted.blocks, fitted.noise, strict=True)
    )


def _scaled(noise: Noise, scale: float) -> Noise:
    return tuple(replace(own, scale=scale) for own in noise)


def readings_as_one(fitted: FittedHypothesis) -> float:
    """How many readings count as one, so that no number of an effect is better known than by the sandwich.

    Parameters
    ----------
    fitted : FittedHypothesis
        By least squares: its noise is white.
    """
    space = fitted.hypothesis.space
    free = space.free_index.tolist()
    own = [free.index(i) for at in fitted.hypothesis.effect_positions.values() for i in at if i in free]
    wide, plain = sandwich(fitted), fitted.covariance
    return max(1.0, *(float(wide[i, i] / plain[i, i]) for i in own))


def sandwich(fitted: FittedHypothesis) -> Floats:
    """Covariance of the sampled coordinates where residuals are as they are, shape (D, D).

    Parameters
    ----------
    fitted : FittedHypothesis
        By least squares: its noise is white.
    """
    information, inverse = fitted.jacobian.T @ fitted.jacobian, fitted.covariance
    score, variance = np.zeros_like(information), 0.0
    for block, white in zip(fitted.blocks, fitted.noise, strict=True):
        misfit = noise_as_it_is(fitted.residual[block.at], block)
        spread = misfit.spread(fitted.jacobian[block.at]) / white.sd
        score += spread.T @ spread
        variance += block.first.size * (misfit.sd / white.sd) ** 2
    taken = inverse @ score
    left = variance - 2.0 * np.trace(taken) + np.trace(taken @ inverse @ information)
    prior = fitted.precision - information
    return np.asarray(inverse @ (prior + score * variance / left) @ inverse)
