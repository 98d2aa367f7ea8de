"""emcee's sampler, for densities of many points at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import emcee
import numpy as np
from emcee.moves import Move

from sma_bayes.arrays import Floats


class EnsembleSampler(emcee.EnsembleSampler):  # type: ignore[misc]
    """emcee's sampler, less what it does besides sampling.

    What a density raises, such as the end that a signal asks for, passes as it is: emcee would print all positions and
    a traceback before. The state of the random numbers is not copied to the state of every step, which took as long as
    a move does; it is read once a block instead.

    Parameters
    ----------
    walkers, dimension : int
    log_prob : callable
        Log density (W,) of points (W, D).
    moves : sequence of tuple of Move and float
        With their weights.
    """

    _stream = emcee.EnsembleSampler.random_state
    random_state = property(lambda _: None, _stream.fset)

    def __init__(
        self,
        walkers: int,
        dimension: int,
        log_prob: Callable[[Floats], Floats],
        moves: Sequence[tuple[Move, float]],
    ) -> None:
        super().__init__(walkers, dimension, log_prob, moves=moves, vectorize=True)
        self.log_prob_fn = log_prob

    def seed_stream(self, seed: np.random.SeedSequence) -> None:
        """Begin its random numbers anew."""
        self._random.seed(seed.generate_state(8))

    def stream_state(self) -> tuple[Any, ...]:
        """State of the random numbers, as `numpy.random.RandomState.get_state` gives it."""
        state: tuple[Any, ...] = self._stream
        return state
