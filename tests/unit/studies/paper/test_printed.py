"""Trends of the printed tables, against least squares and closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.paper.extremes import TABLE_9, TABLE_10, TABLE_12
from sma_bayes.studies.paper.printed import printed_effects, probability_positive, repeat_scatter


def test_the_change_with_current_is_that_of_a_straight_line() -> None:
    """Four tests: 1 A, 1.5 A and two at 2 A."""
    current = np.array([1.0, 1.5, 2.0, 2.0])
    greatest = np.log([146.54, 159.07, 180.26, 169.58])
    slope = np.polyfit(current, greatest, 1)[0]
    effect = printed_effects(TABLE_9)["greatest_stiffness"]
    assert effect.tested is not None
    assert effect.tested["median"] == pytest.approx(np.exp(slope))
    assert {c.other for c in effect.confounders if c.strong} == {"peak_temperature", "mean_power"}


def test_more_scatter_makes_a_trend_less_sure() -> None:
    """Loads: the greatest stiffness levels off, the mean slope rises evenly."""
    effects = printed_effects(TABLE_10)
    probability = {name: effects[name].probability_rises or 0.0 for name in effects}
    assert 0.5 < probability["greatest_stiffness"] < probability["mean_slope"] < 1.0


def test_what_is_lost_is_left_out() -> None:
    assert not [name for name in printed_effects(TABLE_12) if "stiffness" in name or "slope" in name]


def test_a_contrast_is_judged_by_students_t_of_one_degree_of_freedom() -> None:
    """Against a sample of the posterior: scatter of one known difference under the prior 1/sigma."""
    rng = np.random.default_rng(1)
    difference = 3.0
    sigma = difference / np.sqrt(2.0) / np.abs(rng.standard_normal(400_000))
    weights = (1.0, -2.0, 1.0)
    truth = 4.0 + sigma * np.sqrt(6.0) * rng.standard_normal(sigma.size)
    found = probability_positive(4.0, weights, difference / np.sqrt(2.0))
    assert found == pytest.approx(np.mean(truth > 0.0), abs=0.003)
    assert repeat_scatter("stiffness_max") == pytest.approx((180.26 - 169.58) / 2**0.5)
