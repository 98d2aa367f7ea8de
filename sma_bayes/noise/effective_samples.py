"""Gaussian noise with a memory, counted as fewer independent samples.

Where a curve misses the data by more than noise, its residuals have a memory as long as the transformation. An
AR(1) likelihood then looks at differences of neighbouring samples and lets the memory take the place of the
curve: a single snap of the spring decides, and the plateaus hardly count. This likelihood looks at the curve as
least squares does, and counts only as many samples as are independent:

    log p = (1/memory) * sum over samples of log N(e; 0, 1)

``memory`` is the number of samples that count as one, ``1 + 2 * sum of r_k``: the autocorrelations of the
least-squares residuals, as far as they stay positive; ``(1 + r)/(1 - r)`` if they fall as ``r**k``. Centre and
widths are those of least squares with standard errors widened by ``sqrt(memory)``. The standard deviation itself
is that of the least-squares residuals, by a prior of its own (``spread``): so few samples in effect could not tell
it, and what widens the curve is the memory.

References
----------
M. Ribatet, D. Cooley, A. C. Davison, "Bayesian inference from composite likelihoods, with an application to
spatial extremes", Statistica Sinica 22 (2012) 813; U. K. Müller, "Risk of Bayesian inference in misspecified
models, and the sandwich covariance matrix", Econometrica 81 (2013) 1805.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from sma_bayes.arrays import Floats
from sma_bayes.noise.ar1 import MemoryNoise
from sma_bayes.noise.base import Steps, sd_fact
from sma_bayes.noise.information import Information, of_independent_samples
from sma_bayes.normal import HALF_LN_2PI
from sma_bayes.parameters.space import QUANTITY, ParameterSpec


@dataclass(frozen=True)
class EffectiveSamples(MemoryNoise):
    """Independent Gaussian likelihood raised to the power ``1/memory``.

    It is not a density of the data, so evidences that use it can't be compared with others. Replicated data and
    innovations are those of an AR(1) series of the same memory.
    """

    name = "effective_samples"
    title = "Gaussian with effective samples"
    is_density = False
    is_gaussian = False

    def parameters(self, channel: str, unit: str, time_unit: str) -> tuple[ParameterSpec, ...]:
        memory = ParameterSpec(
            f"{channel}_memory",
            "1",
            f"samples of {QUANTITY} that count as one",
            "memory",
            channel,
            positive=True,
        )
        return (replace(sd_fact(channel, unit), prior_key="spread"), memory)

    def phi(self, shape: Floats, steps: Steps) -> Floats:
        memory = shape[..., 0, None]
        return np.where(steps.first, 0.0, (memory - 1.0) / (memory + 1.0))

    def likelihood_weight(self, shape: Floats) -> Floats:
        return np.asarray(1.0 / shape[..., 0])

    def log_density(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        return np.asarray(-0.5 * e * e - HALF_LN_2PI)

    def total_log_density(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        return np.asarray(-0.5 * np.einsum("...i,...i->...", e, e) - HALF_LN_2PI * e.shape[-1])

    def information(self, shape: Floats, steps: Steps, inverse: Floats | None = None) -> Information:
        return of_independent_samples(steps.first.size, 1.0 / shape[:, 0], inverse)

    def estimate(self, residual: Floats, steps: Steps) -> Floats:
        return np.array([np.sqrt(np.mean(residual**2)), memory_of(residual, steps)])


def memory_of(residual: Floats, steps: Steps) -> float:
    """Samples that count as one: the integrated autocorrelation time of residuals within sweeps, at least 1.

    The sum ends with the first pair of autocorrelations that is negative together (C. J. Geyer, "Practical Markov
    chain Monte Carlo", Statistical Science 7 (1992) 473). A misfit that swings about zero a few times along the
    sweep so counts for about as many samples, however densely it was recorded.

    Parameters
    ----------
    residual : ndarray, shape (n,)
    steps : Steps
    """
    starts = np.flatnonzero(steps.first)
    sweeps = np.split(residual, starts[1:])
    longest = max(s.size for s in sweeps)
    total = np.zeros(longest)
    for sweep in sweeps:
        length = next_fast_len(2 * sweep.size, real=True)
        total[: sweep.size] += irfft(np.abs(rfft(sweep, length)) ** 2, length)[: sweep.size]
    if not total[0] > 0.0:
        return 1.0
    rho = total / total[0]
    pairs = rho[: 2 * (longest // 2)].reshape(-1, 2).sum(axis=1)
    negative = np.flatnonzero(pairs < 0.0)
    kept = pairs[: negative[0]] if negative.size else pairs
    return max(1.0, float(2.0 * kept.sum() - 1.0))
