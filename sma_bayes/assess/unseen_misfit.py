"""What a curve may miss though its readings do not show it, for slopes of the curve.

Beside a curve stands a discrepancy where the evidence is for one (`sma_bayes.fitting.noise_choice`). Where it is not,
the readings allow for a small misfit still: one that force and displacement hardly feel, and that is seen in the
stiffness, a ratio of their slopes. No curve with eight parameters is exactly that of a specimen, so there is one, of a
size that is unknown, and it is drawn given the residuals. It is a discrepancy of the package
(`sma_bayes.fitting.discrepancy`) of more smoothness, since its slope is asked for: its eigenfunctions fall as 1/k**4.
And it is a function of the response, so that its slope ends where that of the curve does, and what a plateau says of
the stiffness stays what the curve says.
Everything is normal, and about the median curve, so that it takes no sampling.

The power was chosen by 20 simulated springs that follow no curve of the package: with the powers 2, 3 and 4 the 90 %
band of the stiffness held 99, 98 and 96 % of it within the transformation, and of other springs, with the power 4, 95 %
and more (`docs/howto/simulate_a_current.md`): it is wider than a nominal band need be.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from sma_bayes.assess.draws import RecordDraws
from sma_bayes.fitting.discrepancy_weights import weights_given_residuals
from sma_bayes.fitting.noise_choice import discrepancy_bases

EXTRA_DECAY_POWER: Final = 3
"""Power of their number by which eigenfunctions are smaller than those of the discrepancy of a fit."""


def with_unseen_misfit(draws: RecordDraws, rng: np.random.Generator) -> RecordDraws:
    """Draws whose curves miss what the readings may not show, in channels without a discrepancy."""
    posterior, record, theta = draws.posterior, draws.record, np.median(draws.theta, axis=0)
    bases = {
        channel: basis.smoother(EXTRA_DECAY_POWER)
        for channel, basis in discrepancy_bases(
            posterior, theta[posterior.layout[0].model], with_response=True
        )[0].items()
        if channel not in draws.weights
    }
    mean, relative = posterior.moments_of_noise(theta, 0)
    weights = {}
    for channel, basis in bases.items():
        residual = record.observed[channel] - mean[channel]
        at, noise = posterior.layout[0].noise[channel], posterior.noise
        shape = posterior.noise_shape(theta, 0, channel)
        pulled = posterior.working_residual(theta, 0, channel, residual, relative[channel])
        variance = (theta[at[0]] * relative[channel]) ** 2 * noise.memory(shape, posterior.steps[0])
        variance = variance / noise.location_information(shape)
        given = weights_given_residuals(
            basis.rows / np.sqrt(variance), pulled / np.sqrt(variance), float(np.ptp(mean[channel]))
        )
        weights[channel] = given.draw(draws.size, rng)
    if not weights:
        return draws
    both = {**posterior.discrepancy[0], **bases}
    return replace(
        draws,
        posterior=posterior.on([record], discrepancy=[both]),
        weights={**draws.weights, **weights},
    )
