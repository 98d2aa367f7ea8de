"""The audit of a proposal: what it hardly draws is found, counted and mended."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import norm

from sma_bayes.sampling.adaptation import Adapted, weigh
from sma_bayes.sampling.audit import MENDED_DRAWS, Audited, audited, reaching_further
from sma_bayes.sampling.convergence import Target, assess
from sma_bayes.sampling.ensembles import sample
from sma_bayes.sampling.proposals import MixedProposal, PlainCoordinates, Proposal, StudentMixture

D = 5
WIDTH = np.full(D, 20.0)


@dataclass(frozen=True)
class SlowTail:
    """Unit normal, and a share of the mass in a normal that is `far` times as wide along the first coordinate."""

    share: float = 0.09
    far: float = 6.0

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"x{i}" for i in range(D))

    def log_prob(self, z: np.ndarray) -> np.ndarray:
        rest = norm.logpdf(z[:, 1:]).sum(axis=1)
        parts = [
            np.log1p(-self.share) + norm.logpdf(z[:, 0]),
            np.log(self.share) + norm.logpdf(z[:, 0], scale=self.far),
        ]
        return rest + logsumexp(parts, axis=0)

    def draw(self, rng: np.random.Generator, size: int) -> np.ndarray:
        z = rng.standard_normal((size, D))
        z[rng.random(size) < self.share, 0] *= self.far
        return z

    def draw_prior(self, rng: np.random.Generator, size: int) -> np.ndarray:
        return rng.normal(0.0, 20.0, (size, D))


def proposal(wide: float = 1.2) -> Proposal:
    """Nearly the unit normal; its wide part reaches not much farther."""
    one = np.eye(D)[None]
    narrow = StudentMixture.from_covariances(np.ones(1), np.zeros((1, D)), one, 30.0)
    return Proposal(
        PlainCoordinates(),
        narrow,
        StudentMixture.from_covariances(np.ones(1), np.zeros((1, D)), wide**2 * one, 30.0),
    )


def audit_of(density: SlowTail, seed: int, size: int = 2000) -> Audited:
    """With draws that know nothing of the tail, as those of a run whose proposal did not reach it."""
    rng = np.random.default_rng(seed)
    z, log_q = proposal().draw(rng, size)
    log_weight = density.log_prob(z) - log_q
    tame = log_weight < np.log(5.0) + logsumexp(log_weight) - np.log(size)
    return audited(density, proposal(), log_weight[tame], z[tame], WIDTH, rng)


def test_a_proposal_like_the_posterior_passes() -> None:
    found = audit_of(SlowTail(share=1e-12), 0)
    assert found.audit.passed
    assert found.audit.outside == 0.0
    assert found.audit.pareto_k < 0.5
    assert found.audit.greatest_met < 10.0
    assert found.evidence.value == pytest.approx(0.0, abs=5.0 * found.evidence.sd)


@pytest.mark.parametrize("seed", range(5))
def test_a_tail_that_is_never_drawn_is_found_though_weights_look_even(seed: int) -> None:
    """Beyond some four standard deviations lie 4 to 5 % of the mass: counted within 4 of its standard errors."""
    found = audit_of(SlowTail(), seed)
    assert not found.audit.passed
    assert found.audit.outside > 0.01
    assert abs(found.audit.outside - 0.045) < 4.0 * found.audit.outside_sd + 0.01


def test_evidence_has_what_the_proposal_missed() -> None:
    """The mean of 20 audits is nearer the truth by half than without it, and the stated error covers what is left."""
    found = [audit_of(SlowTail(), seed).evidence for seed in range(20)]
    error = np.array([e.value for e in found])
    assert abs(error.mean()) < 0.04
    assert np.mean(np.abs(error) < 3.0 * np.array([e.sd for e in found])) >= 0.9


def audit_after(times: float) -> Audited:
    """Of a run so many times as long as its target asks, whose weights are even and whose draws lack a thin tail."""
    density, rng = SlowTail(share=0.02, far=3.0), np.random.default_rng(1)
    even = 0.1 * rng.standard_normal(4000)
    return audited(density, proposal(), even, proposal().draw(rng, 4000)[0], WIDTH, rng, times)


def test_a_longer_run_may_draw_more_rarely() -> None:
    """What an audit asks for is just enough: the same looks pass with it, and do not with a hundredth less."""
    longer = audit_after(1.0).longer
    assert 1.0 < longer < np.inf
    assert audit_after(1.001 * longer).audit.passed
    assert not audit_after(0.99 * longer).audit.passed


def test_no_length_of_run_makes_up_for_weights_without_a_variance() -> None:
    found = audit_of(SlowTail(), 0)
    rng = np.random.default_rng(0)
    heavy = rng.standard_exponential(4000)  # Pareto exponent of the weights: 1
    assert found.longer > 1.0
    assert audited(SlowTail(), proposal(), heavy, found.z, WIDTH, rng).longer == np.inf


def test_a_mended_proposal_draws_the_tail() -> None:
    density = SlowTail()
    rng = np.random.default_rng(3)
    mended = audit_of(density, 1).mended(density, proposal(), rng)
    assert isinstance(mended.proposal, MixedProposal)
    assert mended.weights.efficiency > 0.4
    assert mended.weights.greatest < 10.0
    z = density.draw(rng, 4000)
    before, after = (
        np.mean(density.log_prob(z) - p.log_density(z) > np.log(10.0)) for p in (proposal(), mended.proposal)
    )
    assert before > 0.03
    assert after < before / 3.0  # what is left lies farther out, for the next audit


@pytest.mark.parametrize("seed", range(3))
def test_a_proposal_beside_the_mass_is_mended_by_its_own_weighted_draws(seed: int) -> None:
    """Displaced by 2 standard deviations along each of five coordinates, one draw in twenty counts."""
    density, beside = SlowTail(), proposal()
    beside = replace(beside, narrow=replace(beside.narrow, mean=beside.narrow.mean + 2.0))
    rng = np.random.default_rng(seed)
    found = Adapted(beside, weigh(density, beside, rng, 500), 500)
    before = found.weights.efficiency
    assert before < 0.06
    for _ in range(3):
        found = reaching_further(density, found, WIDTH, rng)
    assert found.weights.efficiency > 0.5
    assert found.carries
    assert found.last.z.shape == (MENDED_DRAWS, D)


@pytest.mark.slow
@pytest.mark.thorough
def test_draws_of_a_run_have_the_tail() -> None:
    """97.5 % quantiles of four seeds: 0.2 sd is four standard errors of the target."""
    density = SlowTail()
    exact = np.quantile(density.draw(np.random.default_rng(0), 4_000_000)[:, 0], [0.025, 0.975])
    sd = np.sqrt(1.0 + density.share * (density.far**2 - 1.0))
    for seed in range(4):
        draws = sample(density, [np.zeros(D)], WIDTH, np.random.SeedSequence(seed))
        assert draws.convergence.converged
        found = np.quantile(draws.z[..., 0], [0.025, 0.975])
        np.testing.assert_allclose((found - exact) / sd, 0.0, atol=0.2)
        assert draws.audit is None or draws.audit.passed
        assert abs(draws.ln_evidence) < 4.0 * draws.ln_evidence_sd


def test_errors_of_outer_quantiles_are_those_of_repeats() -> None:
    """Of exponential and normal draws: the mean of the estimates over 200 sets against their scatter, within 25 %."""
    rng = np.random.default_rng(0)
    x = np.stack([rng.standard_normal((200, 2048)), rng.exponential(size=(200, 2048))], axis=-1)
    ends = np.quantile(x, [0.025, 0.975], axis=1)
    scatter = (ends.std(axis=1) / x.std(axis=(0, 1))).max(axis=0)
    stated = np.mean([assess(one.reshape(4, 8, 64, 2), Target()).quantile_error for one in x], axis=0)
    np.testing.assert_allclose(stated / scatter, 1.1, atol=0.25)
