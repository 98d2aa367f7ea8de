"""A second stage against the shapes that one stage can have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.effects import EFFECTS
from sma_bayes.effects.transformation import SLOPED, curves
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.history import histories
from sma_bayes.records.types import Branch
from sma_bayes.response.sinh_arcsinh import SinhArcsinhSlopes
from sma_bayes.studies.gap.fitting import fit_with_noise
from sma_bayes.studies.gap.hypothesis import baseline
from sma_bayes.studies.gap.name import candidates, screen_all
from sma_bayes.studies.gap.one_stage import OneStageShape, worth_of_one_stage
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
    (found,) = candidates(fitted, screened, [], refit=True)
    return fitted, found


def test_a_skewed_curve_is_no_second_stage(rig) -> None:
    fitted, found = judged(rig, skewed)
    assert found.ln_bayes_factor > 20.0, "without the rival it would be named"
    assert is_worthy(replace(found, one_stage=-np.inf))
    assert found.one_stage == pytest.approx(worth_of_one_stage(fitted))
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
    out = OneStageShape().apply(response, theta, inputs)["displacement"]
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
