"""What a slope at the end of a sweep may be of, and what start and finish of the transformation follow from it."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.special import expit
from scipy.stats import halfnorm, norm

from sma_bayes import fit
from sma_bayes.arrays import Floats
from sma_bayes.assess import transformation
from sma_bayes.assess.transformation import Temperature, tangents, transformation_temperatures
from sma_bayes.assess.unfinished import (
    PHASE_SLOPE_SD,
    TRUNCATION_SLOPE_SD,
    Unfinished,
    probability_unfinished,
    unfinished,
)
from sma_bayes.fitting.fit import Fit
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.types import Campaign, Record

LOW, HIGH = 20.0, 80.0
WIDTH = HIGH - LOW


def test_the_probability_is_that_of_bayes() -> None:
    s = np.linspace(-2.0, 2.0, 41)
    phase, other = norm.pdf(s, scale=PHASE_SLOPE_SD), halfnorm.pdf(s, scale=TRUNCATION_SLOPE_SD)
    np.testing.assert_allclose(probability_unfinished(s), other / (other + phase), rtol=1e-12)
    assert probability_unfinished(np.array([1e6]))[0] == 1.0


def test_slopes_of_phases_are_those_of_the_priors() -> None:
    said = tomllib.loads(read_priors("phase_slopes").text)["both"]
    slopes = [belief for name, belief in said.items() if name.endswith("_slope")]
    assert len(slopes) == 4
    assert {(s["family"], s["mean"], s["sd"]) for s in slopes} == {("normal", 0.0, PHASE_SLOPE_SD)}
    assert all(s["relative_to"].endswith("/span(temperature)") for s in slopes)


def test_what_is_not_over_levels_out_and_the_sweep_is_left_alone() -> None:
    slope, length = np.array([[0.0, 0.0], [0.3, 0.0], [0.0, -0.2], [0.1, 0.4]]), 2.5
    beyond = Unfinished(LOW, HIGH, slope, length)
    inside = np.linspace(LOW, HIGH, 50)
    assert not beyond.at(inside).any()
    far = np.array([LOW - 400.0, HIGH + 400.0])
    straight = slope * np.array([-400.0, 400.0])  # what curves have that go on straight
    np.testing.assert_allclose(straight + beyond.at(far), slope * length * np.array([-1.0, 1.0]), atol=1e-12)
    step = 1e-5
    just = beyond.at(np.array([LOW - step, HIGH + step]))
    np.testing.assert_allclose(just / step, 0.0, atol=1e-5)  # as steep at the end as the sweep leaves it
    each = np.broadcast_to(far, (4, 2))
    np.testing.assert_array_equal(beyond.at(each), beyond.at(far))


def a_curve(second: float, at: float, phase: float, t: Floats) -> Floats:
    """A step about 42 degC, a second one, and a slope of the hot phase, over 60 K, as shares of the span."""
    passed = (1.0 - second) * expit(0.6 * (t - 42.0)) + second * expit(0.5 * (t - at))
    return np.asarray(0.02 * (passed + phase * expit(0.6 * (t - 42.0)) * (t - 42.0) / WIDTH))


def _fitted(make_record: Callable[..., Record], curve: Callable[[Floats], Floats]) -> Fit:
    r = make_record(("displacement",), n=200, span=(LOW, HIGH))
    x = curve(r.temperature) + 6e-5 * np.random.default_rng(2).standard_normal(r.n)
    campaign = Campaign("end of a sweep", "end of a sweep", "0", (replace(r, observed={"displacement": x}),))
    (found,) = fit(campaign, jobs=1, seed=1).values()
    return found


def _finish(found: Fit, curve: Callable[[Floats], Floats]) -> tuple[Temperature, float]:
    truth = tangents(lambda t: np.atleast_2d(curve(np.asarray(t))), LOW, HIGH)
    return transformation_temperatures(found)[1], float(truth.upper[0])


def test_a_second_step_that_the_sweep_cuts_short_does_not_pass_for_a_phase(
    make_record: Callable[..., Record], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The curve goes on to a plateau 2 % of the span higher; as a phase it would put the finish 3 K too low."""
    curve = partial(a_curve, 0.15, 76.0, 0.0)
    found = _fitted(make_record, curve)
    finish, true = _finish(found, curve)
    assert finish.interval["q05"] < true < finish.interval["q95"]
    monkeypatch.setattr(transformation, "unfinished", lambda *_: None)
    as_a_phase, _ = _finish(found, curve)
    assert as_a_phase.interval["q95"] < true - 2.0


def test_a_transformation_that_the_sweep_cuts_short_is_flagged(make_record: Callable[..., Record]) -> None:
    """Eight per cent of the span are outstanding."""
    curve = partial(a_curve, 0.3, 78.0, 0.0)
    finish, true = _finish(_fitted(make_record, curve), curve)
    assert finish.interval["q05"] < true < finish.interval["q95"]
    assert not finish.within_data
    assert 0.04 < finish.outstanding < 0.16


def test_a_phase_with_a_slope_keeps_it(make_record: Callable[..., Record]) -> None:
    curve = partial(a_curve, 0.0, 78.0, 0.1)
    found = _fitted(make_record, curve)
    finish, true = _finish(found, curve)
    assert finish.interval["q05"] < true < finish.interval["q95"]
    assert finish.within_data
    beyond = unfinished(found.curves(), "displacement")
    assert beyond is not None
    assert 0.5 < np.mean(beyond.slope[:, 1] == 0.0) < 0.85


def test_what_falls_after_a_rise_is_no_transformation_that_goes_on(
    make_record: Callable[..., Record],
) -> None:
    """However steep: a rig that drifts, for instance."""
    found = _fitted(make_record, partial(a_curve, 0.0, 78.0, -0.8))
    beyond = unfinished(found.curves(), "displacement")
    assert beyond is not None
    assert not beyond.slope[:, 1].any()


def test_the_same_draws_go_on_alike(make_record: Callable[..., Record]) -> None:
    found = _fitted(make_record, partial(a_curve, 0.15, 76.0, 0.0))
    first, second = (unfinished(found.curves(), "displacement") for _ in range(2))
    assert first is not None
    assert second is not None
    np.testing.assert_array_equal(first.slope, second.slope)


def test_nothing_is_added_where_nothing_stands_beside_the_curve(make_record: Callable[..., Record]) -> None:
    found = _fitted(make_record, partial(a_curve, 0.0, 78.0, 0.0))
    assert not found.curves().weights
    assert unfinished(found.curves(), "displacement") is None
