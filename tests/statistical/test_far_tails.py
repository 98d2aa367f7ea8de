"""Draws in far tails, of stiffness with AR(1) noise, that a first proposal has missed by a factor of 30 and more.

A run that meets such a draw must not go on as if nothing were; whichever way it then goes, what it calls converged must
be right. It is held against 300,000 importance draws of a proposal that reaches far. The lower tail of A3 is so heavy
(kurtosis 125) that 60,000 draws of one that reaches less far have its 2.5 % quantile wrong by 0.2 sd, its sd by 20 %.
False alarm, were the seed drawn anew: shares of the draws below seven quantiles, 56 comparisons a run and three runs,
each within 4.5 standard errors of 1,000 effective draws: one in 800. Of 20 seeds, 1000 to 1019, outer quantiles were
off by 0.15 sd at most, ln Z by 2.4 errors and standard deviations by 4 %, but for that of A3, of which two thirds of
the variance are in the last hundredth of the draws: it scattered by 8 % and all were called converged. 393,000 draws,
the most that are made for it, tell it to 3 to 4 %, and unless it is told to 2.3 % the record is not converged. Each
standard deviation must be within 3.5 of its stated errors, joined with those of the reference: 24 comparisons, one
false alarm in 90, were the errors normal.

Stiffness alone with independent noise is bent, too, and in its own parameters a proposal seems good that misses a
hundredth of the posterior; in coordinates of the predictions it is not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from benchmark.problems import Case, Problem
from measure_tails import LN_Z_OFF, OFF, QUANTILES, SD_OFF

from sma_bayes.arrays import Floats
from sma_bayes.fitting.posterior import Posterior
from sma_bayes.sampling.adaptation import adapt, weigh
from sma_bayes.sampling.audit import audited, reaching_further
from sma_bayes.sampling.convergence import PUBLISHED_TARGET
from sma_bayes.sampling.ensembles import sample
from sma_bayes.sampling.laplace import Mode, find_mode
from sma_bayes.sampling.proposals import AnyProposal
from sma_bayes.sampling.weighted import resampled, weighted_quantiles

LEVELS = (QUANTILES[0], 0.05, 0.25, 0.5, 0.75, 0.95, QUANTILES[1])
OUTER = [0, -1]
BUT_SD = replace(PUBLISHED_TARGET, sd_error=np.inf)


def far_reaching(posterior: Posterior, modes: Sequence[Mode]) -> AnyProposal:
    """A proposal that was made to reach further four times, whatever its weights."""
    rng = np.random.default_rng(0)
    adapted = adapt(posterior, modes, rng)
    for _ in range(4):
        adapted = reaching_further(posterior, adapted, posterior.space.prior_sd(), rng)
    return adapted.proposal


def mended(posterior: Posterior, proposal: AnyProposal) -> AnyProposal:
    """The same, fitted twice to many weighted draws of its own."""
    rng, width = np.random.default_rng(0), posterior.space.prior_sd()
    for _ in range(2):
        drawn = weigh(posterior, proposal, rng, 60_000)
        z = drawn.z[resampled(drawn.log_weight, 20_000, rng)]
        found = audited(posterior, proposal, drawn.log_weight, z, width, rng)
        proposal = found.mended(posterior, proposal, rng).proposal
    return proposal


@dataclass(frozen=True, eq=False)
class Reference:
    """A posterior, and what importance draws tell of it: quantiles (7, D), sd with its standard error (D,), ln Z."""

    problem: Problem
    quantiles: Floats
    sd: Floats
    sd_error: Floats
    ln_evidence: float
    ln_evidence_sd: float


@pytest.fixture(scope="module")
def reference() -> Reference:
    problem = Problem.of(Case("S", "ar1").records()[10], "ar1")
    posterior = problem.posterior
    mode = find_mode(posterior, problem.start, posterior.space.prior_sd())
    assert mode is not None
    proposal = mended(posterior, far_reaching(posterior, [mode]))
    drawn = weigh(posterior, proposal, np.random.default_rng(1), 300_000)
    assert drawn.weights.efficiency > 0.6
    used = drawn.weights.normalised > 0.0
    z, share = drawn.z[used], drawn.weights.normalised[used]
    off = (z - share @ z) ** 2
    variance = share @ off
    error = 0.5 * np.sqrt(share**2 @ (off / variance - 1.0) ** 2)
    quantiles = weighted_quantiles(z, np.log(share), LEVELS)
    return Reference(problem, quantiles, np.sqrt(variance), error, *drawn.weights.log_evidence())


@pytest.mark.slow
@pytest.mark.parametrize(
    "seed", [1004, *(pytest.param(seed, marks=pytest.mark.thorough) for seed in (1013, 1016))]
)
def test_what_a_first_proposal_missed_is_in_the_draws(reference: Reference, seed: int) -> None:
    problem, posterior = reference.problem, reference.problem.posterior
    draws = sample(posterior, [problem.start], posterior.space.prior_sd(), np.random.SeedSequence(seed))
    found = draws.convergence
    assert found.reaches(BUT_SD)
    wide = found.sd_error > PUBLISHED_TARGET.sd_error
    assert found.converged == (not wide.any())
    assert {posterior.names[i] for i in np.flatnonzero(wide)} <= {"A3"}  # no other tail is so heavy
    assert draws.evaluations > 40_000  # it did not do at the first try, or this test says nothing

    z, levels = draws.z.reshape(-1, draws.z.shape[-1]), np.array(LEVELS)[:, None]
    shares = (z[:, None] <= reference.quantiles).mean(axis=0)
    error = np.sqrt(levels * (1.0 - levels) / 1000.0)
    assert np.abs((shares - levels) / error).max() < 4.5

    ends = reference.quantiles[OUTER]
    assert np.abs((np.quantile(z, QUANTILES, axis=0) - ends) / reference.sd).max() < OFF
    off = np.abs(z.std(axis=0) / reference.sd - 1.0)
    assert np.all(off[~wide] < (SD_OFF + 2.0 * reference.sd_error)[~wide])
    assert np.all(off < 3.5 * np.hypot(found.sd_error, reference.sd_error))
    error = np.hypot(draws.ln_evidence_sd, reference.ln_evidence_sd)
    assert abs(draws.ln_evidence - reference.ln_evidence) < LN_Z_OFF * error


@pytest.mark.slow
@pytest.mark.thorough
def test_the_tails_of_a_bent_posterior_are_not_short() -> None:
    """Mean shares over 40 runs, below three quantiles in seven parameters: 21 comparisons, each within 4.5 standard
    errors of 40 runs of 1,000 effective draws; one false alarm in 7,000."""
    problem = Problem.of(Case("S", "independent").records()[0], "independent")
    posterior, width = problem.posterior, problem.posterior.space.prior_sd()
    levels = (0.05, 0.5, 0.95)
    shares, modes = [], None
    quantiles = np.empty(0)
    for seed in range(40):
        draws = sample(posterior, [problem.start], width, np.random.SeedSequence(seed))
        if modes is None:
            modes = draws.modes
            drawn = weigh(posterior, far_reaching(posterior, modes), np.random.default_rng(1), 500_000)
            # eight times as many as the runs have together
            assert drawn.weights.efficiency * 500_000 > 320_000
            assert drawn.weights.greatest < 4.0
            used = drawn.weights.normalised > 0.0
            quantiles = weighted_quantiles(drawn.z[used], np.log(drawn.weights.normalised[used]), levels)
        z = draws.z.reshape(-1, width.size)
        shares.append((z[:, None] <= quantiles).mean(axis=0) - np.array(levels)[:, None])
    level = np.array(levels)[:, None]
    error = np.sqrt(level * (1.0 - level) / 1000.0 / len(shares))
    assert np.abs(np.mean(shares, axis=0) / error).max() < 4.5
