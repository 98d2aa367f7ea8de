"""Posterior simulation-based calibration: right fits pass as often as is stated, wrong draws are seen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

import sma_bayes
from sma_bayes.assess.draws import RecordDraws, record_draws
from sma_bayes.assess.rank_uniformity import FALSE_ALARMS
from sma_bayes.records.types import Campaign, Record
from sma_bayes.studies.fit.self_check import checked

pytestmark = pytest.mark.slow


def _draws(make_record: Callable[..., Record], seed: int) -> RecordDraws:
    record = make_record(n=40, channels=("force",), seed=seed)
    campaign = Campaign("spring", "spring", "0" * 64, (record,))
    (fit,) = sma_bayes.fit(campaign, noise="independent", jobs=1).values()
    return record_draws(fit)


@pytest.mark.thorough
def test_right_fits_pass(make_record: Callable[..., Record]) -> None:
    """20 records: more than 2 false alarms have a probability of 1 in 1000 at the stated rate of 1 %."""
    alarms = sum(
        not next(iter(checked([(_draws(make_record, seed), False)], 200, seed, jobs=1))).passed
        for seed in range(20)
    )
    assert alarms <= binom.isf(1e-3, 20, FALSE_ALARMS)


@pytest.mark.parametrize(("width", "shift", "replicates"), [(0.6, 0.0, 250), (1.0, 0.5, 160)])
def test_wrong_draws_of_a_fit_are_seen(
    make_record: Callable[..., Record], width: float, shift: float, replicates: int
) -> None:
    """Narrowed about the median, or shifted by half their standard deviation, while refits are right."""
    draws = _draws(make_record, 0)
    space = draws.posterior.space
    z = space.unconstrain(draws.theta)
    middle, sd = np.median(z, axis=0), z.std(axis=0)
    wrong = space.constrain(middle + width * (z - middle) + shift * sd)
    (seen,) = checked([(replace(draws, theta=wrong), False)], replicates, 0, jobs=1)
    assert not seen.passed
    assert any(not q.uniform for q in seen.quantities)
