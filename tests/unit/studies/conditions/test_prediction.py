"""Predictions at conditions that were not measured, and interpolation by hand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from sma_bayes.assess.draws import RecordDraws
from sma_bayes.records.types import Calibration, Condition
from sma_bayes.response.modified_sigmoid import sigmoid
from sma_bayes.studies.conditions.design import designs
from sma_bayes.studies.conditions.leave_out import CURVES, HIERARCHICAL, PARAMETERS, leave_out
from sma_bayes.studies.conditions.population import population_of
from sma_bayes.studies.conditions.prediction import curve_by_hand, neighbours, parameters_by_hand, predict


def lawful(make_draws: Callable[..., RecordDraws], **more: object) -> list[RecordDraws]:
    """Conditions whose midpoint follows the load exactly."""
    return [
        make_draws(Condition(f"c{w}", load=w), channels=("displacement",), A3=45.0 + 2.0 * w, **more)
        for w in (1.0, 2.0, 3.0, 5.0, 6.0, 7.0)
    ]


def test_prediction_follows_the_law_and_its_band_holds_the_truth(
    make_draws: Callable[..., RecordDraws],
) -> None:
    records = lawful(make_draws)
    (design,) = designs([r.condition for r in records])
    population = population_of(design, records, np.random.SeedSequence(0))
    rng = np.random.default_rng(0)
    found = predict(population, Condition("new", load=4.0), rng)
    t = np.linspace(30.0, 70.0, 41)
    truth = sigmoid(t, *(np.array(v) for v in (0.02, 0.30, 53.0, 0.001)))
    band = found.band("displacement", t, rng)
    assert np.all((band.curve["q05"] <= truth) & (truth <= band.curve["q95"]))
    assert np.max(band.curve["q95"] - band.curve["q05"]) < 0.15 * 0.02
    wider = band.predictive["pred_q95"] - band.predictive["pred_q05"]
    assert np.all(wider > band.curve["q95"] - band.curve["q05"])
    assert np.median(wider) > 2 * 1.5 * 0.01 * 0.0199, "1 % noise on either side"


def test_the_error_of_a_calibration_is_that_of_the_rig(
    make_draws: Callable[..., RecordDraws],
    calibrated: Callable[[RecordDraws, dict[str, Calibration]], RecordDraws],
) -> None:
    """It widens what is predicted once, and neither slopes nor scatter, nor what is held against a condition."""
    exact = lawful(make_draws)
    off = [calibrated(r, {"temperature": Calibration(0.0, 0.0, 3.0)}) for r in exact]
    (design,) = designs([r.condition for r in exact])
    known, unsure = (population_of(design, r, np.random.SeedSequence(0)) for r in (exact, off))
    np.testing.assert_allclose(unsure.coefficients[:, 1], known.coefficients[:, 1], rtol=1e-3)
    np.testing.assert_allclose(unsure.scatter, known.scatter, rtol=1e-3)
    place = exact[0].names.index("A3")
    new = Condition("new", load=4.0)
    before, after = (
        np.std(predict(p, new, np.random.default_rng(0)).theta[:, place]) for p in (known, unsure)
    )
    assert after == pytest.approx(np.hypot(before, 3.0), rel=0.05)
    assert np.std(unsure.level[:, place]) == pytest.approx(
        np.hypot(np.std(known.level[:, place]), 3.0), rel=0.05
    )
    scores = [leave_out(design, r, 3, np.random.SeedSequence(0))[0].scores for r in (exact, off)]
    for way, score in scores[0].items():
        assert scores[1][way].width == pytest.approx(score.width, rel=1e-3)


def test_temperatures_that_not_all_conditions_covered_are_marked(
    make_draws: Callable[..., RecordDraws],
) -> None:
    records = [
        *lawful(make_draws)[:4],
        make_draws(Condition("c6", load=6.0), channels=("displacement",), span=(40.0, 65.0)),
    ]
    (design,) = designs([r.condition for r in records])
    found = predict(
        population_of(design, records, np.random.SeedSequence(0)),
        Condition("new", load=4.0),
        np.random.default_rng(0),
    )
    t = np.array([35.0, 40.0, 60.0, 65.0, 66.0])
    assert found.band("displacement", t, np.random.default_rng(0)).extrapolated.tolist() == [
        True,
        False,
        False,
        False,
        True,
    ]


def test_neighbours_agree_in_all_other_settings() -> None:
    conditions = [
        Condition("a", current=1.0, load=1.0),
        Condition("b", current=2.0, load=1.0),
        Condition("c", current=4.0, load=1.0),
        Condition("d", current=2.5, load=2.0),
    ]
    (design,) = designs(conditions)
    found = neighbours(design, Condition("new", current=3.0, load=1.0))
    assert found is not None
    assert (found.below, found.above) == (1, 2)
    assert found.share == pytest.approx(0.5)
    assert neighbours(design, Condition("new", current=2.0, load=1.5)) is None
    assert neighbours(design, Condition("new", current=5.0, load=1.0)) is None


def test_interpolation_by_hand(make_draws: Callable[..., RecordDraws]) -> None:
    records = lawful(make_draws, error=0.0)
    (design,) = designs([r.condition for r in records])
    between = neighbours(design, Condition("new", load=4.0))
    assert between is not None
    t = np.linspace(30.0, 70.0, 5)
    a, b = (0.001 + 0.02 / (1.0 + np.exp(-0.3 * (t - m))) for m in (51.0, 55.0))
    np.testing.assert_allclose(curve_by_hand(records, between, "displacement", t)[0], (a + b) / 2)
    middle = 0.001 + 0.02 / (1.0 + np.exp(-0.3 * (t - 53.0)))
    np.testing.assert_allclose(parameters_by_hand(records, between, "displacement", t)[0], middle)


def test_what_is_left_out_has_no_part_in_its_prediction(make_draws: Callable[..., RecordDraws]) -> None:
    records = lawful(make_draws)
    changed = [
        *records[:2],
        make_draws(Condition("c3.0", load=3.0), channels=("displacement",), A3=60.0),
        *records[3:],
    ]
    (design,) = designs([r.condition for r in records])
    (one,), (two,) = (leave_out(design, r, 2, np.random.SeedSequence(3)) for r in (records, changed))
    np.testing.assert_array_equal(one.bands[HIERARCHICAL], two.bands[HIERARCHICAL])
    assert one.scores[HIERARCHICAL].covers_curve == 1.0
    assert one.scores[HIERARCHICAL].holds_whole
    assert one.scores[HIERARCHICAL].covers_samples is not None
    assert one.scores[HIERARCHICAL].covers_samples > 0.8
    assert two.scores[HIERARCHICAL].covers_curve < 0.7, "the changed condition is off the law"
    assert set(one.scores) == {HIERARCHICAL, CURVES, PARAMETERS}
    width = one.bands[CURVES][2] - one.bands[CURVES][0]
    assert one.scores[CURVES].width == pytest.approx(float(np.mean(width)))
    assert one.beyond == ()


def test_the_outermost_condition_is_an_extrapolation(make_draws: Callable[..., RecordDraws]) -> None:
    records = lawful(make_draws)
    (design,) = designs([r.condition for r in records])
    (found,) = leave_out(design, records, 0, np.random.SeedSequence(3))
    assert found.beyond == ("load",)
    assert set(found.scores) == {HIERARCHICAL}


def test_a_setting_that_only_the_left_out_condition_varies_can_not_be_predicted(
    make_draws: Callable[..., RecordDraws],
) -> None:
    records = [
        make_draws(Condition(n, load=w, current=i), channels=("displacement",))
        for n, w, i in (("a", 1.0, 1.0), ("b", 2.0, 1.0), ("c", 3.0, 2.0))
    ]
    (design,) = designs([r.condition for r in records])
    assert leave_out(design, records, 2, np.random.SeedSequence(0)) == ()
