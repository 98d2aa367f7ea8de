"""False alarms of a watch in 10,000 quiet cycles, over all numbers and looks together."""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.studies.watch.evidence import Watched, log_evidence

SPRINGS, CYCLES, FITTED, NUMBERS = 200, 50, 4, 20
ALPHA = 0.05

pytestmark = pytest.mark.slow


def _draws(rng: np.random.Generator, df: float, shape: tuple[int, ...]) -> np.ndarray:
    return rng.standard_normal(shape) if np.isinf(df) else rng.standard_t(df, shape)


@pytest.mark.parametrize("df", [np.inf, 5.0, 3.0], ids=["normal", "t5", "t3"])
def test_false_alarms_in_ten_thousand_quiet_cycles(df: float) -> None:
    """200 springs of 50 cycles, 20 numbers that scatter together (correlations of 0.5), each looked at every cycle.

    At most 10 springs with an alarm are stated. More than 20 would be chance once in 600 runs at that rate; the seed is
    fixed. Without values held to a bound scatter of heavy tails gave 15 (t5) and 98 (t3).
    """
    rng = np.random.default_rng(11)
    n = FITTED + CYCLES
    common = _draws(rng, df, (n, SPRINGS, 1))
    value = np.sqrt(0.5) * (common + _draws(rng, df, (n, SPRINGS, NUMBERS)))
    value = value * rng.lognormal(0.0, 2.0, (SPRINGS, NUMBERS)) + rng.normal(0.0, 10.0, (SPRINGS, NUMBERS))
    flat = value.reshape(n, -1)
    evidence = log_evidence(Watched(flat, np.ones(n), FITTED, (np.ones((n, 1)),)))
    greatest = evidence.max(axis=0).reshape(SPRINGS, NUMBERS).max(axis=1)
    alarms = int(np.sum(greatest >= np.log(NUMBERS / ALPHA)))
    assert SPRINGS * CYCLES == 10_000
    assert alarms <= 20
