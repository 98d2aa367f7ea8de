"""Fitting a proposal: importance weights, several modes, curved densities, draws of another move."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from sma_bayes.sampling.adaptation import (
    GREATEST_WEIGHT,
    ROUND_DRAWS,
    USABLE_EFFICIENCY,
    Adapted,
    _Rounds,
    adapt,
    with_wide_share,
)
from sma_bayes.sampling.laplace import Mode, find_mode
from sma_bayes.sampling.proposals import MixedProposal, Proposal
from sma_bayes.sampling.refitting import adapt_to_draws
from sma_bayes.sampling.weighted import ImportanceSample, Weights


@dataclass
class Density:
    function: Callable[[np.ndarray], np.ndarray]
    names: tuple[str, ...] = ()

    def log_prob(self, z: np.ndarray) -> np.ndarray:
        return self.function(np.atleast_2d(z))

    def draw_prior(self, rng: np.random.Generator, size: int) -> np.ndarray:
        return rng.normal(0.0, 5.0, (size, 2))


def lumps(z: np.ndarray) -> np.ndarray:
    """Two unit normals at -5 and 5 on the diagonal, nine to one; the integral is one."""
    left = np.log(0.9) - 0.5 * ((z + 5.0) ** 2).sum(axis=1)
    right = np.log(0.1) - 0.5 * ((z - 5.0) ** 2).sum(axis=1)
    return np.logaddexp(left, right) - np.log(2.0 * np.pi)


def banana(z: np.ndarray) -> np.ndarray:
    x, y = z[:, 0], z[:, 1]
    return -0.5 * x**2 - 0.5 * ((y - x**2 + 1.0) / 0.5) ** 2 - np.log(2.0 * np.pi * 0.5)


def mode_at(density: Density, start: list[float]) -> Mode:
    mode = find_mode(density, np.array(start), np.full(2, 5.0))
    assert mode is not None
    return mode


# --- weights ------------------------------------------------------------------------------------------


def test_equal_weights_are_all_in_effect() -> None:
    w = Weights(np.full(50, -3.0))
    assert w.efficiency == pytest.approx(1.0)
    assert w.greatest == pytest.approx(1.0)
    assert w.log_evidence() == (pytest.approx(-3.0), pytest.approx(0.0, abs=1e-6))


def test_one_weight_takes_all() -> None:
    w = Weights(np.concatenate([[0.0], np.full(99, -1000.0)]))
    assert w.efficiency == pytest.approx(0.01)
    assert w.greatest == pytest.approx(100.0)
    assert w.normalised.sum() == pytest.approx(1.0)


def weighed(w: Weights) -> ImportanceSample:
    n = w.log_weight.size
    log_prob = np.arange(n) - 7.0
    return ImportanceSample(np.arange(2.0 * n).reshape(n, 2), log_prob, log_prob - w.log_weight)


def test_no_weight_at_all_is_no_efficiency() -> None:
    w = Weights(np.full(10, -np.inf))
    assert w.efficiency == 0.0
    assert not Adapted(None, weighed(w), 0).carries
    np.testing.assert_allclose(w.normalised, 0.1)


def test_draws_without_weight_count_in_the_evidence() -> None:
    w = Weights(np.array([0.0, 0.0, -np.inf, -np.inf]))
    assert w.log_evidence()[0] == pytest.approx(np.log(0.5))
    assert w.efficiency == pytest.approx(0.5)


def test_the_error_of_the_evidence_is_what_replicates_say() -> None:
    """Spread of ln Z over 300 replicates of log-normal weights against the claimed one: within 15 %."""
    rng = np.random.default_rng(0)
    found = [Weights(rng.normal(0.0, 0.7, 1000)).log_evidence() for _ in range(300)]
    values, errors = np.array(found).T
    assert np.std(values) == pytest.approx(np.median(errors), rel=0.15)
    assert np.mean(values) == pytest.approx(0.5 * 0.7**2, abs=0.005)


@pytest.mark.parametrize(
    ("log_weight", "carries"),
    [
        (np.zeros(1000), True),
        (np.where(np.arange(1000) < 250, 0.0, -np.inf), False),
        (np.concatenate([[np.log(60.0)], np.zeros(9999)]), False),
    ],
)
def test_a_proposal_carries_a_run_only_if_no_weight_is_too_great(
    log_weight: np.ndarray, carries: bool
) -> None:
    w = Weights(log_weight)
    assert Adapted(None, weighed(w), 0).carries is carries
    assert carries == (w.efficiency >= USABLE_EFFICIENCY and w.greatest <= GREATEST_WEIGHT)


def test_points_are_chosen_by_weight_each_group_from_a_share_of_its_own() -> None:
    log_weight = np.where(np.arange(400) % 10 < 5, np.log(3.0), np.log(1.0))
    log_weight[::40] = -np.inf
    drawn = weighed(Weights(log_weight))
    z, log_prob = drawn.chosen(4, 90, np.random.default_rng(0))
    assert (z.shape, log_prob.shape) == ((4, 90, 2), (4, 90))
    number = (z[..., 0] / 2.0).astype(int)
    np.testing.assert_array_equal(log_prob, number - 7.0)
    for group, chosen in enumerate(number):
        assert set(chosen % 4) == {group}
        assert np.isfinite(log_weight[chosen]).all()
        share = np.arange(group, 400, 4)
        copies = 90.0 * np.exp(log_weight[share]) / np.exp(log_weight[share]).sum()
        assert np.abs(np.bincount(chosen, minlength=400)[share] - copies).max() < 1.0


def test_draws_without_weight_do_not_flatten_the_weights_of_the_others() -> None:
    """Of 1000 draws 30 have a weight: less than the least share in effect, but these are even enough."""
    log_weight = np.full(1000, -np.inf)
    log_weight[:30] = np.linspace(0.0, 1.0, 30)
    rounds = _Rounds()
    drawn = weighed(Weights(log_weight))
    rounds.add(drawn, drawn.z, np.ones(1000, dtype=bool), alone=False)
    (found,) = rounds.weight
    np.testing.assert_allclose(found / found.sum(), Weights(log_weight).normalised[:30])


# --- fits ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(6))
def test_no_proposal_that_is_blind_to_the_end_of_a_bend_carries(seed: int) -> None:
    """Of a bend as sharp as this up to 40 % of the mass went unseen, at efficiencies of 0.35 to 0.8.

    What carries has nine tenths of the integral.
    """

    def sharp(z: np.ndarray) -> np.ndarray:
        bend = (z[:, 1] - z[:, 0] ** 2) / 0.2
        return -0.5 * z[:, 0] ** 2 - 0.5 * bend**2 - np.log(2.0 * np.pi * 0.2)

    density = Density(sharp)
    adapted = adapt(density, [mode_at(density, [0.3, 0.3])], np.random.default_rng(seed))
    assert not adapted.carries or adapted.weights.log_evidence()[0] > np.log(0.9)
    assert adapted.greatest_seen > 0.0


def test_every_mode_gets_a_proposal_with_its_share() -> None:
    density = Density(lumps)
    modes = [mode_at(density, [-4.0, -4.5]), mode_at(density, [4.0, 4.5])]
    adapted = adapt(density, modes, np.random.default_rng(1))
    assert isinstance(adapted.proposal, MixedProposal)
    np.testing.assert_allclose(adapted.proposal.weight, [0.9, 0.1], atol=0.02)
    assert adapted.carries
    assert adapted.weights.efficiency > 0.9
    value, error = adapted.weights.log_evidence()
    assert abs(value) < 5.0 * error + 1e-3
    assert adapted.evaluations >= 4 * ROUND_DRAWS


def test_a_bent_density_is_told_by_its_weights() -> None:
    density = Density(banana)
    adapted = adapt(density, [mode_at(density, [0.5, 0.0])], np.random.default_rng(2))
    one = adapt(
        Density(lambda z: -0.5 * (z**2).sum(axis=1)), [mode_at(density, [0.5, 0.0])], np.random.default_rng(2)
    )
    assert isinstance(one.proposal, Proposal)
    assert one.weights.efficiency > 0.6
    assert 0.3 < adapted.weights.efficiency < one.weights.efficiency


def test_draws_of_another_move_make_a_proposal() -> None:
    rng = np.random.default_rng(3)
    x = rng.standard_normal(20_000)
    z = np.stack([x, x**2 - 1.0 + 0.5 * rng.standard_normal(20_000)], axis=1)
    density = Density(banana)
    adapted = adapt_to_draws(density, z, [mode_at(density, [0.5, 0.0])], rng)
    assert adapted.weights.efficiency > 0.7
    value, error = adapted.weights.log_evidence()
    assert abs(value) < 5.0 * error + 1e-3


def test_a_proposal_that_misses_a_lump_of_the_draws_does_not_carry() -> None:
    """Its own draws never come there; those of the other move do."""
    rng = np.random.default_rng(8)
    density = Density(lumps)
    own = adapt(density, [mode_at(density, [-4.0, -4.5])], rng)
    assert own.weights.efficiency > 0.5
    z = np.where(rng.random((8000, 1)) < 0.9, -5.0, 5.0) + rng.standard_normal((8000, 2))
    fitted = adapt_to_draws(density, z, [mode_at(density, [-4.0, -4.5])], rng)
    assert fitted.carries
    assert 1.0 < fitted.greatest_seen <= GREATEST_WEIGHT
    assert not replace(fitted, greatest_seen=100.0).carries


def test_acceptance_is_the_mean_over_pairs_of_draws() -> None:
    """Of every draw of the other move with every draw of the proposal, here by brute force."""
    rng = np.random.default_rng(9)
    density = Density(banana)
    own = adapt(density, [mode_at(density, [0.5, 0.0])], rng)
    x = rng.standard_normal(500)
    z = np.stack([x, x**2 - 1.0 + 0.5 * rng.standard_normal(500)], axis=1)
    judged = own.judged(z, density.log_prob(z))
    log_seen = density.log_prob(z) - own.proposal.log_density(z)
    gain = own.weights.log_weight[:, None] - log_seen
    assert judged.acceptance == pytest.approx(np.mean(np.exp(np.minimum(gain, 0.0))))
    assert judged.greatest_seen == pytest.approx(np.exp(log_seen.max() - own.weights.log_evidence()[0]))


def test_a_proposal_that_the_draws_never_leave_is_not_accepted() -> None:
    """Whatever its own draws say of it."""
    rng = np.random.default_rng(10)
    density = Density(lumps)
    own = adapt(density, [mode_at(density, [-4.0, -4.5])], rng)
    far = 5.0 + rng.standard_normal((200, 2))
    near = -5.0 + rng.standard_normal((200, 2))
    assert own.judged(far, density.log_prob(far)).acceptance < 0.01
    assert own.judged(near, density.log_prob(near)).acceptance > 0.7


def test_a_wider_proposal_differs_only_in_the_share_of_its_wide_part() -> None:
    density = Density(lumps)
    modes = [mode_at(density, [-4.0, -4.5]), mode_at(density, [4.0, 4.5])]
    for chosen in (modes[:1], modes):
        wide = with_wide_share(adapt(density, chosen, np.random.default_rng(4)), 0.4)
        parts = wide.proposal.parts if isinstance(wide.proposal, MixedProposal) else (wide.proposal,)
        assert [p.share for p in parts] == [0.4] * len(chosen)


def test_a_fit_is_decided_by_the_generator() -> None:
    density = Density(banana)
    mode = mode_at(density, [0.5, 0.0])
    draws = [
        adapt(density, [mode], np.random.default_rng(5)).proposal.draw(np.random.default_rng(6), 20)[0]
        for _ in range(2)
    ]
    np.testing.assert_array_equal(*draws)
