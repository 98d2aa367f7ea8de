"""Candidates against marginal likelihoods in closed form, and what guards against false names."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from sma_bayes.studies.gap.fitting import fit_hypothesis
from sma_bayes.studies.gap.flexible import (
    COEFFICIENT_SD_GRID,
    FlexibleTerms,
    Term,
    beyond_shape,
    gains,
    offer,
    shape_terms,
    terms_of,
)
from sma_bayes.studies.gap.name import (
    LEAST_LN_BAYES_FACTOR,
    Candidate,
    EvidenceBeside,
    Rivals,
    candidates,
    flexible_alternative,
    judged,
    screen,
    screen_all,
    signature_at_mode,
)
from sma_bayes.studies.gap.study import is_worthy

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
    found = {c.effect.id: c for c in candidates(fitted, screened, [], Rivals.of(fitted))}
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
    assert all(c.fitted is None for c in candidates(fitted, screened, [], None))
    out = candidates(fitted, screened, [], Rivals.of(fitted))
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
    value, covariate = flexible_alternative(signature, flexible, screened)
    assert value == pytest.approx(np.log(np.mean([np.exp(f.ln_bayes_factor) for f in flexible[:2]])))
    assert covariate in ("holds it", "holds it too")
    assert flexible_alternative(signature, flexible[2:], screened) == (-np.inf, "")
    assert flexible_alternative(signature, flexible[:1], screened) == (
        flexible[0].ln_bayes_factor,
        "holds it",
    )


@pytest.mark.parametrize("sd", [1.0, 1e4])
def test_a_size_that_surprises_costs_the_guard_as_much(line, fitted, added, sd: float) -> None:
    """The prior of the size goes, by which a function of the same form would win, and that of its coefficient comes."""
    effect, rng = added("wave", wave, sd), np.random.default_rng(0)
    column = column_of(effect, line)
    terms = gains(
        fitted, [Term("order", "displacement", np.column_stack([column, rng.standard_normal(line.y.size)]))]
    )
    screened = screen(fitted, effect)
    extended = fit_hypothesis(line.hypothesis.extended(effect), screened.start, line.noise)
    size = float(extended.theta[-1])
    noise = np.sqrt(np.mean([n.sd**2 for n in line.noise]))
    coefficient = abs(size) * np.max(np.abs(column)) / noise
    own = norm.pdf(size, 0.0, sd) * abs(size)
    as_term = np.mean(norm.pdf(coefficient, 0.0, COEFFICIENT_SD_GRID)) * coefficient
    found = judged(fitted, extended, screened, terms, Rivals.of(fitted, terms))
    price = max(np.log(as_term / own), 0.0)
    assert (price > 5.0) == (sd > 1.0)
    assert terms[0].ln_bayes_factor - found.guard == pytest.approx(price, abs=1e-6)


def test_a_line_does_not_guard_against_an_effect_that_is_that_line(line, fitted, added) -> None:
    """But against one that only comes near it."""
    ramp = added("ramp", lambda v: v["order"] / 40.0, 0.2)
    bent = added("bent", lambda v: (v["order"] / 40.0) ** 1.5, 0.2)
    (term,) = gains(fitted, [Term("order", "displacement", column_of(ramp, line)[:, None])])
    for effect, guarded in ((ramp, False), (bent, True)):
        screened = screen(fitted, effect)
        extended = fit_hypothesis(fitted.hypothesis.extended(effect), screened.start, fitted.noise)
        value, _ = flexible_alternative(signature_at_mode(fitted, extended), [term], screened)
        assert np.isfinite(value) == guarded


def offered(
    line,
    fitted,
    added,
    best: float | None,
    shape: float = 0.0,
    beyond: float | None = None,
    free: float = 0.0,
) -> FlexibleTerms:
    """What flexible terms bring, made up."""
    term = Term("order", "displacement", column_of(added("wave", wave), line)[:, None])
    (gain,) = gains(fitted, [term])
    first, second = (None if v is None else replace(gain, ln_bayes_factor=v) for v in (best, beyond))
    return FlexibleTerms(first, shape, second, free)


@pytest.mark.parametrize(
    ("gained", "with_it", "without", "over", "carried", "apart"),
    [
        (8.0, (2.0, 0.0, 2.0, 8.0), (7.0, 0.0, 7.0), 3.0, 0.8, False),
        (8.0, (-5.0, 0.0, -5.0, 8.0), (7.0, 0.0, 7.0), 1.0, 1.0, False),
        (8.0, (None, 0.0, None, 8.0), (-2.0,), 8.0, 1.0, False),
        (-3.0, (2.0, 0.0, None, -3.0), (-2.0,), -1.0, 0.0, False),
        # 500 are left to the shape of the curve with the effect as without, and hardly anything beside it
        (300.0, (520.0, 500.0, 10.0, 800.0), (700.0, 500.0, 200.0, 500.0), 120.0, 300.0 / 310.0, True),
        # a bend of which all but 10 lies in the shape: that nothing is left beside a free one does not speak for it
        (440.0, (200.0, 400.0, -1.0, 510.0), (590.0, 640.0, -1.0, 500.0), 50.0, 440.0 / 640.0, False),
        # an effect that is about the shape is worth nothing beside a free one
        (300.0, (20.0, 10.0, 5.0, 301.0), (310.0, 310.0, 5.0, 300.0), 10.0, 300.0 / 320.0, False),
    ],
)
def test_an_effect_is_weighed_beside_flexible_terms_with_the_shape_or_without(
    gained, with_it, without, over, carried, apart, line, fitted, added
) -> None:
    found = EvidenceBeside.of(
        gained, offered(line, fitted, added, *with_it), offered(line, fitted, added, *without)
    )
    assert found.over == pytest.approx(over)
    assert found.carried == pytest.approx(carried)
    assert found.shape_apart is apart
    assert found.on_top == pytest.approx(max(with_it[0] or 0.0, 0.0))
    own = with_it[3] - (without[3] if len(without) > 3 else 0.0)
    assert found.beyond_shape == pytest.approx(own)
    assert found.carried_beyond == pytest.approx(
        own / (own + max(with_it[2] or 0.0, 0.0)) if own > 0.0 else 0.0
    )


def test_what_is_looked_at_is_what_flexible_terms_bring(line, fitted, added) -> None:
    half = added("half", lambda v: 3.0 * wave(v) * (v["order"] < 20.0), 2.0)
    screened = screen(fitted, half)
    (found,) = candidates(fitted, [screened], gains(fitted, terms_of(fitted)), Rivals.of(fitted))
    assert found.fitted is not None
    extended, plain = (gains(f, terms_of(f)) for f in (found.fitted, fitted))
    on_top, alone = (max(0.0, *(g.ln_bayes_factor for g in some)) for some in (extended, plain))
    assert (found.beside is None) == (found.ln_bayes_factor < LEAST_LN_BAYES_FACTOR)
    told = EvidenceBeside.of(found.ln_bayes_factor, offer(found.fitted), offer(fitted))
    assert told.on_top == pytest.approx(on_top)
    if not told.shape_apart:
        assert told.over == pytest.approx(found.ln_bayes_factor + on_top - alone)


def test_beside_a_free_shape_a_bend_of_the_curve_brings_nothing(fitted) -> None:
    fine, coarse = shape_terms(fitted)
    shaped, _ = beyond_shape(fitted, fine)
    assert max(g.ln_bayes_factor for g in gains(shaped, [*fine, *coarse])) < 0.1
    assert np.linalg.norm(shaped.left) < np.linalg.norm(fitted.left)


def test_the_evidence_of_a_free_curve_is_that_of_more_parameters(line, fitted) -> None:
    """Exactly, where all is linear and the parameters are free."""
    fine, _ = shape_terms(fitted)
    columns = np.concatenate([t.columns for t in fine], axis=1)
    of_channel = np.array([n.sd for n in line.noise])
    span = line.hypothesis.scales.span["displacement"]
    size = span / np.sqrt(np.mean(of_channel**2))
    exact = line.log_evidence(extra=size**2 * columns @ columns.T) - line.log_evidence()
    _, value = beyond_shape(fitted, fine)
    assert value - fitted.ln_evidence == pytest.approx(exact, rel=0.01, abs=0.1)


def test_what_differs_from_sweep_to_sweep_is_seen_beside_a_free_shape(make_line, added) -> None:
    """And a bend that is the same in all of them is not."""
    line = make_line(prior_sd=VAGUE, n=40, seed=3)
    of_cycle = added("of cycle", lambda v: 3.0 * (v["cycle"] - 1.5), 2.0)
    bend = added("bend", lambda v: 3.0 * np.exp(-(((v["temperature"] - 60.0) / 12.0) ** 2)), 2.0)
    seen = {}
    for effect in (of_cycle, bend):
        moved = column_of(effect, line)
        blocks = np.cumsum([0, *(h.n for h in line.hypothesis.histories)])
        some = tuple(
            replace(h, observed={"displacement": h.observed["displacement"] + moved[a:b]})
            for h, a, b in zip(line.hypothesis.histories, blocks[:-1], blocks[1:], strict=True)
        )
        hypothesis = replace(line.hypothesis, histories=some)
        without = fit_hypothesis(hypothesis, line.prior_mean, line.noise)
        with_it = fit_hypothesis(hypothesis.extended(effect), screen(without, effect).start, line.noise)
        gained = with_it.ln_evidence - without.ln_evidence
        assert gained > 20.0
        seen[effect.id] = EvidenceBeside.of(gained, offer(with_it), offer(without)).beyond_shape
    assert seen["of cycle"] > 20.0
    assert seen["bend"] < 1.0


@pytest.mark.parametrize(("on_top", "weight"), [(2.0, 9.433781), (0.0, 8.0), (None, 8.0)])
def test_the_weight_of_an_effect_is_its_mean_with_a_flexible_term_and_without(
    on_top: float | None, weight: float, added
) -> None:
    beside = None if on_top is None else EvidenceBeside(3.0, 0.9, None, on_top, False)
    assert Candidate(added("wave", wave), None, 8.0, beside=beside).weight == pytest.approx(weight)


@pytest.mark.parametrize(
    ("beyond", "carried", "one_stage", "worthy"),
    [
        (5.0, 0.95, -np.inf, True),
        (18.0, 0.95, 90.0, True),
        (17.9, 0.95, 90.0, False),
        (18.0, 0.84, 90.0, False),
        (-4.0, 0.0, 86.0, True),
        (-4.0, 0.0, 88.0, False),
    ],
)
def test_an_effect_is_worthy_in_the_place_of_a_shape_or_beyond_any(
    beyond: float, carried: float, one_stage: float, worthy: bool, added
) -> None:
    """The shape in its place must be worth less by three, or a fifth lie beyond any shape and be the effect's."""
    beside = EvidenceBeside(4.0, 0.95, None, 1.0, False, beyond, carried)
    found = Candidate(added("wave", wave), None, 90.0, 80.0, "order", beside, one_stage=one_stage)
    assert is_worthy(found) is worthy


@pytest.mark.parametrize(
    ("factor", "guard", "over", "carried", "worthy"),
    [
        (9.0, 8.0, None, 0.0, True),
        (9.0, 10.0, None, 0.0, False),
        (9.0, 10.0, 4.0, 0.9, True),
        (9.0, 10.0, 2.0, 0.9, False),
        (9.0, 10.0, 4.0, 0.84, False),
        (2.0, -np.inf, 4.0, 1.0, False),
    ],
)
def test_an_effect_is_worthy_in_the_place_of_what_is_flexible_or_beside_it(
    factor: float, guard: float, over: float | None, carried: float, worthy: bool, added
) -> None:
    beside = None if over is None else EvidenceBeside(over, carried, None, 1.0, False)
    assert is_worthy(Candidate(added("wave", wave), None, factor, guard, "order", beside)) is worthy
