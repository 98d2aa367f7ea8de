"""Evidence of a change, against normal densities written out, and its rate of false alarms."""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.studies.watch.evidence import (
    RAMP,
    SHAPES,
    SIZES,
    STEP,
    Watched,
    course,
    evidence_after,
    log_evidence,
    log_ratios,
    onset,
)

FITTED, LATER = 4, 6


def marginal(y: np.ndarray, covariance: np.ndarray, x: np.ndarray) -> float:
    """Log of the integral of the normal density over beta and d sigma / sigma, but for what both hypotheses share."""
    inverse = np.linalg.inv(covariance)
    gram = x.T @ inverse @ x
    beta = np.linalg.solve(gram, x.T @ inverse @ y)
    left = (y - x @ beta) @ inverse @ (y - x @ beta)
    spare = len(y) - x.shape[1]
    return float(
        -0.5 * np.linalg.slogdet(covariance)[1]
        - 0.5 * np.linalg.slogdet(gram)[1]
        - 0.5 * spare * np.log(left)
    )


def two_designs(n: int) -> tuple[np.ndarray, ...]:
    return np.ones((n, 1)), np.column_stack([np.ones(n), -np.expm1(-np.arange(n) / 3.0)])


@pytest.mark.parametrize("design", [0, 1])
@pytest.mark.parametrize("later", [1, 3, LATER])
def test_ratios_are_those_of_the_densities(design: int, later: int) -> None:
    n = FITTED + LATER
    y = np.random.default_rng(0).standard_normal((n, 3))
    w = np.array([1.0, 1.0, 1.0, 1.0, 0.5, 1.0, 1.0, 0.7, 1.0, 1.0])
    x = two_designs(n)[design]
    found = log_ratios(Watched(y, w, FITTED, (x,)), x, later)
    end = FITTED + later
    for k in range(3):
        for begins in range(later):
            place = 0
            for shape in SHAPES:
                since = np.maximum(np.arange(end) - (FITTED + begins) + 1.0, 0.0)
                g = (since > 0.0).astype(float) if shape == STEP else since
                for size in SIZES[shape]:
                    null = np.diag(1.0 / w[:end])
                    changed = null + size**2 * np.outer(g, g)
                    expected = marginal(y[:end, k], changed, x[:end]) - marginal(y[:end, k], null, x[:end])
                    assert found[begins, place, k] == pytest.approx(expected, abs=1e-8)
                    place += 1


def test_evidence_depends_on_neither_level_nor_scale() -> None:
    rng = np.random.default_rng(1)
    y, ones = rng.standard_normal((20, 2)), np.ones(20)
    once = log_evidence(Watched(y, ones, 3, (ones[:, None],)))
    again = log_evidence(Watched(5.0 + 1e-4 * y, ones, 3, (ones[:, None],)))
    np.testing.assert_allclose(once, again, atol=1e-6)


def test_evidence_after_a_cycle_does_not_change_when_others_follow() -> None:
    y, ones = np.random.default_rng(2).standard_normal((15, 4)), np.ones(15)
    whole = Watched(y, ones, 3, two_designs(15))
    every = log_evidence(whole)
    np.testing.assert_array_equal(every[5:], log_evidence(whole, 5))
    np.testing.assert_array_equal(every[6], evidence_after(whole, 7))
    part = Watched(y[:10], ones[:10], 3, tuple(d[:10] for d in whole.designs))
    np.testing.assert_array_equal(every[:7], log_evidence(part))


def test_the_least_of_several_laws_counts() -> None:
    """A trend that one of the laws has is no change, although it is one against a constant."""
    n = 30
    designs = two_designs(n)
    y = (5.0 * designs[1][:, 1] + 0.01 * np.random.default_rng(3).standard_normal(n))[:, None]
    alone = [log_evidence(Watched(y, np.ones(n), 3, (d,))) for d in designs]
    both = log_evidence(Watched(y, np.ones(n), 3, designs))
    np.testing.assert_array_equal(both, np.minimum(*alone))
    assert alone[0].max() > 5.0
    assert both.max() < 2.0


def test_one_fitted_cycle_tells_nothing_with_the_first_that_is_watched() -> None:
    """Two values have no scatter to be compared with, whatever they are."""
    y = np.array([[0.0], [1e6]])
    assert log_evidence(Watched(y, np.ones(2), 1, (np.ones((2, 1)),)))[0, 0] == pytest.approx(0.0, abs=1e-12)


def test_equal_values_are_no_evidence() -> None:
    found = log_evidence(Watched(np.full((9, 1), 3.0), np.ones(9), 4, (np.ones((9, 1)),)))
    assert np.all(found <= 1e-12)


@pytest.mark.parametrize("fitted", [1, 4])
def test_false_alarms_are_rarer_than_stated_and_evidence_is_one_on_average(fitted: int) -> None:
    """1,500 numbers for 40 cycles each. At 0.1: 150 alarms are allowed, and sup e >= 10 is rarer than that.

    With 150 expected at most, 185 (3 sd more) would be a failure of chance once in 700 times; the seed is fixed. The
    mean of e after the fourth cycle is 1 by construction; only that it is not far above is looked at.
    """
    rng = np.random.default_rng(5)
    many, n = 1500, fitted + 40
    found = log_evidence(Watched(rng.standard_normal((n, many)), np.ones(n), fitted, (np.ones((n, 1)),)))
    assert np.sum(found.max(axis=0) >= np.log(10.0)) <= 185
    assert np.mean(np.minimum(np.exp(found[3]), 100.0)) < 1.2


def test_a_step_is_found_and_dated() -> None:
    rng = np.random.default_rng(6)
    y = rng.standard_normal((36, 50))
    y[20:] += 6.0
    whole = Watched(y, np.ones(36), 4, (np.ones((36, 1)),))
    found = log_evidence(whole)
    assert np.all(found[:16].max(axis=0) < np.log(1000.0))
    assert np.mean(found[19] >= np.log(1000.0)) > 0.9  # four cycles after
    began = [onset(whole, k) for k in range(50)]
    assert np.mean([o.low <= 17 <= o.high for o in began]) > 0.85
    assert np.mean([o.shape == STEP for o in began]) > 0.8


def test_courses_end_with_one() -> None:
    np.testing.assert_array_equal(course(STEP, 3, 2, 5), [0, 0, 0, 0, 1, 1, 1])
    np.testing.assert_allclose(course(RAMP, 3, 2, 5), [0, 0, 0, 0, 1 / 3, 2 / 3, 1])


def test_numbers_together_tell_what_none_tells_by_itself() -> None:
    """Two numbers that scatter against each other and move alike by a tenth of a standard deviation."""
    rng = np.random.default_rng(7)
    n, ones = 40, np.ones(40)
    scatter = rng.standard_normal(n)
    y = np.column_stack([scatter, -scatter]) + 0.02 * rng.standard_normal((n, 2))
    y[20:] += 0.1
    alone, both = np.array([1.0, 0.0]), np.array([1.0, 1.0])
    whole = Watched(y, ones, 10, (ones[:, None],), np.stack([alone, both]))
    found = log_evidence(whole)
    np.testing.assert_array_equal(found[:, 2], found[:, 0])  # weighed by one number alone, that number
    assert found[:, :3].max() < 3.0
    assert found[:10, 3].max() < np.log(100.0)
    assert found[-1, 3] > np.log(1e6)
    began = onset(whole, 3)
    assert (began.low <= 11 <= began.high, began.shape) == (True, STEP)
