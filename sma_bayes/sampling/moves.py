"""Moves of the ensembles: independence moves and differential evolution that work in batches, and those of emcee.

emcee's `DESnookerMove` is not used: in the released emcee 3.1.6 it samples the wrong density (on an exact
7-dimensional unit Gaussian the variance comes out at 0.65; mended upstream after the release, dfm/emcee#531).
Every move in use has a test that it leaves a Gaussian's mean and variance as they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from emcee.moves import DEMove, Move, StretchMove
from emcee.state import State

from sma_bayes.arrays import Floats
from sma_bayes.sampling.proposals import AnyProposal
from sma_bayes.sampling.weighted import ImportanceSample, resampled_columns


class _Proposing(Move):  # type: ignore[misc]
    """What moves with proposals that do not depend on the walkers have in common.

    Because they do not, those of many steps are drawn and evaluated in one batch. The sampler must be vectorised.

    Parameters
    ----------
    proposal : Proposal or MixedProposal
    steps : int
        Steps whose proposals are evaluated together.
    """

    def __init__(self, proposal: AnyProposal, steps: int) -> None:
        self.proposal = proposal
        self.steps = steps
        self.log_weights: list[Floats] = []
        self.start_block()

    def start_block(self) -> None:
        """Forget what is left of the last batch, so that a block does not depend on how the run got here."""
        self._ahead: list[Any] = []  # what is left of it, a step each
        self._coords: Floats | None = None
        self._log_q: Floats = np.empty(0)

    def _batch(self, model: Any, walkers: int) -> tuple[Floats, Floats, Floats]:
        """Proposals of all steps (S, W, D), their log-probability and the log density of their proposal (S, W)."""
        # what legacy streams draw takes three times as long
        seed = model.random.randint(1 << 32, size=4, dtype=np.uint64)
        drawn = ImportanceSample.of(
            model.log_prob_fn,
            *self.proposal.draw(np.random.Generator(np.random.PCG64(seed)), walkers * self.steps),
        )
        self.log_weights.append(drawn.log_weight)
        shape = (self.steps, walkers)
        return drawn.z.reshape(*shape, -1), drawn.log_prob.reshape(shape), drawn.log_q.reshape(shape)

    def _log_density(self, coords: Floats) -> Floats:
        """Log density of the proposal where the walkers stand, remembered from when they went there."""
        if self._coords is None or not np.array_equal(self._coords, coords):
            self._log_q = self.proposal.log_density(coords)
        return self._log_q

    def _gone(self, coords: Floats, log_prob: Floats, log_q: Floats) -> State:
        """State of walkers that went to points, which are remembered."""
        self._coords, self._log_q = coords, log_q
        # a copy, since other moves change the state in place; the sampler adds the state of its random numbers
        return State(coords.copy(), log_prob=log_prob)


class IndependenceMove(_Proposing):
    """Metropolis-Hastings with proposals that do not depend on where the walkers are.

    A walker at ``z`` goes to ``z'`` with probability ``min(1, w(z')/w(z))``, where ``w`` is the posterior over the
    density of the proposal. It goes well with other moves, step by step. Parameters are those of all such moves.
    """

    def propose(self, model: Any, state: State) -> tuple[State, Any]:
        """One step of every walker; emcee calls this."""
        if not self._ahead:
            self._ahead = list(zip(*self._batch(model, len(state.coords)), strict=True))
        here = self._log_density(state.coords)
        z, log_p, log_q = self._ahead.pop(0)
        with np.errstate(invalid="ignore"):
            gain = (log_p - log_q) - (state.log_prob - here)
        accepted = np.isfinite(log_p) & (np.log(model.random.random(len(gain))) < gain)
        coords = np.where(accepted[:, None], z, state.coords)
        log_prob = np.where(accepted, log_p, state.log_prob)
        return self._gone(coords, log_prob, np.where(accepted, log_q, here)), accepted


class MultipleProposalMove(_Proposing):
    """Every walker chooses its next steps among as many proposals, and where it stands, by their weights.

    Given a walker's S proposals and the point where it stands, not told which is which, the walker stands at each
    of the S + 1 points with probability in proportion to its weight ``w``, the posterior over the density of the
    proposal. So any point that is chosen with these probabilities is a draw from the posterior (Tjelmeland 2004,
    Using all Metropolis-Hastings proposals to estimate mean values, NTNU Statistics preprint 4; Calderhead 2014, PNAS
    111, 17408). S of them are chosen by systematic resampling, which takes each point in as many copies as its weight
    says to within one, and are put in random order, so that each of them has the right probabilities. Of S proposals
    few of average weight are lost, where Metropolis-Hastings rejects some: with S of 14 a fair proposal gives 0.7
    effective draws an evaluation for 0.4. With S of one it gives less.

    A set of proposals serves as many steps, S = `steps`, between which no other move may be made.
    """

    def propose(self, model: Any, state: State) -> tuple[State, Any]:
        """One step of every walker; emcee calls this."""
        if not self._ahead:
            self._ahead = self._choose(model, state)
        coords, log_prob, log_q, moved = self._ahead.pop(0)
        return self._gone(coords, log_prob, log_q), moved

    def _choose(self, model: Any, state: State) -> list[tuple[Floats, Floats, Floats, Any]]:
        """The next steps: points (W, D), their log-probability, log density of the proposal, whether they are new."""
        proposed = self._batch(model, len(state.coords))
        here = state.coords, state.log_prob, self._log_density(state.coords)
        z, log_p, log_q = (np.concatenate([a[None], b]) for a, b in zip(here, proposed, strict=True))
        with np.errstate(invalid="ignore"):
            log_w = np.where(np.isfinite(log_p), log_p - log_q, -np.inf)
        chosen = resampled_columns(log_w, self.steps, model.random)
        moved = np.diff(chosen, axis=0, prepend=0) != 0
        walker = np.arange(log_w.shape[1])
        return list(zip(z[chosen, walker], log_p[chosen, walker], log_q[chosen, walker], moved, strict=True))


class DifferentialEvolutionMove(Move):  # type: ignore[misc]
    """Differential evolution of ensembles side by side, each walker by the difference of two others of its ensemble.

    As emcee's `DEMove` does it: half of the walkers move by differences of the other half, then the other way round.
    Which walkers are a half is drawn anew for every step. All ensembles are evaluated in one batch, which takes a third
    of the time of one after the other; nothing but the choice of the move is common to them. The sampler must be
    vectorised.

    Parameters
    ----------
    ensembles : int
        Of as many walkers each, which follow each other.
    length : float
        Of a step, over the difference.
    """

    def __init__(self, ensembles: int, length: float) -> None:
        self.ensembles = ensembles
        self.length = length

    def propose(self, model: Any, state: State) -> tuple[State, Any]:
        """One step of every walker; emcee calls this."""
        random, dimension = model.random, state.coords.shape[1]
        shape = (self.ensembles, len(state.coords) // self.ensembles)
        first_of_each = shape[1] * np.arange(self.ensembles)[:, None]
        halves = np.array_split(first_of_each + np.argsort(random.random(shape), axis=1), 2, axis=1)
        coords, log_prob = state.coords.copy(), state.log_prob.copy()
        moved = np.zeros(len(coords), dtype=bool)
        for own, others in (halves, halves[::-1]):
            one = random.randint(others.shape[1], size=own.shape)
            other = (one + random.randint(1, others.shape[1], size=own.shape)) % others.shape[1]
            one, other = (np.take_along_axis(others, at, axis=1).ravel() for at in (one, other))
            here = own.ravel()
            length = self.length * (1.0 + JITTER * random.standard_normal((here.size, 1)))
            there = coords[here] + length * (coords[one] - coords[other]).reshape(-1, dimension)
            log_there = model.log_prob_fn(there)
            accepted = np.log(random.random(here.size)) < log_there - log_prob[here]
            at = here[accepted]
            coords[at], log_prob[at], moved[at] = there[accepted], log_there[accepted], True
        return State(coords, log_prob=log_prob), moved


JITTER = 1e-4
"""Relative standard deviation of the length of a step of differential evolution."""


def _lengths(dimension: int) -> list[tuple[float, float]]:
    """Lengths of steps of differential evolution, over the difference of two walkers, with their shares.

    One in ten uses the full difference, which carries walkers from one mode to another (ter Braak 2006, Statistics and
    Computing 16, 239).
    """
    return [(2.38 / np.sqrt(2.0 * dimension), 0.9), (1.0, 0.1)]


def differential_evolution(dimension: int) -> list[tuple[Move, float]]:
    """Differential-evolution moves of emcee with their shares, for one ensemble."""
    return [(DEMove(sigma=JITTER, gamma0=length), share) for length, share in _lengths(dimension)]


def differential_evolution_of(ensembles: int, dimension: int) -> list[tuple[Move, float]]:
    """The same for ensembles side by side."""
    return [(DifferentialEvolutionMove(ensembles, length), share) for length, share in _lengths(dimension)]


def stretch(dimension: int) -> list[tuple[Move, float]]:
    """The stretch move of emcee (Goodman and Weare 2010, Comm. App. Math. Comp. Sci. 5, 65), whatever the dimension."""
    return [(StretchMove(), 1.0)]


@dataclass(frozen=True, slots=True)
class Sampler:
    """What makes the draws of a posterior.

    Attributes
    ----------
    name : str
        By which it is asked for.
    title : str
        In words.
    moves : callable or None
        Moves with their shares for a number of dimensions, from dispersed starts; None for independence moves with all
        that stands behind them.
    """

    name: str
    title: str
    moves: Callable[[int], list[tuple[Move, float]]] | None = field(
        repr=False
    )  # a run is told apart by the name


SAMPLERS: Final = {
    sampler.name: sampler
    for sampler in (
        Sampler("independence", "independence", None),
        Sampler("de", "differential evolution", differential_evolution),
        Sampler("stretch", "stretch", stretch),
    )
}
"""Samplers by name; `independence` is the default, the others are there to cross-check it."""
