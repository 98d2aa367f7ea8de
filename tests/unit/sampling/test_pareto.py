"""Smoothed importance weights, against arviz and against a case with a closed form."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import logsumexp

from sma_bayes.arviz_bridge import arviz
from sma_bayes.sampling.pareto import pareto_fit, smoothed_weights


def pareto_smoothing_of_arviz(log_ratio: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Logarithms of weights (n, S) and exponents (n,), from where each generation of arviz keeps them."""
    az = arviz()
    if hasattr(az, "psislw"):
        return az.psislw(log_ratio.T)
    from arviz_stats.base import array_stats

    return array_stats.psislw(-log_ratio, axis=0)  # 1.x takes log likelihoods, the negative of ratios


@pytest.mark.parametrize("tail", [0.1, 0.5, 0.9])
def test_weights_and_k_are_those_of_arviz(tail: float) -> None:
    rng = np.random.default_rng(1)
    # the tail has 3 sqrt(S) draws, which arviz 0.23 and we round up, arviz 1.x down: S with a whole root suits all
    ratio = tail * rng.standard_exponential(
        (2500, 6)
    )  # exponentials of these have a Pareto tail of that exponent
    expected, k_expected = pareto_smoothing_of_arviz(ratio)
    found, k = smoothed_weights(ratio)
    np.testing.assert_allclose(k, k_expected, atol=1e-8)
    np.testing.assert_allclose(found.T, expected, atol=1e-6)


def test_it_recovers_the_exponent_and_weights_sum_to_one() -> None:
    rng = np.random.default_rng(2)
    ratio = np.array([0.2, 0.5, 0.8]) * rng.standard_exponential((40000, 3))
    weight, k = smoothed_weights(ratio)
    np.testing.assert_allclose(k, [0.2, 0.5, 0.8], atol=0.1)
    np.testing.assert_allclose(logsumexp(weight, axis=0), 0.0, atol=1e-12)


def test_equal_ratios_stay_equal_and_few_draws_are_not_trusted() -> None:
    weight, k = smoothed_weights(np.zeros((1000, 2)))
    assert np.all(k == -np.inf)
    np.testing.assert_allclose(weight, -np.log(1000.0))
    assert np.all(smoothed_weights(np.arange(8.0)[:, None])[1] == np.inf)


def test_the_fit_of_an_exponential_has_shape_nought() -> None:
    x = np.sort(np.random.default_rng(3).exponential(2.0, (4000, 1)), axis=0)
    k, scale = pareto_fit(x)
    assert k[0] == pytest.approx(0.0, abs=0.05)
    assert scale[0] == pytest.approx(2.0, rel=0.05)
