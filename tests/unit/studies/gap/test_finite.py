"""Steps of a fit against what a full fit gains, where a signature misleads and where it doesn't."""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.effects import EFFECTS
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.history import histories
from sma_bayes.response import RESPONSE_MODELS
from sma_bayes.studies.gap import name
from sma_bayes.studies.gap.finite import STRONG_LN_BAYES_FACTOR, gained_in_steps
from sma_bayes.studies.gap.fitting import fit_hypothesis, fit_with_noise
from sma_bayes.studies.gap.flexible import gains, terms_of
from sma_bayes.studies.gap.hypothesis import baseline
from sma_bayes.studies.gap.name import Rivals, candidates, screen, screen_all
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
    others = {k: g for k, (g, _) in in_steps.items() if k not in ("branch_stress_shift", "run_offset")}
    assert gain == max(others.values())
    assert own.gain < 0.8 * gain
    full = fit_hypothesis(far_apart.hypothesis.extended(own.effect), start, far_apart.noise)
    assert full.theta[-1] == pytest.approx(SHIFT, rel=0.03)
    assert 0.9 * gain < full.log_likelihood - far_apart.log_likelihood


def test_what_steps_do_not_gain_is_no_evidence(far_apart, monkeypatch) -> None:
    """A signature may foretell what no fit gains; its Bayes factor is at most what steps gain."""
    monkeypatch.setattr(name, "gained_in_steps", lambda fitted, effect, start: (3.0, start))
    screened, _ = screen_all(far_apart, EFFECTS.values())
    flexible = sorted(gains(far_apart, terms_of(far_apart)), key=lambda g: -g.ln_bayes_factor)
    assert flexible[0].ln_bayes_factor > STRONG_LN_BAYES_FACTOR
    assert max(s.ln_bayes_factor for s in screened) > 100.0
    found = candidates(far_apart, screened, flexible, Rivals.of(far_apart, flexible), most=0)
    strong = max(s.gain for s in screened)
    tried = {s.effect.id for s in screened if s.gain > 0.1 * strong}
    assert len(tried) > 2
    assert all(c.ln_bayes_factor <= 3.0 for c in found if c.effect.id in tried)


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
