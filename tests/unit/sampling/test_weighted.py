"""Weighted draws against draws that are repeated as often as their weights say."""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.sampling.weighted import resampled, weighted_quantiles


@pytest.mark.parametrize("constant", [0.0, -1e4, 1e4])
def test_resampling_gives_every_draw_its_share(constant: float) -> None:
    """Systematic resampling takes each draw its expected number of times, rounded up or down."""
    rng = np.random.default_rng(8)
    weight = rng.dirichlet(np.ones(30))
    taken = np.bincount(resampled(np.log(weight) + constant, 1000, rng), minlength=30)
    assert taken.sum() == 1000
    assert np.all(np.abs(taken - 1000 * weight) < 1.0)


def test_draws_without_weight_are_not_taken() -> None:
    log_weight = np.array([-np.inf, 0.0, -np.inf, 0.0, -np.inf])
    for seed in range(20):
        assert set(resampled(log_weight, 7, np.random.default_rng(seed)).tolist()) == {1, 3}


def test_weighted_quantiles_are_those_of_repeated_draws() -> None:
    rng = np.random.default_rng(0)
    values, count = rng.normal(size=(500, 3)), rng.integers(1, 9, 500)
    found = weighted_quantiles(values, np.log(count / count.sum()), (0.05, 0.5, 0.95))
    expected = np.quantile(np.repeat(values, count, axis=0), (0.05, 0.5, 0.95), axis=0, method="inverted_cdf")
    np.testing.assert_array_equal(found, expected)


def test_undefined_values_count_as_the_greatest() -> None:
    values = np.array([[np.nan], [3.0], [1.0], [2.0]])
    found = weighted_quantiles(values, np.log(np.full(4, 0.25)), (0.25, 0.75, 1.0))
    np.testing.assert_array_equal(found[:, 0], [1.0, 3.0, np.nan])
