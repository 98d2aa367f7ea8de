"""Whether draws meet the target, and whether they are of the right posterior.

R-hat and effective sample size alone are met too early by ensembles that start from a Laplace approximation: all
start alike, agree with each other, and have not yet forgotten their start. So draws are also compared with those of
a longer run of this package: by the shares of them that lie below its 5 %, 50 % and 95 % quantiles. A share has a
binomial standard error whatever the posterior looks like, and bulk and tail effective sample size are those of
exactly these three. Standard deviations would not do: where tails are heavy they hang on a few draws, and 1000
effective ones leave them unsure by tens of per cent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from benchmark.progress import Progress

from sma_bayes.arrays import Floats
from sma_bayes.sampling.convergence import Convergence, Target, assess

TARGET = Target(rhat=1.01, ess=1000.0)
LEVELS = np.array([0.05, 0.5, 0.95])
"""Quantiles of the longer run at which draws are compared with it."""
ERRORS = 4.0
"""Standard errors of as many effective draws as are asked for by which a share may differ; the same for all."""


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """What a longer run of this package says of each coordinate.

    Attributes
    ----------
    mean, sd : ndarray, shape (D,)
    quantiles : ndarray, shape (3, D)
        At `LEVELS`.
    ess : float
        Least effective sample size.
    """

    mean: Floats
    sd: Floats
    quantiles: Floats
    ess: float

    @staticmethod
    def of(z: Floats, ess: float) -> Reference:
        """Reference from draws `z` (N, D)."""
        return Reference(z.mean(axis=0), z.std(axis=0), np.quantile(z, LEVELS, axis=0), ess)


@dataclass(frozen=True, slots=True, eq=False)
class Verdict:
    """What some draws are worth.

    Attributes
    ----------
    discard : float
        Share of the steps dropped as burn-in.
    convergence : Convergence
    errors : ndarray, shape (3, D)
        Share below each quantile of the reference less its level [standard errors of the draws asked for].
    shift : ndarray, shape (D,)
        Means less those of the reference [sd of the posterior].
    ratio : ndarray, shape (D,)
        Standard deviations over those of the reference.
    """

    discard: float
    convergence: Convergence
    errors: Floats
    shift: Floats
    ratio: Floats

    @staticmethod
    def none(dimension: int) -> Verdict:
        """Of no draws at all."""
        unknown = np.full(dimension, np.nan)
        nothing = Convergence(unknown, unknown, unknown, False, unknown, unknown)
        return Verdict(0.0, nothing, np.full((LEVELS.size, dimension), np.nan), unknown, unknown)

    @property
    def same(self) -> bool:
        """Whether the draws are of the right posterior, as far as the number of draws asked for can tell."""
        return bool(np.all(np.abs(self.errors) <= ERRORS))

    @property
    def least(self) -> float:
        """Least effective sample size."""
        return float(np.nanmin(np.minimum(self.convergence.ess_bulk, self.convergence.ess_tail)))

    @property
    def reached(self) -> bool:
        """Whether the target is met by draws of the right posterior."""
        return self.convergence.converged and self.same


def judge(progress: Progress, reference: Reference) -> Verdict:
    """The best verdict over the shares of the steps that may be dropped."""
    verdicts = []
    for discard in progress.discards:
        verdicts.append(_judge(progress, discard, reference))
        if verdicts[-1].reached:
            return verdicts[-1]
    return max(verdicts, key=lambda v: (v.convergence.converged, v.least))


def _judge(progress: Progress, discard: float, reference: Reference) -> Verdict:
    chains = progress.chains[:, int(discard * progress.chains.shape[1]) :]
    flat = chains.reshape(-1, chains.shape[-1])
    return Verdict(
        discard,
        diagnose(chains),
        share_errors(flat, reference),
        (flat.mean(axis=0) - reference.mean) / reference.sd,
        flat.std(axis=0) / reference.sd,
    )


def share_errors(z: Floats, reference: Reference) -> Floats:
    """Shares of `z` (N, D) below the quantiles of the reference less their levels [standard errors], shape (3, D).

    The standard errors are those of `TARGET.ess` effective draws and of the reference's: sqrt(p (1 - p) (1/n + 1/m)).
    """
    shares = np.array([np.mean(z <= quantile, axis=0) for quantile in reference.quantiles])
    standard = np.sqrt(LEVELS * (1.0 - LEVELS) * (1.0 / TARGET.ess + 1.0 / reference.ess))
    return np.asarray((shares - LEVELS[:, None]) / standard[:, None])


def diagnose(chains: Floats) -> Convergence:
    """R-hat and effective sample sizes with the walkers of an ensemble joined end to end, in the same way for all.

    `sma_bayes.sampling.convergence.assess` adds a second estimate, from the means over walkers, to runs of a hundred
    steps or more. It is on the safe side by a factor of about two for stretch moves, and would be asked of other
    samplers only, since this package's runs are shorter.
    """
    groups, steps, walkers, dimension = chains.shape
    joined = np.swapaxes(chains, 1, 2).reshape(groups, walkers * steps, dimension)
    in_order = chains.reshape(groups, steps * walkers, dimension)
    found = assess(joined[:, :, None], TARGET)
    rhat = np.maximum(found.rhat, assess(in_order[:, :, None], TARGET).rhat)
    bulk, tail = found.ess_bulk, found.ess_tail
    reached = np.all(rhat <= TARGET.rhat) and np.all(np.minimum(bulk, tail) >= TARGET.ess)
    unknown = np.full(dimension, np.nan)
    return Convergence(rhat, bulk, tail, bool(reached), unknown, unknown)
