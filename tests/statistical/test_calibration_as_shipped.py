"""The intervals of a fit without options on a few data of known truth.

The whole table is in `docs/explanation/calibration.md`. Each count is held against the one that an interval of true
coverage 90 % undershoots with a probability of `FALSE_ALARM` over the number of counts, were the repeats drawn anew;
the seeds are fixed. Shares of the range or of the readings are averaged over the repeats and may differ from 90 % by as
many standard errors, from their scatter, and by 3 % that a right interval may be off on so few samples.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calibration.summary import NOMINAL, least_expected, quantities, share
from calibration.trials import Trial, attempt, missing
from scipy.special import ndtri

pytestmark = pytest.mark.slow

REPEATS = 24
FALSE_ALARM = 0.01
"""Of all counts of one truth together."""
CHEAP = ("white", "ar1_0.5", "student_t", "rounded", "second_step", "hardening")
"""Truths that are fitted in half a second at most."""
SWEPT = 12
"""Repeats of records of several sweeps, which take five seconds each."""
OFTEN = ("hardening",)
"""Those for which CI has the time: one that the model is not right for."""
SHARES = ("pointwise", "readings", "readings_cold", "readings_middle", "readings_hot", "nearest")
COUNTS = ("start", "finish")


@pytest.fixture(
    scope="module",
    params=[c if c in OFTEN else pytest.param(c, marks=pytest.mark.thorough) for c in CHEAP],
)
def repeats(request: pytest.FixtureRequest) -> list[dict[str, Any]]:
    return [attempt(Trial(request.param, i), Path("no real data")) for i in range(REPEATS)]


def test_what_is_shipped_converges(repeats: list[dict[str, Any]]) -> None:
    assert sum(r["converged"] for r in repeats) >= REPEATS - 1


@pytest.mark.parametrize("quantity", COUNTS)
def test_transformation_temperatures_are_covered(repeats: list[dict[str, Any]], quantity: str) -> None:
    covered = sum(bool(quantities(r)[quantity]) for r in repeats)
    assert covered >= least_expected(REPEATS, FALSE_ALARM / (len(COUNTS) + len(SHARES)))


@pytest.mark.parametrize("quantity", SHARES)
def test_shares_are_near_the_nominal(repeats: list[dict[str, Any]], quantity: str) -> None:
    found, error = share([float(quantities(r)[quantity] or 0.0) for r in repeats])
    allowed = -float(ndtri(FALSE_ALARM / (2 * (len(COUNTS) + len(SHARES)))))
    assert abs(found - NOMINAL) < allowed * error + 0.03, (found, error)


def test_sweeps_that_differ_are_no_more_readings_of_one_curve() -> None:
    """Bands of the curve and of new sweeps; where all readings counted as of one sweep half of both were outside."""
    found = [attempt(Trial("differing_sweeps", i), Path("no real data")) for i in range(SWEPT)]
    allowed = -float(ndtri(FALSE_ALARM / 2))
    for quantity in ("pointwise", "readings"):
        held, error = share([float(quantities(r)[quantity] or 0.0) for r in found])
        assert held > NOMINAL - allowed * error - 0.03, (quantity, held, error)
        assert held - allowed * error > 0.55, (quantity, held, error)


def test_a_loop_of_another_law_is_fitted_and_scored() -> None:
    if reason := missing("simulated_loop", Path("no real data")):
        pytest.skip(reason)
    found = attempt(Trial("simulated_loop", 0), Path("no real data"))
    assert 0.0 < found["curve"]["displacement"]["rmse"] < 0.03
    assert {"Mf", "Ms"} == set(found["temperatures"]) or {"As", "Af"} == set(found["temperatures"])


def test_the_check_sees_intervals_that_are_too_narrow() -> None:
    """Of intervals that cover 60 % of the time, 24 repeats leave fewer than expected in nine cases of ten."""
    least = least_expected(REPEATS, FALSE_ALARM / (len(COUNTS) + len(SHARES)))
    counts = np.random.default_rng(0).binomial(REPEATS, 0.6, 1000)
    assert np.mean(counts < least) > 0.7
    assert np.mean(np.random.default_rng(1).binomial(REPEATS, NOMINAL, 10_000) < least) < FALSE_ALARM
