"""Nearest curves, against exact ones and against fits of made-up measurements."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import curve_fit
from scipy.special import expit

from sma_bayes.arrays import Floats
from sma_bayes.paper.extremes import TABLE_9, TABLE_10, extremes
from sma_bayes.paper.twin import recipes
from sma_bayes.studies.paper.distance import distances, nearest_line, nearest_logistic, rising_part


def logistic(t: Floats, low: float, span: float, rate: float, centre: float) -> Floats:
    return np.asarray(low + span * expit(rate * (t - centre)))


def rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.parametrize(("rate", "centre"), [(0.9, 3.0), (4.0, 1.2), (-2.0, 5.0), (1.5, 7.5)])
def test_a_logistic_curve_is_nearest_to_itself(rate: float, centre: float) -> None:
    t = np.linspace(0.0, 8.0, 200)
    k = logistic(t, 0.4, 1.7, rate, centre)
    assert rms(k - nearest_logistic(t, k)) < 1e-6


def test_the_nearest_line_is_that_of_polyfit() -> None:
    t = np.linspace(-1.0, 4.0, 57)
    k = np.exp(0.3 * t)
    np.testing.assert_allclose(nearest_line(t, k), np.polyval(np.polyfit(t, k, 1), t))


def test_measurements_are_no_nearer_to_a_logistic_than_the_bound_says() -> None:
    """Whatever the residuals look like: white, a wave, or made to please the logistic."""
    recipe = next(r for r in recipes() if r.key == "1A-10mHz-cooling")
    t, k = rising_part(recipe, 0.2439, 1.4654)
    best = nearest_logistic(t, k)
    d = rms(k - best)
    rng = np.random.default_rng(0)
    for shape in (rng.standard_normal(t.size), np.sin(9.0 * t), best - k):
        residual = 0.4 * d * shape / rms(shape)
        y = k + residual
        start = (float(y.min()), float(np.ptp(y)), 4.0, float(t.mean()))
        found, _ = curve_fit(logistic, t, y, start, maxfev=20000)
        left = rms(y - logistic(t, *found))
        assert 0.6 * d - 1e-9 <= left <= 1.4 * d + 1e-9


def test_the_rising_part_lies_between_the_printed_extremes() -> None:
    rows = {**extremes(TABLE_9), **extremes(TABLE_10)}
    found = distances()
    assert [(d.condition, d.branch) for d in found] == [
        (r.condition.id, r.branch.value) for r in recipes() if r.condition.id in rows
    ]
    for d in found:
        row = rows[d.condition]
        assert d.printed_least == pytest.approx(row["stiffness_min"] / 100.0)
        assert d.printed_least - 1e-9 <= d.least < d.greatest <= d.printed_greatest * (1 + 1e-9)
    reached = {d.condition for d in found if d.reaches_greatest}
    assert set(rows) - reached == {"100g-10mHz"}  # its humps end at 105 N/m, Table 10 prints 154
