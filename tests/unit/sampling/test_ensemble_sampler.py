"""emcee's sampler as it is used here: the same chain, and nothing printed where a density ends it."""

from __future__ import annotations

import emcee
import numpy as np
import pytest
from emcee.moves import StretchMove
from emcee.state import State

from sma_bayes.interruption import Interrupted
from sma_bayes.sampling.ensemble_sampler import EnsembleSampler

START = np.random.default_rng(0).standard_normal((12, 3))
MOVES = [(StretchMove(), 1.0)]


def normal(z: np.ndarray) -> np.ndarray:
    return -0.5 * np.sum(z**2, axis=1)


def test_the_chain_is_that_of_emcee_to_the_bit() -> None:
    stream = np.random.RandomState(3).get_state()
    chains = []
    for sampler in (
        EnsembleSampler(12, 3, normal, MOVES),
        emcee.EnsembleSampler(12, 3, normal, moves=MOVES, vectorize=True),
    ):
        sampler.run_mcmc(State(START, random_state=stream), 50)
        chains.append(sampler.get_chain())
    np.testing.assert_array_equal(*chains)


@pytest.mark.parametrize("raised", [Interrupted, KeyboardInterrupt, FloatingPointError])
def test_what_a_density_raises_passes_without_a_word(
    raised: type[BaseException], capfd: pytest.CaptureFixture[str]
) -> None:
    """emcee prints all positions and a traceback: somebody who pressed Ctrl-C saw a screen full of numbers."""
    calls = 0

    def ended(z: np.ndarray) -> np.ndarray:
        nonlocal calls
        calls += 1
        if calls > 5:
            raise raised
        return normal(z)

    with pytest.raises(raised):
        EnsembleSampler(12, 3, ended, MOVES).run_mcmc(START, 50)
    assert tuple(capfd.readouterr()) == ("", "")
