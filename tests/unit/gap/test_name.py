"""Candidates against marginal likelihoods in closed form, and what guards against false names."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.gap.fitting import fit_hypothesis
from sma_bayes.gap.flexible import Term, gains, terms_of
from sma_bayes.gap.name import Candidate, beside, candidates, guard_of, screen, screen_all, signature_at_mode
from sma_bayes.gap.study import is_worthy

VAGUE = (50.0, 50.0, 50.0)


def wave(v):
    return np.sin(0.9 * v["order"])


@pytest.fixture(scope="module")
def line(make_line):
    return make_line(prior_sd=VAGUE, phi=0.5, seed=3)


@pytest.fixture(scope="module")
def fitted(line):
    return fit_hypothesis(line.hypothesis, line.prior_mean, line.noise)


def column_of(effect, line):
    return np.concatenate([effect.column(h.inputs) for h in line.hypothesis.histories])


def test_a_candidate_is_judged_by_a_ratio_of_marginal_likelihoods(line, fitted, added) -> None:
    effects = [added("wave", wave, 0.7), added("ramp", lambda v: v["order"] / 40.0, 0.2)]
    screened, untested = screen_all(fitted, effects)
    assert untested == []
    found = {c.effect.id: c for c in candidates(fitted, screened, [], refit=True, worth=3.0)}
    for effect in effects:
        g = column_of(effect, line)
        exact = line.log_evidence(extra=effect.sd**2 * np.outer(g, g)) - line.log_evidence()
        assert found[effect.id].ln_bayes_factor == pytest.approx(exact, abs=0.01)
        assert found[effect.id].guard == -np.inf


def test_screening_foretells_the_gain_and_the_fit(line, fitted, added) -> None:
    """For a linear model the gain of likelihood is that of generalised least squares with one more column."""
    effect = added("wave", wave, 2.0)
    s = screen(fitted, effect)
    root = np.linalg.inv(np.linalg.cholesky(line.covariance))
    prior = np.diag(1.0 / line.prior_sd)
    plain = np.concatenate([root @ line.x, prior])
    goal = np.concatenate([root @ line.y, prior @ line.prior_mean])
    more = np.column_stack([plain, np.concatenate([root @ column_of(effect, line), np.zeros(3)])])
    best = np.linalg.lstsq(more, goal, rcond=None)[0]
    before, after = (np.sum((goal - m @ np.linalg.lstsq(m, goal, rcond=None)[0]) ** 2) for m in (plain, more))
    assert s.gain == pytest.approx(0.5 * (before - after), rel=1e-2)
    spread = np.sqrt(np.diag(np.linalg.inv(more.T @ more)))
    np.testing.assert_allclose((s.start - best) / spread, 0.0, atol=0.05)
    assert s.of(fitted.whitened[:, None])[0] == pytest.approx(s.ln_bayes_factor, abs=1e-3)


def test_an_effect_that_the_model_absorbs_gains_nothing(fitted, added) -> None:
    same = added("offset", lambda v: np.ones_like(v["order"]))
    wave_gain = screen(fitted, added("wave", wave)).gain
    assert abs(screen(fitted, same).gain) < 0.01
    assert wave_gain >= 0.0


def test_candidates_are_ranked_and_only_refitted_where_that_is_asked(line, fitted, added) -> None:
    effects = [added("wave", wave), added("ramp", lambda v: v["order"] / 40.0)]
    screened, _ = screen_all(fitted, effects)
    assert screened[0].gain >= screened[1].gain
    assert all(c.fitted is None for c in candidates(fitted, screened, [], refit=False, worth=3.0))
    out = candidates(fitted, screened, [], refit=True, worth=3.0)
    values = [c.ln_bayes_factor for c in out]
    assert values == sorted(values, reverse=True)
    by_name = {s.effect.id: s for s in screened}
    extended = fit_hypothesis(line.hypothesis.extended(effects[0]), by_name["wave"].start, line.noise)
    assert all(s.effect.id != "wave" for s in screen_all(extended, effects)[0])


def test_the_guard_is_the_mean_of_the_terms_that_hold_most_of_a_signature(line, fitted, added) -> None:
    effect = added("wave", wave, 5.0)
    extended = fit_hypothesis(line.hypothesis.extended(effect), screen(fitted, effect).start, line.noise)
    signature = signature_at_mode(fitted, extended)
    root = np.linalg.inv(np.linalg.cholesky(line.covariance))
    g = root @ column_of(effect, line) * extended.theta[-1]
    j = root @ line.x
    exact = g - j @ np.linalg.lstsq(j, g, rcond=None)[0]
    np.testing.assert_allclose(signature, exact, atol=1e-3 * np.max(np.abs(exact)))

    rng = np.random.default_rng(0)
    column, other = column_of(effect, line), rng.standard_normal(line.y.size)
    terms = [
        Term("holds it", "displacement", np.column_stack([column, other])),
        Term(
            "holds it too",
            "displacement",
            np.column_stack([column + 0.3 * other, rng.standard_normal(line.y.size)]),
        ),
        Term("has nothing of it", "displacement", rng.standard_normal((line.y.size, 1))),
    ]
    flexible = gains(fitted, terms)
    shares = []
    for term in terms:
        w = root @ term.columns
        left = w - j @ np.linalg.lstsq(j, w, rcond=None)[0]
        shown = left @ np.linalg.lstsq(left, exact, rcond=None)[0]
        shares.append(float(shown @ shown / (exact @ exact)))
    assert shares[0] > 0.999
    assert shares[1] > 0.6
    assert shares[2] < 0.3
    screened = screen(fitted, effect)
    value, covariate = guard_of(signature, flexible, screened)
    assert value == pytest.approx(np.log(np.mean([np.exp(f.ln_bayes_factor) for f in flexible[:2]])))
    assert covariate in ("holds it", "holds it too")
    assert guard_of(signature, flexible[2:], screened) == (-np.inf, "")
    assert guard_of(signature, flexible[:1], screened) == (flexible[0].ln_bayes_factor, "holds it")


def test_a_line_does_not_guard_against_an_effect_that_is_that_line(line, fitted, added) -> None:
    """But against one that only comes near it."""
    ramp = added("ramp", lambda v: v["order"] / 40.0, 0.2)
    bent = added("bent", lambda v: (v["order"] / 40.0) ** 1.5, 0.2)
    (term,) = gains(fitted, [Term("order", "displacement", column_of(ramp, line)[:, None])])
    for effect, guarded in ((ramp, False), (bent, True)):
        screened = screen(fitted, effect)
        extended = fit_hypothesis(fitted.hypothesis.extended(effect), screened.start, fitted.noise)
        value, _ = guard_of(signature_at_mode(fitted, extended), [term], screened)
        assert np.isfinite(value) == guarded


def test_an_effect_beside_a_flexible_term_is_weighed_against_such_a_term_alone(line, fitted, added) -> None:
    """Of a mechanism that is a wave, and of which the effect is the first half only."""
    half = added("half", lambda v: wave(v) * (v["order"] < 20.0), 2.0)
    screened = screen(fitted, half)
    extended = fit_hypothesis(fitted.hypothesis.extended(half), screened.start, fitted.noise)
    gained = extended.ln_evidence - fitted.ln_evidence
    over, best = beside(extended, gained, 7.0)
    assert best is not None
    on_top = [g.ln_bayes_factor for g in gains(extended, terms_of(extended))]
    assert best.ln_bayes_factor == max(on_top)
    assert over == pytest.approx(gained + max(best.ln_bayes_factor, 0.0) - 7.0)
    assert beside(extended, gained, -5.0)[0] == pytest.approx(over + 7.0)
    (found,) = candidates(fitted, [screened], gains(fitted, terms_of(fitted)), refit=True, worth=gained - 1.0)
    assert found.remainder is not None
    assert found.remainder.ln_bayes_factor == best.ln_bayes_factor
    (passed_over,) = candidates(fitted, [screened], [], refit=True, worth=gained + 1.0)
    assert (passed_over.over, passed_over.remainder) == (-np.inf, None)


@pytest.mark.parametrize(
    ("factor", "on_top", "share", "weight"),
    [(8.0, 2.0, 0.8, 9.433781), (8.0, -5.0, 1.0, 8.0), (-3.0, 2.0, 0.0, -1.566219), (8.0, None, 1.0, 8.0)],
)
def test_what_an_effect_carries(
    factor: float, on_top: float | None, share: float, weight: float, line, fitted, added
) -> None:
    """Its share of the logarithm; its weight is the mean of the evidence with a flexible term and without."""
    term = Term("order", "displacement", column_of(added("wave", wave), line)[:, None])
    left = None if on_top is None else replace(gains(fitted, [term])[0], ln_bayes_factor=on_top)
    found = Candidate(added("wave", wave), None, factor, remainder=left)
    assert found.carried == pytest.approx(share)
    assert found.weight == pytest.approx(weight)


@pytest.mark.parametrize(
    ("factor", "guard", "over", "on_top", "worthy"),
    [
        (9.0, 8.0, -np.inf, None, True),
        (9.0, 10.0, -np.inf, None, False),
        (9.0, 10.0, 4.0, 1.0, True),
        (9.0, 10.0, 2.0, 1.0, False),
        (9.0, 10.0, 4.0, 1.1, False),
        (2.0, -np.inf, 4.0, 0.0, False),
    ],
)
def test_an_effect_is_worthy_in_the_place_of_what_is_flexible_or_beside_it(
    factor: float, guard: float, over: float, on_top: float | None, worthy: bool, line, fitted, added
) -> None:
    term = Term("order", "displacement", column_of(added("wave", wave), line)[:, None])
    left = None if on_top is None else replace(gains(fitted, [term])[0], ln_bayes_factor=on_top)
    assert is_worthy(Candidate(added("wave", wave), None, factor, guard, "order", over, left)) is worthy
