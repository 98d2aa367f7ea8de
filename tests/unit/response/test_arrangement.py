"""The spring with its bias spring, Eq. (8)."""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.response.arrangement import (
    BIAS_STIFFNESS,
    BIAS_STIFFNESS_SD,
    Arrangement,
    overall_stiffness,
)

K1 = np.array([50.0, 130.0, 400.0])


@pytest.mark.parametrize(
    ("arrangement", "expected"),
    [
        (Arrangement.PUBLISHED_DIFFERENCE, [-80.0, 0.0, 270.0]),
        (Arrangement.PARALLEL, [180.0, 260.0, 530.0]),
        (Arrangement.SERIES, [50.0 * 130.0 / 180.0, 65.0, 400.0 * 130.0 / 530.0]),
    ],
)
def test_arrangements(arrangement: Arrangement, expected: list[float]) -> None:
    np.testing.assert_allclose(
        overall_stiffness(K1, np.array(BIAS_STIFFNESS), arrangement), expected, rtol=1e-15
    )


@pytest.mark.parametrize("arrangement", list(Arrangement))
def test_draws_of_both_springs_broadcast(arrangement: Arrangement) -> None:
    k1 = np.tile(K1, (5, 1))
    k2 = BIAS_STIFFNESS + BIAS_STIFFNESS_SD * np.random.default_rng(0).standard_normal((5, 1))
    every = overall_stiffness(k1, k2, arrangement)
    assert every.shape == (5, 3)
    np.testing.assert_array_equal(every[2], overall_stiffness(K1, k2[2], arrangement))


@pytest.mark.parametrize("k1", [0.0, np.inf])
def test_the_limits_of_two_springs_end_to_end(k1: float) -> None:
    """A spring that gives way carries nothing; beside a rigid one only the other moves."""
    with np.errstate(divide="ignore"):
        found = float(overall_stiffness(np.array(k1), np.array(130.0), Arrangement.SERIES))
    assert found == (0.0 if k1 == 0.0 else 130.0)


def test_the_bias_spring_is_that_of_table_2_with_a_stated_uncertainty() -> None:
    assert BIAS_STIFFNESS == 130.0
    assert pytest.approx(0.05 * BIAS_STIFFNESS) == BIAS_STIFFNESS_SD


def test_arrangements_are_known_by_name() -> None:
    assert [a.value for a in Arrangement] == ["published_difference", "parallel", "series"]
    assert Arrangement("parallel") is Arrangement.PARALLEL
