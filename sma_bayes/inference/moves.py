"""Moves of the ensembles: an independence move that works in batches, and differential evolution beside it.

emcee's `DESnookerMove` is not used: in the released emcee 3.1.6 it samples the wrong density (on an exact
7-dimensional unit Gaussian the variance comes out at 0.65; mended upstream after the release, dfm/emcee#531).
Every move in use has a test that it leaves a Gaussian's mean and variance as they are.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from emcee.moves import DEMove, Move
from emcee.state import State

from sma_bayes.inference.proposals import AnyProposal
from sma_bayes.quantities import Floats


class IndependenceMove(Move):  # type: ignore[misc]
    """Metropolis-Hastings with proposals that do not depend on where the walkers are.

    A walker at ``z`` goes to ``z'`` with probability ``min(1, w(z')/w(z))``, where ``w`` is the posterior over the
    density of the proposal. Because proposals do not depend on the walkers, those of many steps are drawn and
    evaluated in one batch. The sampler must be vectorised.

    Parameters
    ----------
    proposal : Proposal or MixedProposal
    steps : int
        Steps whose proposals are evaluated together.
    """

    def __init__(self, proposal: AnyProposal, steps: int) -> None:
        self.proposal = proposal
        self.steps = steps
        self._pool: list[tuple[Floats, Floats, Floats]] = []
        self._coords: Floats | None = None
        self._log_q: Floats = np.empty(0)
        self.log_weights: list[Floats] = []

    def start_block(self) -> None:
        """Forget what is left of the last batch, so that a block does not depend on how the run got here."""
        self._pool = []
        self._coords = None

    def _refill(self, model: Any, walkers: int) -> None:
        size = walkers * self.steps
        z, log_q = self.proposal.draw(model.random, size)
        usable = np.isfinite(log_q)
        log_p = np.full(size, -np.inf)
        if usable.any():
            log_p[usable] = model.log_prob_fn(z[usable])
        log_w = np.full(size, -np.inf)
        log_w[usable] = log_p[usable] - log_q[usable]
        self.log_weights.append(log_w)
        self._pool = [
            (z[i : i + walkers], log_p[i : i + walkers], log_q[i : i + walkers])
            for i in range(0, size, walkers)
        ]

    def propose(self, model: Any, state: State) -> tuple[State, Any]:
        """One step of every walker; emcee calls this."""
        walkers = len(state.coords)
        if not self._pool:
            self._refill(model, walkers)
        if self._coords is None or not np.array_equal(self._coords, state.coords):
            self._log_q = self.proposal.log_density(state.coords)
        z, log_p, log_q = self._pool.pop(0)
        with np.errstate(invalid="ignore"):
            gain = (log_p - log_q) - (state.log_prob - self._log_q)
        accepted = np.isfinite(log_p) & (np.log(model.random.random(walkers)) < gain)
        coords = np.where(accepted[:, None], z, state.coords)
        self._log_q = np.where(accepted, log_q, self._log_q)
        self._coords = coords
        log_prob = np.where(accepted, log_p, state.log_prob)
        # a copy, since other moves change the state in place; the sampler adds the state of its random numbers
        return State(coords.copy(), log_prob=log_prob), accepted


def differential_evolution(dimension: int) -> list[tuple[Move, float]]:
    """Differential-evolution moves with their shares.

    One in ten uses the full difference of two walkers, which carries walkers from one mode to another
    (ter Braak 2006, Statistics and Computing 16, 239).
    """
    jitter = 1e-4
    return [
        (DEMove(sigma=jitter, gamma0=2.38 / np.sqrt(2.0 * dimension)), 0.9),
        (DEMove(sigma=jitter, gamma0=1.0), 0.1),
    ]
