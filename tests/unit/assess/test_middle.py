"""Temperatures at which curves are half-way: of the whole curve, what the model misses included."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from sma_bayes.assess.draws import record_draws
from sma_bayes.assess.loops import loop_quantities
from sma_bayes.assess.middle import middle_temperatures
from sma_bayes.fitting.fit import Fit
from sma_bayes.fitting.fit_records import fit_records
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.types import Branch, Record
from sma_bayes.studies.conditions.features import condition_features

PRIORS = read_priors("modified_sigmoid")


def two_steps(t: np.ndarray | float) -> np.ndarray:
    """A force that climbs by 0.5 N about 43 degrees and by 1.5 N, more steeply, about 55."""
    slow, fast = 0.5 / (1.0 + np.exp(-0.5 * (t - 43.0))), 1.5 / (1.0 + np.exp(-1.5 * (t - 55.0)))
    return np.asarray(0.5 + slow + fast)


@pytest.fixture(scope="module")
def bent(make_record: Callable[..., Record]) -> Fit:
    record = make_record(n=160, noise=0.005, seed=2)
    noise = 0.005 * np.random.default_rng(4).normal(size=record.temperature.size)
    observed = {**record.observed, "force": two_steps(record.temperature) + noise}
    fit = fit_records([replace(record, observed=observed)], PRIORS, noise="independent", seed=0)
    assert "force" in fit.curves().weights
    return fit


def test_a_curve_that_the_model_misses_is_half_way_where_it_was_measured(bent: Fit) -> None:
    """The midpoint B3 is sure of a temperature at which the force is not half-way between its plateaus."""
    truth = brentq(lambda t: two_steps(t) - 1.5, 40.0, 60.0)
    found = middle_temperatures(bent.curves(), "force")
    assert found is not None
    assert np.median(found) == pytest.approx(truth, abs=0.25)
    b3 = bent.flat[:, bent.posterior.names.index("B3")]
    low, high = np.quantile(found, [0.05, 0.95])
    assert low - (high - low) < truth < high + (high - low)
    low, high = np.quantile(b3, [0.05, 0.95])
    assert not low - (high - low) < truth < high + (high - low)


def test_a_curve_of_the_model_alone_is_half_way_at_its_midpoint(make_record: Callable[..., Record]) -> None:
    fit = fit_records([make_record(n=60)], PRIORS, noise="independent", discrepancy=False, seed=0)
    found = middle_temperatures(fit.curves(), "force")
    np.testing.assert_array_equal(found, fit.flat[:, fit.posterior.names.index("B3")])


def test_the_width_of_the_hysteresis_is_that_of_the_whole_curves(
    bent: Fit, make_record: Callable[..., Record]
) -> None:
    cooling = make_record(n=160, noise=0.005, seed=5, branch=Branch.COOLING)
    other = fit_records([cooling], PRIORS, noise="independent", seed=0)
    width = next(
        q for q in loop_quantities(bent, other) if (q.name, q.channel) == ("hysteresis_width", "force")
    )
    halves = [middle_temperatures(f.curves(), "force") for f in (bent, other)]
    assert halves[0] is not None
    assert halves[1] is not None
    assert width.median == pytest.approx(float(np.median(halves[0] - halves[1])))


def test_the_midpoint_of_a_condition_is_where_its_curve_is_half_way(bent: Fit) -> None:
    features = condition_features([record_draws(bent)])
    (midpoint,) = [f for f in features if (f.name, f.channel) == ("midpoint", "force")]
    np.testing.assert_array_equal(midpoint.draws, middle_temperatures(bent.curves(), "force"))


def test_the_steepest_slope_of_a_condition_is_that_of_the_whole_curve(bent: Fit) -> None:
    """A quarter of span times rate, that of the sigmoid alone, is another slope."""
    features = condition_features([record_draws(bent)])
    (slope,) = [f for f in features if (f.name, f.channel) == ("greatest_slope", "force")]
    t = np.linspace(30.0, 70.0, 4001)
    truth = np.gradient(two_steps(t), t).max()
    alone, _ = bent.posterior.model.greatest_slope(bent.curves().model_theta, "force", t)
    assert np.median(slope.draws) == pytest.approx(truth, rel=0.06)
    assert not np.quantile(alone, 0.001) < truth < np.quantile(alone, 0.999)
    assert slope.at_edge == 0.0


def test_what_is_left_at_the_end_of_a_sweep_is_of_the_whole_curve(make_record: Callable[..., Record]) -> None:
    """Most of the force comes steeply, the rest so late that the sweep ends before it."""
    record = make_record(n=160, noise=0.005, seed=2)
    t = record.temperature
    force = 1.5 / (1.0 + np.exp(-1.5 * (t - 48.0))) + 0.5 / (1.0 + np.exp(-0.5 * (t - 66.0)))
    left = 0.25 / (1.0 + np.exp(0.5 * (70.0 - 66.0)))
    observed = {**record.observed, "force": force + 0.005 * np.random.default_rng(4).normal(size=t.size)}
    fit = fit_records([replace(record, observed=observed)], PRIORS, noise="independent", seed=0)
    (found,) = [
        f for f in condition_features([record_draws(fit)]) if (f.name, f.channel) == ("share_left", "force")
    ]
    assert 0.25 * left < np.median(found.draws) < left, "beyond the sweep nothing was measured"
    b2, b3 = (fit.flat[:, fit.posterior.names.index(name)] for name in ("B2", "B3"))
    assert np.median(1.0 / (1.0 + np.exp(b2 * (70.0 - b3)))) < 1e-9, "the sigmoid alone sees nothing of it"
