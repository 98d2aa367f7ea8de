"""Springs that train by two processes, which no law of the package is: what is forecast, and 'stable from'."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
import pytest

from sma_bayes.records.types import Branch
from sma_bayes.studies.cycles.study import changes, pool, probability_stable
from sma_bayes.studies.cycles.sweeps import fit_strand, sweeps_of

REPEATS = 12
CYCLES, SEEN = 100, 30
SHARE, PROBABILITY = 0.01, 0.9
CHANNEL = "displacement"


@pytest.fixture(scope="module")
def outcome(training_spring: ModuleType) -> dict[str, Any]:
    """Thirty cycles measured, seventy forecast: whether curves are covered, and claims of stability true."""
    t = np.linspace(20.0, 95.0, 60)
    covered: dict[int, list[float]] = {SEEN: [], SEEN + 9: [], CYCLES - 1: []}
    claims, laws = [], []
    for seed in range(REPEATS):
        rng = np.random.default_rng(seed)
        truth = training_spring.draw_truth(rng, CYCLES)
        seen = training_spring.Truth(truth.state, {b: v[:SEEN] for b, v in truth.sweep.items()})
        strands = []
        for record in training_spring.measured(seen, rng):
            sweeps, cycle, _ = sweeps_of(record, CHANNEL)
            strands.append(fit_strand(sweeps, CHANNEL, cycle, "modified_sigmoid", 0))
        pooled = pool(strands, CYCLES - SEEN, seed, 1000)
        laws.append(pooled.posterior.chosen)
        for place, strand in enumerate(strands):
            for k, found in covered.items():
                curve = strand.curve(pooled.numbers(place)[:, k], t, pooled.errors[place])
                low, high = np.quantile(curve, [0.05, 0.95], axis=0)
                true = training_spring.curve(
                    truth.sweep[strand.record.branch][k], t, strand.record.branch, CHANNEL
                )
                found.append(float(np.mean((low <= true) & (true <= high))))
        stable = np.flatnonzero(probability_stable(changes(pooled), SHARE) >= PROBABILITY)
        if stable.size:
            claims.append(bool(true_changes(training_spring, truth)[stable[0] :].max() <= SHARE))
    return {"covered": covered, "claims": claims, "laws": laws}


def true_changes(spring: ModuleType, truth: Any) -> np.ndarray:
    """Greatest change of either curve to the next cycle, over the stroke."""
    t = np.linspace(20.0, 95.0, 60)
    each = [
        np.abs(np.diff(spring.curve(truth.state[b], t, b, CHANNEL), axis=0)).max(axis=1)
        / spring.STROKE[CHANNEL]
        for b in Branch
    ]
    return np.asarray(np.max(each, axis=0))


@pytest.mark.slow
def test_forecasts_cover(outcome: dict[str, Any]) -> None:
    """Mean share of 24 curves that is within 90 % intervals.

    That of one curve scatters by some 0.2 (its points go together), the mean by 0.04. For the next ten cycles 0.8 is
    two and a half of these below 0.9, a false alarm once in 160 runs; the seeds are fixed. Seventy cycles on, where the
    laws are not the truth, the intervals hold less than they say; docs/howto/follow_cycles.md states it, and 0.65 is
    what must hold.
    """
    near, later, far = (np.mean(values) for values in outcome["covered"].values())
    assert near > 0.8
    assert later > 0.8
    assert far > 0.65


@pytest.mark.slow
def test_springs_that_are_called_stable_are(outcome: dict[str, Any]) -> None:
    """Each claim is wrong with a probability of 0.1: more than 4 of 12 once in 230 runs."""
    claims = outcome["claims"]
    assert len(claims) >= 4
    assert sum(not right for right in claims) <= 4
    assert set(outcome["laws"]) <= {"exponential", "stretched", "logarithmic"}
