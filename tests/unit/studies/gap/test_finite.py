"""Steps of a fit against what a full fit gains, where a signature misleads and where it doesn't."""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.effects import EFFECTS
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.history import histories
from sma_bayes.response import RESPONSE_MODELS
from sma_bayes.studies.gap.finite import STRONG_LN_BAYES_FACTOR, gained_in_steps
from sma_bayes.studies.gap.fitting import fit_hypothesis, fit_with_noise
from sma_bayes.studies.gap.hypothesis import baseline
from sma_bayes.studies.gap.name import screen, screen_all
from sma_bayes.studies.gap.study import baseline_start, study_from

MODEL = "sinh_arcsinh_slopes"


SHIFT = 35.0


@pytest.fixture(scope="module")
def far_apart(rig):
    """Three loads whose transformations are 35 K apart and some 15 K wide, seen with one rich curve."""
    campaign = rig(shift=SHIFT, loads=(0.0, 1.0, 2.0), peaks=(95.0, 140.0, 175.0), seed=4).campaign()
    priors = read_priors(MODEL)
    model = RESPONSE_MODELS[MODEL]
    hypothesis = baseline(campaign, histories(campaign), priors, pooled=True, model=model)
    start = baseline_start(hypothesis, campaign, priors, pooled=True, rng=np.random.default_rng(0))
    return fit_with_noise(hypothesis, start)


def test_a_shift_wider_than_the_transformation_is_found_in_steps(far_apart) -> None:
    """Its signature alone shows a part of what a fit gains by it."""
    screened, _ = screen_all(far_apart, EFFECTS.values())
    own = next(s for s in screened if s.effect.id == "stress_shift")
    in_steps = {s.effect.id: gained_in_steps(far_apart, s.effect, s.start) for s in screened}
    gain, start = in_steps["stress_shift"]
    others = {
        name: g for name, (g, _) in in_steps.items() if name not in ("branch_stress_shift", "run_offset")
    }
    assert gain == max(others.values())
    assert own.gain < 0.8 * gain
    full = fit_hypothesis(far_apart.hypothesis.extended(own.effect), start, far_apart.noise)
    assert full.theta[-1] == pytest.approx(SHIFT, rel=0.03)
    assert 0.9 * gain < full.log_likelihood - far_apart.log_likelihood


def test_such_a_shift_is_named(far_apart) -> None:
    found = study_from(far_apart, EFFECTS, np.random.default_rng(0), lambda _: None)
    assert found.verdict == "named"
    assert found.effects[0].id in ("stress_shift", "branch_stress_shift")
    assert found.steps[0].look.best.ln_bayes_factor > STRONG_LN_BAYES_FACTOR


def test_where_all_is_linear_steps_gain_what_screening_foretells(make_line, added) -> None:
    line = make_line(prior_sd=(50.0, 50.0, 50.0), phi=0.5, seed=3)
    fitted = fit_hypothesis(line.hypothesis, line.prior_mean, line.noise)
    effect = added("wave", lambda v: np.sin(0.9 * v["order"]), 2.0)
    s = screen(fitted, effect)
    gain, start = gained_in_steps(fitted, effect, s.start)
    assert gain == pytest.approx(s.gain, abs=0.02)
    assert start[-1] == pytest.approx(s.start[-1], rel=0.02)
