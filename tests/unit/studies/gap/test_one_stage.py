"""A second stage against the shapes that one stage can have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.effects import EFFECTS
from sma_bayes.effects.transformation import SLOPED, curves
from sma_bayes.effects.types import Scales
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.history import histories
from sma_bayes.records.types import Branch
from sma_bayes.response.sinh_arcsinh import SinhArcsinhSlopes
from sma_bayes.studies.gap.fitting import fit_with_noise
from sma_bayes.studies.gap.hypothesis import baseline
from sma_bayes.studies.gap.name import LEAST_LN_BAYES_FACTOR, Rivals, candidates, screen_all
from sma_bayes.studies.gap.one_stage import COLD, HOT, SHAPES, SKEW, TAIL, OneStageShape, OneStageShapes
from sma_bayes.studies.gap.study import baseline_start, is_worthy

PRIORS = read_priors("modified_sigmoid")
LOW, SPAN, RATE = 0.01, 0.02, 0.28


def of_shape(rig, share):
    """The campaign of a rig with another share transformed, of the kelvins above the midpoint and the branch."""
    records, rng = [], np.random.default_rng(8)
    for r in rig(periods=(60.0,), loads=(1.0,), peaks=(95.0,), samples=80).campaign().records:
        above = r.inputs["temperature"] - (62.0 if r.branch is Branch.HEATING else 51.0)
        x = LOW + SPAN * (share(above, r.branch) + 0.004 * rng.standard_normal(r.n))
        records.append(replace(r, observed={"displacement": x}))
    return replace(rig().campaign(), records=tuple(records))


def logistic(x):
    return 1.0 / (1.0 + np.exp(-x))


def skewed(above, branch):
    return logistic(np.sinh(0.7 * np.arcsinh(RATE * above) + (0.5 if branch is Branch.HEATING else -0.5)))


def in_two_stages(above, branch):
    """A tenth of the span 14 K below, as sharp as the R-phase is, at one temperature on both branches."""
    step = logistic((above + (62.0 if branch is Branch.HEATING else 51.0) - 45.0) / 1.5)
    return 0.88 * logistic(RATE * above) + 0.12 * step


def judged(rig, share):
    campaign = of_shape(rig, share)
    hypothesis = baseline(campaign, histories(campaign), PRIORS, pooled=True)
    start = baseline_start(hypothesis, campaign, PRIORS, pooled=True, rng=np.random.default_rng(0))
    fitted = fit_with_noise(hypothesis, start)
    screened, _ = screen_all(fitted, [EFFECTS["r_phase"]])
    (found,) = candidates(fitted, screened, [], Rivals.of(fitted))
    return fitted, found


def test_a_skewed_curve_is_no_second_stage(rig) -> None:
    fitted, found = judged(rig, skewed)
    assert found.ln_bayes_factor > 20.0, "without the rival it would be named"
    assert is_worthy(replace(found, one_stage=-np.inf))
    assert found.one_stage == pytest.approx(
        OneStageShapes(fitted).worth(found.ln_bayes_factor - LEAST_LN_BAYES_FACTOR)
    )
    assert found.one_stage > found.ln_bayes_factor
    assert not is_worthy(found)


def test_a_second_stage_beats_the_shapes_of_one(rig) -> None:
    _, found = judged(rig, in_two_stages)
    assert found.ln_bayes_factor > found.one_stage + 3.0
    assert is_worthy(found)


def test_the_shape_around_a_logistic_is_that_of_the_richer_model(rig) -> None:
    """Skew and tails as the response model has them; no slopes."""
    history = histories(rig(periods=(60.0,), loads=(1.0,), peaks=(95.0,)).campaign())[0]
    inputs = history.inputs
    heating = inputs["branch"] > 0.0
    above = inputs["temperature"] - np.where(heating, 62.0, 51.0)

    def response(v):
        t = v["temperature"] - np.where(v["branch"] > 0.0, 62.0, 51.0)
        return {"displacement": LOW + SPAN * logistic(RATE * t)}

    theta = np.array([0.4, 0.8, 0.0, 0.0, -0.3, 1.2, 0.0, 0.0])
    shape = OneStageShape(60.0)
    out = shape.apply(response, theta, inputs)["displacement"]
    model = SinhArcsinhSlopes(("displacement",))
    of_role = {
        "offset": LOW,
        "span": SPAN,
        "rate": RATE,
        "midpoint": 0.0,
        "cold_slope": 0.0,
        "hot_slope": 0.0,
    }
    for on, skew, tail in ((heating, 0.4, 0.8), (~heating, -0.3, 1.2)):
        values = of_role | {"skew": skew, "tail": tail}
        theta_of_model = np.array([values[str(f.role.value)] for f in model.facts])
        expected = model.predict(theta_of_model, {"temperature": above[on]})["displacement"]
        np.testing.assert_allclose(out[on], expected, atol=1e-9 * SPAN)


def test_phases_with_slopes_are_their_lines_and_not_what_is_far_away() -> None:
    """``y = (1 - s)(1 + 0.01 T) + s (3 + 0.02 T)``."""
    temperature = np.linspace(20.0, 100.0, 41)

    def response(v):
        t = v["temperature"]
        s = logistic(0.3 * (t - 60.0))
        return {"displacement": (1.0 - s) * (1.0 + 0.01 * t) + s * (3.0 + 0.02 * t)}

    inputs = {"temperature": temperature, "branch": np.ones_like(temperature), SLOPED: np.ones(1)}
    curve = curves(response, inputs)[1]["displacement"]
    np.testing.assert_allclose(curve.cold, 1.0 + 0.01 * temperature, rtol=1e-9)
    np.testing.assert_allclose(curve.span, 2.0 + 0.01 * temperature, rtol=1e-9)
    np.testing.assert_allclose(curve.share, logistic(0.3 * (temperature - 60.0)), atol=1e-9)


def test_slopes_turn_about_one_temperature_in_all_conditions() -> None:
    """What a slope adds at a temperature does not depend on which others were measured with it."""
    shape = OneStageShape(60.0, (COLD, HOT))
    theta = np.array([1e-4, 2e-4, -1e-4, 3e-4])

    def response(v):
        return {"displacement": LOW + SPAN * logistic(RATE * (v["temperature"] - 62.0))}

    added = []
    for low, high in ((20.0, 90.0), (40.0, 120.0)):
        temperature = np.linspace(low, high, 71)
        inputs = {"temperature": temperature, "branch": np.ones_like(temperature)}
        change = shape.apply(response, theta, inputs)["displacement"] - response(inputs)["displacement"]
        added.append(np.interp([45.0, 60.0, 85.0], temperature, change))
    np.testing.assert_allclose(*added, atol=2e-3 * SPAN)
    assert added[0][1] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("shape", SHAPES)
def test_every_shape_is_the_plain_curve_at_its_middle(shape, rig) -> None:
    history = histories(rig(channels=("force", "displacement")).campaign())[0]
    effect = OneStageShape(60.0, *shape)
    parameters = effect.parameters(Scales.of([history]))
    theta = np.array([float(p.prior.quantile(np.array(0.5))) for p in parameters])

    def response(v):
        share = logistic(RATE * (v["temperature"] - 62.0))
        return {"force": 1.0 + share, "displacement": LOW + SPAN * share}

    out = effect.apply(response, theta, history.inputs)
    for channel, plain in response(history.inputs).items():
        np.testing.assert_allclose(out[channel], plain, rtol=1e-9)


def test_skew_that_channels_share_is_the_same_in_both(rig) -> None:
    history = histories(rig(channels=("force", "displacement")).campaign())[0]
    alike, apart = OneStageShape(60.0, (SKEW, TAIL), True), OneStageShape(60.0)
    names = [[p.name for p in s.parameters(Scales.of([history]))] for s in (alike, apart)]
    assert names[0] == ["e_heating", "t_heating", "e_cooling", "t_cooling"]
    assert len(names[1]) == 16

    def response(v):
        share = logistic(RATE * (v["temperature"] - 62.0))
        return {"force": 1.0 + share, "displacement": LOW + SPAN * share}

    given = {"e_heating": 0.4, "t_heating": 0.8, "e_cooling": -0.3, "t_cooling": 1.2}
    each = [given.get(n.replace("force_", "").replace("displacement_", ""), 0.0) for n in names[1]]
    one = alike.apply(response, np.array(list(given.values())), history.inputs)
    two = apart.apply(response, np.array(each), history.inputs)
    for channel in one:
        np.testing.assert_allclose(one[channel], two[channel], rtol=1e-12)


def test_shapes_are_tried_until_one_is_worth_enough(rig) -> None:
    fitted, _ = judged(rig, skewed)
    few, all_of_them = OneStageShapes(fitted), OneStageShapes(fitted)
    assert few.worth(10.0) > 10.0
    best = all_of_them.worth()
    assert best >= few.worth(10.0)
    assert few.worth() == pytest.approx(best)
