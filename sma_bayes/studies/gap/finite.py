"""Effects that are too large for their signature: a few steps of a full fit, from several sizes.

A signature is what an effect adds to the curve as it was fitted without it. A shift as large as the transformation is
wide, say, leaves a curve behind that is a smeared mean of those that were measured, on which neither the shift nor what
the parameters absorb looks as it will once both are fitted. So where a disagreement is strong, curve and effect go a
few steps together from several sizes, and what has then been gained takes the place of what the signature promised.
"""

from __future__ import annotations

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.types import Effect
from sma_bayes.parameters.distributions import LogNormal
from sma_bayes.studies.gap.fitting import FittedHypothesis, climbed

STRONG_LN_BAYES_FACTOR = 100.0
"""Log Bayes factor of the best flexible term from which on signatures are not relied upon."""
START_QUANTILES = {True: (0.5, 0.9), False: (0.2, 0.8)}
"""Quantiles of the prior at which sizes begin: those of one sign, those of either."""
FIT_STEPS = 4
"""Steps of each fit, after as many in which the curve alone makes room for the effect."""


def gained_in_steps(fitted: FittedHypothesis, effect: Effect, start: Floats) -> tuple[float, Floats]:
    """Gain of log likelihood after a few steps from the best of several sizes, and where that is.

    Parameters
    ----------
    fitted : FittedHypothesis
        The model without the effect.
    effect : Effect
    start : ndarray, shape (D,)
        What screening found best, in the coordinates of the extended hypothesis: one of the places to begin, and the
        other parameters of the effect for the others.
    """
    extended = fitted.hypothesis.extended(effect)
    prior = effect.parameters(extended.scales)[0].prior
    place, begin = fitted.z.size, [start]
    for q in START_QUANTILES[isinstance(prior, LogNormal)]:
        z = start.copy()
        z[:place] = fitted.z
        z[place] = float(prior.transform.unconstrain(prior.quantile(np.array(q))))
        begin.append(z)
    found = [climbed(extended, z, fitted.noise, FIT_STEPS, start.size - place) for z in begin]
    z, value = max(found, key=lambda f: f[1])
    return value - fitted.log_likelihood, z
