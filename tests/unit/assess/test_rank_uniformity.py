"""Ranks of truths: right ones pass as often as is stated, narrowed and shifted draws are seen."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from sma_bayes.assess.rank_uniformity import (
    FALSE_ALARMS,
    band_half_width,
    places,
    rejected,
    uniformity,
)

QUANTITIES = 5


def _passes(u: np.ndarray) -> bool:
    each = [uniformity(u[:, k]) for k in range(u.shape[1])]
    return not rejected(np.array([one.p_values for one in each])).any()


def test_uniform_ranks_fail_no_more_often_than_is_stated() -> None:
    """600 records: 6 false alarms are allowed; more than 15 has a probability of 1 in 1000 at that rate."""
    rng = np.random.default_rng(0)
    alarms = sum(not _passes(rng.random((300, QUANTITIES))) for _ in range(600))
    assert alarms <= stats.binom.isf(1e-3, 600, FALSE_ALARMS)


@pytest.mark.parametrize(("width", "shift"), [(0.6, 0.0), (1.6, 0.0), (1.0, 0.5), (1.0, -0.5)])
def test_draws_of_the_wrong_width_or_place_are_seen(width: float, shift: float) -> None:
    """Of one quantity among others that are right, in each of 20 records."""
    rng = np.random.default_rng(1)
    for _ in range(20):
        u = rng.random((300, QUANTITIES))
        u[:, 2] = stats.norm.cdf((rng.standard_normal(300) + shift) / width)
        assert not _passes(u)


def test_shift_and_spread_are_those_of_normal_truths() -> None:
    rng = np.random.default_rng(2)
    found = uniformity(stats.norm.cdf(0.3 + 1.4 * rng.standard_normal(20000)))
    assert found.shift == pytest.approx(0.3, abs=0.04)
    assert found.spread == pytest.approx(1.4, abs=0.03)
    share = found.coverage[1]
    exact = stats.binomtest(round(20000 * share.share), 20000).proportion_ci(0.95, method="exact")
    assert (share.low, share.high) == pytest.approx((exact.low, exact.high))
    inside = stats.norm.cdf((1.6449 - 0.3) / 1.4) - stats.norm.cdf((-1.6449 - 0.3) / 1.4)
    assert found.coverage[1].low < inside < found.coverage[1].high


@pytest.mark.parametrize("size", [7, 200])
def test_places_among_few_draws_are_uniform_all_the_same(size: int) -> None:
    """The truth is exchangeable with the draws; p-values of a right method are below 1e-3 in one seed of 1000."""
    rng = np.random.default_rng(3)
    equal = np.full(size, -np.log(size))
    u = np.stack([places(rng.standard_normal((1 + size, 2)), equal, rng) for _ in range(2000)])
    assert min(stats.kstest(u[:, k], "uniform").pvalue for k in (0, 1)) > 1e-3
    assert u.min() > 0.0
    assert u.max() < 1.0


def test_the_distance_has_the_distribution_of_kolmogorov() -> None:
    u = np.random.default_rng(6).random(60)
    assert uniformity(u).p_values[2] == pytest.approx(stats.kstest(u, "uniform").pvalue, abs=0.02)
    assert band_half_width(60, 5, 0.05) == pytest.approx(stats.kstwo.isf(0.01, 60), rel=0.01)


def test_what_is_not_defined_is_ordered_by_chance() -> None:
    rng = np.random.default_rng(4)
    values = np.full((11, 1), np.nan)
    values[:4] = np.arange(4.0)[:, None]  # the truth is the least of three defined ones; seven are not
    assert places(values, np.full(10, -np.log(10)), rng)[0] < 1.0 / 11.0
    values[0] = np.nan
    u = [places(values, np.full(10, -np.log(10)), rng)[0] for _ in range(200)]
    assert min(u) > 3.0 / 11.0 - 1e-12


def test_the_band_holds_uniform_ranks() -> None:
    rng = np.random.default_rng(5)
    half = band_half_width(100, QUANTITIES, 0.1)
    far = 0
    for _ in range(400):
        u = np.sort(rng.random((100, QUANTITIES)), axis=0)
        steps = np.arange(101)[:, None] / 100
        far += bool(max((steps[1:] - u).max(), (u - steps[:-1]).max()) > half)
    assert far <= stats.binom.isf(1e-3, 400, 0.1)
