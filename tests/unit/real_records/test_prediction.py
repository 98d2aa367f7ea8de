"""Predictions of readings by every method, on measurements of known noise."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from real_records.baselines import BASELINES
from real_records.ours import Ours
from real_records.prediction import Prediction, mixture, normal
from real_records.records import Measured
from real_records.trials import attempt, held_out_scores
from scipy.stats import norm

from sma_bayes.assess.held_out import part
from sma_bayes.records.types import Record

MakeRecord = Callable[..., Record]
NEEDS = {"gaussian_process": "sklearn", "celerite": "celerite2", "published_curve": "lmfit"}
METHODS = {**BASELINES, "ours": Ours()}


def needed(name: str) -> None:
    if name in NEEDS:
        pytest.importorskip(NEEDS[name], reason=f"{NEEDS[name]} is not installed (extra `bench`)")


def test_a_normal_prediction_is_scipys() -> None:
    y, mean, sd = np.array([1.0, 2.0]), np.array([1.5, 1.8]), np.array([0.3, 0.1])
    found = normal(y, mean, sd)
    assert found.log_density == pytest.approx(norm.logpdf(y, mean, sd))
    assert found.low == pytest.approx(norm.ppf(0.05, mean, sd))
    assert found.high == pytest.approx(norm.ppf(0.95, mean, sd))


def test_a_mixture_is_the_mean_of_its_densities() -> None:
    y, mean = 0.3, np.array([[0.0], [1.0], [2.0]])
    draws = np.random.default_rng(0).standard_normal((3, 1)) + mean
    found = mixture(norm.logpdf(y, mean), draws)
    assert found.log_density == pytest.approx([np.log(np.mean(norm.pdf(y, mean)))])
    assert found.low == pytest.approx(np.quantile(draws, 0.05, axis=0))


@pytest.mark.parametrize("name", METHODS)
def test_readings_of_a_published_curve_are_predicted(name: str, make_record: MakeRecord) -> None:
    """Noise of 1 % of the span is known: the log score is that of the noise, and 90 % lie inside."""
    needed(name)
    record = make_record(n=120, noise=0.01, channels=("force",), seed=4)
    y = record.observed["force"]
    target = np.arange(record.n) % 4 == 1
    found: Prediction = METHODS[name](part(record, ~target), part(record, target))
    sd = 0.01 * 2.5
    best = -np.log(sd) - 0.5 * np.log(2.0 * np.pi) - 0.5
    assert np.mean(found.log_density) == pytest.approx(best, abs=0.35)
    assert 0.75 <= np.mean((found.low <= y[target]) & (y[target] <= found.high)) <= 1.0
    assert np.median(found.high - found.low) == pytest.approx(2 * 1.645 * sd, rel=0.35)


@pytest.mark.parametrize("name", ["smoothing_spline", "gaussian_process"])
def test_equal_temperatures_are_taken_together(name: str, make_record: MakeRecord) -> None:
    needed(name)
    record = make_record(n=60, noise=0.01, channels=("force",))
    train = part(record, np.arange(60) < 50)
    t = np.round(train.temperature)
    twice = Record(
        train.condition, train.branch, {"temperature": t}, dict(train.observed), train.row, train.units
    )
    found = METHODS[name](twice, part(record, np.arange(60) >= 50))
    assert np.isfinite(found.log_density).all()


def test_an_error_of_the_thermometer_widens_the_steep_part(make_record: MakeRecord) -> None:
    """Declared, 1 K at 0.35 /K: the interval is widest where the curve is steepest."""
    record = make_record(n=150, noise=0.005, temperature_sd=1.0, channels=("force",))
    target = np.arange(record.n) % 3 == 1
    test = part(record, target)
    found = Ours()(part(record, ~target), test)
    width = found.high - found.low
    steep = np.abs(test.temperature - 52.0) < 2.0
    flat = np.abs(test.temperature - 52.0) > 14.0
    assert np.median(width[steep]) > 4.0 * np.median(width[flat])


def test_an_attempt_describes_and_scores(make_record: MakeRecord) -> None:
    measured = Measured("flexinol_isobaric", make_record(n=60, channels=("force",)), 1)
    found = attempt(measured, "ours")
    assert found["rmse"] == pytest.approx(0.01, rel=0.3)
    assert 0.7 < found["width"] < 1.5
    assert abs(found["lag1"]) < 0.3
    assert found["held_out"]["sweeps"] is None
    assert 0.7 < found["held_out"]["blocks"]["coverage"] <= 1.0
    # in units of the range, so that channels compare: noise of 1 % of the span
    assert found["held_out"]["blocks"]["log_score"] == pytest.approx(-np.log(0.01) - 1.42, abs=0.4)


def test_nothing_held_out_has_no_score(make_record: MakeRecord) -> None:
    measured = Measured("flexinol_isobaric", make_record(channels=("force",)), 1)
    assert held_out_scores(measured, [], BASELINES["smoothing_spline"]) is None
