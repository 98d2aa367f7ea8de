"""Every move in use leaves a density as it is.

emcee 3.1.6 ships a move (`DESnookerMove`) that does not: on a 7-dimensional unit Gaussian its variance is 0.65.
"""

from __future__ import annotations

import ast
from collections.abc import Callable
from pathlib import Path

import emcee
import numpy as np
import pytest

import sma_bayes
from sma_bayes.sampling.convergence import Target, assess
from sma_bayes.sampling.moves import (
    DifferentialEvolutionMove,
    IndependenceMove,
    MultipleProposalMove,
    differential_evolution,
    differential_evolution_of,
)
from sma_bayes.sampling.proposals import MixedProposal, PlainCoordinates, Proposal, StudentMixture

WALKERS = 64
ENSEMBLES = 20
FALSE_ALARM = 5.0
"""Standard errors, taken from that many independent ensembles: with 19 degrees of freedom each check fails by
chance in one of 12,000 runs, and the seeds are fixed."""
STREAM = np.random.default_rng(7)
"""Of proposals that are made before a move begins."""


def proposal(d: int, scale: float, shift: float, share: float = 0.05) -> Proposal:
    narrow = StudentMixture.from_covariances(
        np.ones(1), np.full((1, d), shift), scale * np.eye(d)[None], 15.0
    )
    wide = StudentMixture.from_covariances(np.ones(1), np.zeros((1, d)), 4.0 * np.eye(d)[None], 4.0)
    return Proposal(PlainCoordinates(), narrow, wide, share)


def good(d: int) -> Proposal:
    return proposal(d, 1.1, 0.1)


def poor(d: int) -> Proposal:
    """Too narrow and in the wrong place: only the wide component reaches everywhere."""
    return proposal(d, 0.6, 0.4, share=0.3)


def mixed(d: int) -> MixedProposal:
    return MixedProposal(np.array([0.7, 0.3]), (good(d), poor(d)))


def independence(make: Callable[[int], Proposal | MixedProposal]):
    return lambda d: [(IndependenceMove(make(d), 16), 1.0)]


def multiple(make: Callable[[int], Proposal | MixedProposal], steps: int):
    return lambda d: [(MultipleProposalMove(make(d), steps), 1.0)]


def side_by_side(d: int):
    return differential_evolution_of(2, d)


def both_kinds(d: int):
    evolution = [(move, 0.5 * share) for move, share in side_by_side(d)]
    return [*evolution, (IndependenceMove(good(d), 16), 0.5)]


MOVES = {
    "independence": (independence(good), 7, 200),
    "independence with a poor proposal": (independence(poor), 3, 300),
    "independence with a mixed proposal": (independence(mixed), 4, 200),
    "multiple proposals": (multiple(good, 7), 7, 210),
    "multiple proposals of a poor kind": (multiple(poor, 5), 3, 300),
    "multiple proposals of a mixed kind": (multiple(mixed, 12), 4, 204),
    "one proposal of as many": (multiple(good, 1), 3, 200),
    "differential evolution": (differential_evolution, 7, 300),
    "differential evolution of two ensembles": (side_by_side, 7, 300),
    "both kinds": (both_kinds, 7, 200),
}


def gaussian(z: np.ndarray) -> np.ndarray:
    return -0.5 * np.einsum("ij,ij->i", z, z)


def ensemble(moves, d: int, steps: int, seed: int, log_prob=gaussian) -> np.ndarray:
    """Chain (steps, walkers, d) from exact draws."""
    random = np.random.RandomState(seed)
    start = emcee.State(random.standard_normal((WALKERS, d)), random_state=random.get_state())
    sampler = emcee.EnsembleSampler(WALKERS, d, log_prob, moves=moves(d), vectorize=True)
    sampler.run_mcmc(start, steps)
    return np.asarray(sampler.get_chain())


@pytest.mark.parametrize("name", list(MOVES))
def test_a_gaussian_keeps_its_mean_and_variance(name: str) -> None:
    moves, d, steps = MOVES[name]
    chains = [ensemble(moves, d, steps, seed) for seed in range(ENSEMBLES)]
    for moment, expected in (
        (np.array([c.mean() for c in chains]), 0.0),
        (np.array([np.mean(c**2) for c in chains]), 1.0),
        (np.array([np.mean(c[..., 0] * c[..., 1]) for c in chains]), 0.0),
        (np.array([np.mean(np.abs(c) > 2.0) for c in chains]), 0.04550026),
    ):
        error = moment.std(ddof=1) / np.sqrt(moment.size)
        assert abs(moment.mean() - expected) < FALSE_ALARM * error
        assert error < 0.01, "too few draws to see anything"


def test_the_check_would_see_the_wrong_move() -> None:
    """`DESnookerMove` of emcee 3.1.6 fails it by far; where it has been mended there is nothing to see."""
    if emcee.__version__ != "3.1.6":
        pytest.skip(f"emcee {emcee.__version__} may have mended the move")

    def snooker(d: int):
        return [(emcee.moves.DESnookerMove(), 1.0)]

    moment = np.array([np.mean(ensemble(snooker, 7, 150, seed) ** 2) for seed in range(8)])
    assert abs(moment.mean() - 1.0) > 3.0 * FALSE_ALARM * moment.std(ddof=1) / np.sqrt(8)


def test_the_snooker_move_is_used_nowhere() -> None:
    for path in Path(sma_bayes.__file__).parent.rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        names = {n.id for n in ast.walk(tree) if isinstance(n, ast.Name)}
        names |= {n.attr for n in ast.walk(tree) if isinstance(n, ast.Attribute)}
        names |= {a.name for n in ast.walk(tree) if isinstance(n, ast.ImportFrom) for a in n.names}
        assert "DESnookerMove" not in names, path


def test_a_move_never_leaves_the_support() -> None:
    def half(z: np.ndarray) -> np.ndarray:
        return np.where(z[:, 0] > 0.0, gaussian(z), -np.inf)

    for moves in (independence(good), multiple(good, 7), differential_evolution, side_by_side):
        random = np.random.RandomState(0)
        start = emcee.State(np.abs(random.standard_normal((WALKERS, 3))), random_state=random.get_state())
        sampler = emcee.EnsembleSampler(WALKERS, 3, half, moves=moves(3), vectorize=True)
        sampler.run_mcmc(start, 50)
        assert np.all(sampler.get_chain()[..., 0] > 0.0)
        assert np.isfinite(sampler.get_log_prob()).all()


def test_proposals_are_evaluated_in_batches() -> None:
    sizes = []

    def counted(z: np.ndarray) -> np.ndarray:
        sizes.append(len(z))
        return gaussian(z)

    for moves in (independence(good), multiple(good, 16)):
        sizes.clear()
        ensemble(moves, 3, 32, 0, counted)
        assert sizes == [WALKERS, 16 * WALKERS, 16 * WALKERS]


@pytest.mark.parametrize("kind", [IndependenceMove, MultipleProposalMove])
def test_a_block_depends_only_on_the_state_it_starts_from(kind) -> None:
    """What is left of a batch is forgotten, so that a resumed run goes on as the first one did."""
    move = kind(good(3), 16)
    sampler = emcee.EnsembleSampler(WALKERS, 3, gaussian, moves=[(move, 1.0)], vectorize=True)
    random = np.random.RandomState(1)
    state = emcee.State(random.standard_normal((WALKERS, 3)), random_state=random.get_state())
    chains = []
    for _ in range(2):
        move.start_block()
        sampler.reset()
        sampler.run_mcmc(emcee.State(state, copy=True), 10, skip_initial_state_check=True)
        chains.append(sampler.get_chain().copy())
    np.testing.assert_array_equal(chains[0], chains[1])


@pytest.mark.parametrize("kind", [IndependenceMove, MultipleProposalMove])
def test_weights_of_all_proposals_are_kept(kind) -> None:
    move = kind(good(2), 16)
    sampler = emcee.EnsembleSampler(WALKERS, 2, gaussian, moves=[(move, 1.0)], vectorize=True)
    sampler.run_mcmc(np.random.default_rng(0).standard_normal((WALKERS, 2)), 32)
    weights = np.concatenate(move.log_weights)
    assert weights.size == 32 * WALKERS
    # their mean is the integral of the density, here 2 pi
    assert np.mean(np.exp(weights)) == pytest.approx(2.0 * np.pi, rel=0.05)


def test_of_multiple_proposals_none_of_average_weight_is_lost() -> None:
    """Where density and proposal are the same, all points weigh the same, and no more than one of them is left out."""

    def log_prob(z: np.ndarray) -> np.ndarray:
        return good(3).log_density(z)

    chain = ensemble(multiple(good, 7), 3, 70, 0, log_prob)
    for walker in np.moveaxis(chain, 1, 0):
        for chosen in walker.reshape(10, 7, 3):
            assert len(np.unique(chosen, axis=0)) == 7


@pytest.mark.parametrize("make", [good, poor])
def test_multiple_proposals_make_as_many_effective_draws_as_they_are_said_to(make) -> None:
    """The mean over an ensemble scatters, over ensembles, as their effective sample sizes say.

    Of 400 means the variance is told to within 7 %; it may be off by four times that before the test fails, which
    happens by chance once in 10,000 runs.
    """
    d, runs = 2, 400
    means, sizes = [], []
    for seed in range(runs):
        chain = ensemble(multiple(make, 7), d, 14, seed)
        means.append(chain.mean(axis=(0, 1)))
        sizes.append(assess(chain.transpose(1, 0, 2).reshape(1, -1, 1, d), Target()).ess_bulk)
    told = np.mean(sizes, axis=0)
    assert np.all(np.abs(np.var(means, axis=0) * told - 1.0) < 4.0 * np.sqrt(2.0 / runs))


def test_multiple_proposals_give_more_for_as_many_evaluations() -> None:
    """With a fair proposal; measured 0.42 and 0.71 effective draws an evaluation."""

    def effective(moves) -> float:
        chains = [ensemble(moves, 8, 28, seed).transpose(1, 0, 2).reshape(1, -1, 1, 8) for seed in range(10)]
        return float(np.mean([assess(chain, Target()).ess_bulk for chain in chains]))

    def fair(d: int) -> Proposal:
        return proposal(d, 1.3, 0.2)

    assert effective(multiple(fair, 14)) > 1.4 * effective(independence(fair))


def test_ensembles_side_by_side_are_evaluated_together_and_know_nothing_of_each_other() -> None:
    sizes: list[int] = []

    def run(second: np.ndarray) -> np.ndarray:
        def counted(z: np.ndarray) -> np.ndarray:
            sizes.append(len(z))
            return gaussian(z)

        start = emcee.State(
            np.concatenate([first, second]), random_state=np.random.RandomState(2).get_state()
        )
        moves = [(DifferentialEvolutionMove(2, 0.7), 1.0)]
        sampler = emcee.EnsembleSampler(2 * WALKERS, 3, counted, moves=moves, vectorize=True)
        sampler.run_mcmc(start, 20)
        return np.asarray(sampler.get_chain())

    first, second = np.random.RandomState(1).standard_normal((2, WALKERS, 3))
    near, far = run(second), run(second + 30.0)
    np.testing.assert_array_equal(near[:, :WALKERS], far[:, :WALKERS])
    assert not np.array_equal(near[0, :WALKERS], first)
    assert sizes[1:41] == [WALKERS] * 40  # after the starts
