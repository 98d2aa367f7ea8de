"""Fit a proposal to a density: Laplace approximation, then importance draws that refine it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from emcee.state import State

from sma_bayes.arrays import Bools, Floats
from sma_bayes.sampling.density import Density, Linearisable, Linearised, linearised_at, shape_of
from sma_bayes.sampling.ensemble_sampler import EnsembleSampler
from sma_bayes.sampling.laplace import Mode
from sma_bayes.sampling.moves import differential_evolution
from sma_bayes.sampling.proposals import (
    AnyProposal,
    MixedProposal,
    Proposal,
    StudentMixture,
)
from sma_bayes.sampling.shape import one_component, spread
from sma_bayes.sampling.weighted import LEAST_EFFICIENCY, ImportanceSample, Weights, tempered

ROUND_DRAWS = 500
"""Importance draws of one round."""
FIRST_DRAWS = 256
"""Those of a first look at a proposal as linearising gives it."""
LINEAR_EFFICIENCY = 0.92
"""Efficiency of a first look at which no other coordinates are looked at: 0.94 where the response is linear, but for
chance."""
MAX_ROUNDS = 6
"""Greatest number of rounds for one set of coordinates."""
GOOD_EFFICIENCY = 0.7
"""Efficiency at which refining stops. At 0.6 a mild banana still passes, whose tail has weights that end a run."""
WALKERS_AND_STEPS = (64, 60)
"""Walkers and steps that look for what a proposal does not reach."""
USABLE_EFFICIENCY = 0.3
"""Efficiency below which a proposal does not carry a run alone."""
GREATEST_WEIGHT = 30.0
"""Greatest importance weight, as a multiple of the mean weight, of a proposal that carries a run alone."""


@dataclass(frozen=True, slots=True, eq=False)
class Adapted:
    """A fitted proposal and what its own draws say of it.

    Attributes
    ----------
    proposal : Proposal or MixedProposal
    last : ImportanceSample
        The last round of draws.
    evaluations : int
    greatest_seen : float
        Greatest weight, as a multiple of the mean weight, at draws of another move that were not used in the fit:
        what the proposal would hardly ever draw shows there, not in its own draws. Zero where there are none.
    acceptance : float
        Share of independence moves from such draws that would be accepted; not a number where there are none.
    """

    proposal: AnyProposal
    last: ImportanceSample
    evaluations: int
    greatest_seen: float = 0.0
    acceptance: float = math.nan

    @property
    def weights(self) -> Weights:
        """Those of the last round."""
        return self.last.weights

    @property
    def misses(self) -> bool:
        """Whether another move met what this proposal hardly ever draws: of that, its own draws know nothing."""
        return self.greatest_seen > GREATEST_WEIGHT

    @property
    def carries(self) -> bool:
        """Whether an independence move with this proposal is enough by itself."""
        weights = self.weights
        return (
            weights.efficiency >= USABLE_EFFICIENCY
            and weights.greatest <= GREATEST_WEIGHT
            and not self.misses
        )

    @property
    def good(self) -> bool:
        """Whether it carries a run, and fitting it again would hardly make it better."""
        return self.weights.efficiency >= GOOD_EFFICIENCY and self.carries

    def judged(self, z: Floats, log_prob: Floats) -> Adapted:
        """The same, as draws (n, D) of another move see it; `log_prob` (n,) is what the density is there."""
        return self.judged_by(log_prob - self.proposal.log_density(z))

    def judged_by(self, log_weight: Floats) -> Adapted:
        """The same, as draws of another move see it that have such logarithms of weights (n,)."""
        log_seen = log_weight - self.weights.log_evidence()[0]
        seen = np.exp(np.clip(log_seen, -700.0, 700.0))  # a proposal may miss a draw by any factor
        own = np.sort(self.weights.normalised) * self.weights.log_weight.size
        below = np.searchsorted(own, seen)
        total = np.concatenate([np.zeros(1), np.cumsum(own)])[below]
        accepted = (total / seen + (own.size - below)) / own.size  # mean of min(1, own/seen) over own
        return replace(self, greatest_seen=float(seen.max()), acceptance=float(accepted.mean()))


def adapt(density: Density, modes: Sequence[Mode], rng: np.random.Generator) -> Adapted:
    """Fit a proposal to a density whose modes are known.

    Parameters
    ----------
    density : Density
        Where it can be linearised, in the coordinates that it has there; any other is taken as it is.
    modes : sequence of Mode
        Best first.
    rng : numpy.random.Generator
    """
    fitted = [_adapt_mode(density, mode, rng) for mode in modes]
    found = fitted[0] if len(fitted) == 1 else _mixed(density, fitted, rng)
    # in its own coordinates it is not bent
    return found if isinstance(density, Linearisable) else _looked_around(density, found, rng)


def first_proposal(linearised: Linearised, mode: Mode, rng: np.random.Generator) -> Proposal | None:
    """Proposal in the first coordinates in which linearising a density at a mode gives one; None where none does."""
    for coordinates, narrow in linearised.proposals(mode.covariance, rng):
        return Proposal(coordinates, narrow, _wide(mode))
    return None


def _mixed(density: Density, fitted: Sequence[Adapted], rng: np.random.Generator) -> Adapted:
    """One proposal of several, each with the share of its evidence."""
    evidence = np.array([f.weights.log_evidence()[0] for f in fitted])
    share = np.exp(evidence - evidence.max())
    share = np.maximum(share / share.sum(), 0.02)
    parts = tuple(f.proposal for f in fitted if isinstance(f.proposal, Proposal))
    proposal = MixedProposal(share / share.sum(), parts)
    last = weigh(density, proposal, rng, 4 * ROUND_DRAWS)
    return Adapted(proposal, last, sum(f.evaluations for f in fitted) + 4 * ROUND_DRAWS)


def with_wide_share(adapted: Adapted, share: float = 0.2) -> Adapted:
    """The same proposal with more of its wide component, which bounds the weights in the tails."""
    wider: AnyProposal
    if isinstance(adapted.proposal, MixedProposal):
        parts = tuple(replace(p, share=share) for p in adapted.proposal.parts)
        wider = replace(adapted.proposal, parts=parts)
    else:
        wider = replace(adapted.proposal, share=share)
    return replace(adapted, proposal=wider)


def _adapt_mode(density: Density, mode: Mode, rng: np.random.Generator) -> Adapted:
    linearised = linearised_at(density, mode.z)
    looks = [] if linearised is None else _screened(density, linearised, mode, rng)
    if not looks:
        return _adapt_plain(density, mode, rng)
    proposal, last = looks[0]
    best = Adapted(proposal, last, 0)
    evaluations = FIRST_DRAWS * len(looks)
    if not best.good:  # what a fit to draws learns of a good one is less than what it would lose by chance
        fitted: list[Adapted] = []
        for proposal, _ in looks:
            fitted.append(_refine(density, proposal, rng, ROUND_DRAWS))
            if fitted[-1].good:
                break
        best = max(fitted, key=lambda f: f.weights.efficiency)
        evaluations += sum(f.evaluations for f in fitted)
    return replace(best, evaluations=evaluations)


def _screened(
    density: Density, linearised: Linearised, mode: Mode, rng: np.random.Generator
) -> list[tuple[Proposal, ImportanceSample]]:
    """Proposals as linearising gives them, best first, each with a few draws.

    Other coordinates are looked at where those before do not do. What is drawn is the same in all of them, so that
    they can be compared.
    """
    wide, seed = _wide(mode), rng.integers(2**63)
    looks: list[tuple[Proposal, ImportanceSample]] = []
    for coordinates, narrow in linearised.proposals(mode.covariance, rng):
        proposal = Proposal(coordinates, narrow, wide)
        looks.append((proposal, weigh(density, proposal, np.random.default_rng(seed), FIRST_DRAWS)))
        if looks[-1][1].weights.efficiency >= LINEAR_EFFICIENCY:
            break
    return sorted(looks, key=lambda look: -look[1].weights.efficiency)


def _wide(mode: Mode) -> StudentMixture:
    """Component about a mode with twice its standard deviations, and heavy tails."""
    return StudentMixture.from_covariances(np.ones(1), mode.z[None], 4.0 * mode.covariance[None], 4.0)


def _adapt_plain(density: Density, mode: Mode, rng: np.random.Generator) -> Adapted:
    """One component in the coordinates of the density, and several for what is bent where one does not fit."""
    wide = _wide(mode)
    shape = shape_of(density, mode.covariance)
    centre = shape.coordinates.forward(mode.z[None])[0][0]
    bent = shape.blocks()[-1]
    bend = one_component(centre[bent], shape.covariance[np.ix_(bent, bent)])
    found = _refine(
        density, Proposal(shape.coordinates, shape.mixture(centre, [bend]), wide), rng, draws=2 * ROUND_DRAWS
    )
    if found.weights.efficiency >= GOOD_EFFICIENCY:
        return found
    several = shape.mixture(centre, [spread(bend, rng, 6)])
    more = _refine(density, Proposal(shape.coordinates, several, wide), rng, draws=8 * ROUND_DRAWS)
    better = more if more.weights.efficiency > found.weights.efficiency else found
    return replace(better, evaluations=found.evaluations + more.evaluations)


def _looked_around(density: Density, adapted: Adapted, rng: np.random.Generator) -> Adapted:
    """The same with the greatest weight that walkers meet who set out from its draws by differential evolution.

    A proposal fitted to its own draws can be blind to the end of a bend: no draw gets there, and weights look even.
    """
    own = weigh(density, adapted.proposal, rng, ROUND_DRAWS)
    dimension = own.z.shape[1]
    walkers = max(WALKERS_AND_STEPS[0], 2 * dimension + 2)
    if np.count_nonzero(own.weights.normalised) < walkers:
        return adapted
    start = own.z[rng.choice(len(own.z), size=walkers, replace=False, p=own.weights.normalised)]
    moves = differential_evolution(dimension)
    sampler = EnsembleSampler(walkers, dimension, density.log_prob, moves)
    stream = np.random.RandomState(np.random.MT19937(rng.integers(2**63)))
    state = State(start, random_state=stream.get_state())
    sampler.run_mcmc(state, WALKERS_AND_STEPS[1], skip_initial_state_check=True)
    evaluations = adapted.evaluations + ROUND_DRAWS + walkers * (WALKERS_AND_STEPS[1] + 1)
    met = Adapted(adapted.proposal, own, 0).judged(
        sampler.get_chain(flat=True), sampler.get_log_prob(flat=True)
    )
    return replace(adapted, evaluations=evaluations, greatest_seen=met.greatest_seen)


def _refine(density: Density, proposal: Proposal, rng: np.random.Generator, draws: int) -> Adapted:
    """Rounds of importance draws until the efficiency is good or stays, each fitting the proposal anew.

    A single component that is good is fitted once more, to all draws so far, which costs no evaluation. Several
    are not, and stand on their last round alone: the better they fit draws of their own, the more they lose of a
    bent density that they hardly reach.
    """
    nothing = ImportanceSample(proposal.wide.mean, np.full(1, -np.inf), np.zeros(1))
    best = Adapted(proposal, nothing, 0)
    evaluations = worse = 0
    rounds = _Rounds()
    several = proposal.narrow.components > 1
    for _ in range(MAX_ROUNDS):
        z, log_q, u, back = proposal.draw_with_coordinates(rng, draws)
        last = ImportanceSample.of(density.log_prob, z, log_q)
        weights = last.weights
        evaluations += draws
        worse = 0 if weights.efficiency > 1.1 * best.weights.efficiency else worse + 1
        good = weights.efficiency >= GOOD_EFFICIENCY
        if weights.efficiency > best.weights.efficiency:
            best = Adapted(proposal, last, evaluations)
        if (worse >= 2 and not good) or (good and several):
            break
        rounds.add(last, u, back, alone=several)
        fitted = rounds.fit(proposal)
        if fitted is None:
            break
        if good:
            return Adapted(fitted, last, evaluations)
        proposal = fitted
    return replace(best, evaluations=evaluations)


class _Rounds:
    """Weighted draws of several proposals in the same coordinates, for one density."""

    def __init__(self) -> None:
        self.z: list[Floats] = []
        self.u: list[Floats] = []
        self.weight: list[Floats] = []

    def add(self, drawn: ImportanceSample, u: Floats, back: Bools, alone: bool) -> None:
        """Add a round with its coordinates; if it is to stand alone, or needs tempering, those before are forgotten."""
        weights = drawn.weights
        if alone or weights.efficiency < LEAST_EFFICIENCY:
            self.z, self.u, self.weight = [], [], []
        usable = np.isfinite(weights.log_weight)
        if not usable.any():
            return
        weight = tempered(Weights(weights.log_weight[usable]))
        self.z.append(drawn.z[usable])
        self.u.append(u[usable])
        # draws of a good proposal count for more
        self.weight.append(back[usable] * weight / np.sum(weight**2))

    def fit(self, proposal: Proposal) -> Proposal | None:
        """The proposal fitted to all draws; None where they are too few."""
        if sum(map(len, self.z)) < 2 * proposal.wide.dimension:
            return None
        z, u, weight = np.concatenate(self.z), np.concatenate(self.u), np.concatenate(self.weight)
        if weight.sum() <= 0:
            return None
        weight = weight / weight.sum()
        narrow = proposal.narrow.refitted(u, weight, rounds=3)
        return replace(proposal, narrow=narrow, wide=_widened(proposal.wide, z, weight))


def _widened(wide: StudentMixture, z: Floats, weight: Floats) -> StudentMixture:
    """Wide component with the covariance that it had or four times that of weighted draws, whichever is larger."""
    mean = weight @ z
    centred = z - mean
    covariance = 4.0 * (centred * weight[:, None]).T @ centred
    before = wide.root[0] @ wide.root[0].T * wide.df / (wide.df - 2.0)
    if np.linalg.slogdet(covariance)[1] < np.linalg.slogdet(before)[1]:
        return wide
    return StudentMixture.from_covariances(np.ones(1), mean[None], covariance[None], wide.df)


def weigh(density: Density, proposal: AnyProposal, rng: np.random.Generator, size: int) -> ImportanceSample:
    """Draw from a proposal, and weigh the draws."""
    return ImportanceSample.of(density.log_prob, *proposal.draw(rng, size))
