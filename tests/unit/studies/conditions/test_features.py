"""Numbers that sum up a condition, against the curves that they sum up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from sma_bayes.assess.draws import RecordDraws
from sma_bayes.records.types import Branch, Calibration, Condition
from sma_bayes.studies.conditions.features import Feature, condition_features, ratio

C = Condition("c", current=1.0)


def named(features: tuple[Feature, ...], name: str, branch: str, channel: str = "stiffness") -> Feature:
    (found,) = [f for f in features if (f.name, f.branch, f.channel) == (name, branch, channel)]
    return found


def test_extremes_of_stiffness_agree_with_a_search_along_the_curve(
    make_draws: Callable[..., RecordDraws],
) -> None:
    record = make_draws(C, size=1, error=0.0)
    a1, a2, a3, _, b1, b2, b3, _ = record.curve_theta[0]

    def stiffness(t: float) -> float:  # dF/dT over dX/dT, the paper's Eq. (7) written out
        slope_f = b1 * b2 * np.exp(-b2 * (t - b3)) / (1.0 + np.exp(-b2 * (t - b3))) ** 2
        slope_x = a1 * a2 * np.exp(-a2 * (t - a3)) / (1.0 + np.exp(-a2 * (t - a3))) ** 2
        return float(slope_f / slope_x)

    top = minimize_scalar(lambda t: -stiffness(t), bounds=(30.0, 70.0), method="bounded")
    features = condition_features([record])
    assert named(features, "greatest_stiffness", "heating").draws[0] == pytest.approx(-top.fun, rel=1e-3)
    assert named(features, "least_stiffness", "heating").draws[0] == pytest.approx(stiffness(30.0), rel=1e-9)
    assert named(features, "stiffness_ratio", "heating").draws[0] == pytest.approx(
        -top.fun / stiffness(30.0), rel=1e-3
    )
    assert named(features, "least_stiffness", "heating").at_edge == 1.0
    assert named(features, "greatest_stiffness", "heating").at_edge == 0.0
    steepest = max(
        abs(stiffness(t + 1e-4) - stiffness(t - 1e-4)) / 2e-4 for t in np.linspace(30.1, 69.9, 400)
    )
    assert named(features, "steepest_stiffness", "heating").draws[0] == pytest.approx(steepest, rel=2e-2)


def test_a_ratio_to_next_to_nothing_is_infinite_without_a_warning() -> None:
    assert ratio(np.array([130.0, 130.0, 130.0]), np.array([65.0, 0.0, 1e-308])).tolist() == [
        2.0,
        np.inf,
        np.inf,
    ]


def test_both_branches_together_give_the_extremes_and_the_width(
    make_draws: Callable[..., RecordDraws],
) -> None:
    heating = make_draws(C)
    cooling = make_draws(C, Branch.COOLING, A3=40.0, B3=45.0, span=(28.0, 66.0))
    features = condition_features([heating, cooling])
    for name, choose in (("least_stiffness", np.minimum), ("greatest_stiffness", np.maximum)):
        parts = [named(features, name, b.value).draws for b in Branch]
        np.testing.assert_allclose(named(features, name, "both").draws, choose(*parts))
    width = named(features, "hysteresis_width", "both", "force")
    assert width.quantiles()["median"] == pytest.approx(7.0, abs=0.05)
    assert named(features, "least_temperature", "both", "").draws[0] == 28.0
    assert named(features, "peak_temperature", "both", "").draws[0] == 70.0
    assert named(features, "peak_temperature", "both", "").measured
    assert named(features, "greatest_slope", "heating", "force").draws.mean() == pytest.approx(
        2.5 * 0.35 / 4, rel=0.01
    )
    left = named(features, "share_left", "heating", "force").draws
    assert left.mean() == pytest.approx(1.0 / (1.0 + np.exp(0.35 * (70.0 - 52.0))), rel=0.02)


def test_branches_have_one_error_of_calibration_in_all_that_both_make(
    make_draws: Callable[..., RecordDraws],
    calibrated: Callable[[RecordDraws, dict[str, Calibration]], RecordDraws],
) -> None:
    known = {"temperature": Calibration(0.0, 0.0, 1.0), "force": Calibration(0.1, 0.0, 0.0)}
    records = [calibrated(make_draws(C, branch, error=0.0), known) for branch in Branch]
    features = condition_features(records)
    assert np.ptp(named(features, "hysteresis_width", "both", "force").draws) == pytest.approx(0.0, abs=1e-9)
    for name in ("least_stiffness", "greatest_stiffness"):
        heating = named(features, name, "heating").draws
        assert np.std(np.log(heating)) > 0.05
        for other in ("cooling", "both"):
            np.testing.assert_allclose(named(features, name, other).draws, heating, rtol=1e-9)


def test_conditions_of_one_rig_have_one_error_of_calibration(
    make_draws: Callable[..., RecordDraws],
    calibrated: Callable[[RecordDraws, dict[str, Calibration]], RecordDraws],
) -> None:
    """It cancels in how their transformation temperatures differ; calibrations declared otherwise are others."""
    known = {"temperature": Calibration(0.0, 0.0, 1.0)}
    other = {"temperature": Calibration(0.0, 0.0, 2.0)}
    conditions = (C, replace(C, id="2A", current=2.0), replace(C, id="3A", current=3.0))
    records = [
        calibrated(make_draws(c, error=0.0), calibration)
        for c, calibration in zip(conditions, (known, known, other), strict=True)
    ]
    midpoints = {
        f.condition.id: f.draws
        for f in condition_features(records)
        if (f.name, f.channel) == ("midpoint", "force")
    }
    first, second, third = (midpoints[c.id] for c in conditions)
    assert np.std(first) == pytest.approx(1.0, rel=0.1)
    assert np.ptp(second - first) == pytest.approx(0.0, abs=1e-9)
    assert np.std(third - first) == pytest.approx(np.sqrt(5.0), rel=0.1)


def test_an_instrument_of_no_curve_does_not_part_conditions(
    make_draws: Callable[..., RecordDraws],
    calibrated: Callable[[RecordDraws, dict[str, Calibration]], RecordDraws],
) -> None:
    """Such as a load cell, whose scale was set anew, beside displacements at a force that was held."""
    records = [
        calibrated(
            make_draws(replace(C, id=f"c{i}", load=w), channels=("displacement",), error=0.0),
            {"temperature": Calibration(0.0, 0.0, 1.0), "force": Calibration(0.01 * w, 0.0, 0.0)},
        )
        for i, w in enumerate((1.0, 2.0))
    ]
    first, second = (f.draws for f in condition_features(records) if f.name == "midpoint")
    assert np.std(first) == pytest.approx(1.0, rel=0.1)
    assert np.ptp(second - first) == pytest.approx(0.0, abs=1e-9)


def test_a_share_left_before_a_plateau_that_was_not_measured_says_so(
    make_draws: Callable[..., RecordDraws],
) -> None:
    over, cut = (
        named(condition_features([make_draws(C, span=(30.0, hottest))]), "share_left", "heating", "force")
        for hottest in (70.0, 56.0)
    )
    assert "not measured" not in over.meaning
    assert "that plateau was not measured, so the model's word alone" in cut.meaning


def test_displacement_alone_gives_no_stiffness(make_draws: Callable[..., RecordDraws]) -> None:
    features = condition_features([make_draws(C, channels=("displacement",))])
    assert {f.channel for f in features} == {"displacement", ""}
