"""What can be named at best, where the normal distribution tells it."""

from __future__ import annotations

import numpy as np
import pytest
from gap_benchmark.attainable import attainable
from gap_benchmark.hide import hide, noiseless
from scipy.stats import norm

from sma_bayes.studies.gap.name import LEAST_LN_BAYES_FACTOR


def test_an_effect_of_one_number_is_supported_as_often_as_a_normal_variable_is_so_far_out() -> None:
    """Half the square of a normal variable about 5 less a price that is always the same."""
    found = attainable("bias_spring", 5.0)
    price = 0.5 * (5.0**2 + 1.0) - found.ln_bayes_factor
    assert 2.0 < price < 8.0
    least = np.sqrt(2.0 * (LEAST_LN_BAYES_FACTOR + price))
    exact = norm.sf(least - 5.0) + norm.cdf(-least - 5.0)
    assert found.supported == pytest.approx(exact, abs=0.05)
    assert found.named <= found.supported <= found.seen


def test_what_is_strong_is_always_named_and_what_is_weak_is_not() -> None:
    strong, weak = (attainable("amplitude_fatigue", sigma) for sigma in (30.0, 0.5))
    assert strong.named == 1.0
    assert weak.named <= weak.seen < 0.06


def test_readings_without_noise_are_those_of_the_mechanism() -> None:
    case = hide("hot_creep", 10.0)
    plain, noisy = noiseless(case), case.campaign
    difference = np.concatenate([
        a.observed["force"] - b.observed["force"] for a, b in zip(noisy.records, plain.records, strict=True)
    ])  # fmt: skip
    assert np.std(difference) == pytest.approx(case.noise_sd["force"], rel=0.05)
    assert [r.inputs["time"].size for r in plain.records] == [r.inputs["time"].size for r in noisy.records]
