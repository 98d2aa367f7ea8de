"""Random effects: found where runs or cycles scatter, and never in place of a law that explains how they differ."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.effects import EFFECTS
from sma_bayes.effects.scatter import numbers_of_members
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.history import histories
from sma_bayes.records.types import Campaign
from sma_bayes.studies.gap import scatter
from sma_bayes.studies.gap.fitting import fit_held, fit_with_noise, held_at
from sma_bayes.studies.gap.hypothesis import baseline
from sma_bayes.studies.gap.name import (
    LEAST_LN_BAYES_FACTOR,
    Rivals,
    cancels,
    candidates,
    is_plausible,
    screen_all,
    within_range,
)
from sma_bayes.studies.gap.scatter import followed_setting, holds_beside, lay_together, members_of
from sma_bayes.studies.gap.study import baseline_start, study_campaign

PRIORS = read_priors("modified_sigmoid")
SPAN = 0.02


def moved_by(campaign: Campaign, offsets: dict[str, float], *, by_cycle: bool = False) -> Campaign:
    """A campaign whose conditions, or cycles, are off by so many metres."""
    records = []
    for r in campaign.records:
        x = r.observed["displacement"]
        if by_cycle:
            off = np.array([offsets[f"{int(c)}"] for c in r.inputs["cycle"]])
        else:
            off = np.full(r.n, offsets[r.condition.id])
        records.append(replace(r, observed={**r.observed, "displacement": x + off}))
    return replace(campaign, records=tuple(records))


def baseline_of(campaign: Campaign):
    hypothesis = baseline(campaign, histories(campaign), PRIORS, pooled=True)
    start = baseline_start(hypothesis, campaign, PRIORS, pooled=True, rng=np.random.default_rng(0))
    return fit_with_noise(hypothesis, start)


@pytest.fixture(scope="module")
def scattered_runs(rig) -> Campaign:
    """Four runs of one load whose offsets scatter by some 3 % of the span."""
    plain = rig(periods=(60.0,) * 4, loads=(1.0,) * 4, peaks=(95.0,) * 4, sd=0.004, seed=2).campaign()
    return moved_by(plain, {"c0": 0.03 * SPAN, "c1": -0.045 * SPAN, "c2": 0.01 * SPAN, "c3": 0.005 * SPAN})


def test_runs_that_scatter_are_named_with_their_offsets(scattered_runs: Campaign) -> None:
    found = study_campaign(scattered_runs, PRIORS, pooled=True)
    assert found.verdict == "named"
    assert [e.id for e in found.effects] == ["run_offset"]
    theta = dict(zip(found.final.hypothesis.space.names, found.final.theta.tolist(), strict=True))
    size = theta["run_offset.s"]
    offsets = np.array([size * theta[f"run_offset.u{i}"] for i in range(1, 5)]) / SPAN
    np.testing.assert_allclose(offsets - offsets.mean(), [0.03, -0.045, 0.01, 0.005], atol=0.004)
    assert 0.01 < size / SPAN < 0.1


def test_each_condition_by_itself_absorbs_its_offset(scattered_runs: Campaign) -> None:
    assert study_campaign(scattered_runs, PRIORS, pooled=False).verdict == "none"


def test_cycles_that_scatter_without_an_order_are_no_training(rig) -> None:
    plain = rig(cycles=6, samples=30, periods=(60.0,), loads=(1.0,), peaks=(95.0,), seed=5).campaign()
    off = {"1": 0.0, "2": 0.05, "3": -0.04, "4": 0.06, "5": -0.03, "6": 0.01}
    found = study_campaign(
        moved_by(plain, {k: v * SPAN for k, v in off.items()}, by_cycle=True), PRIORS, pooled=False
    )
    assert [e.id for e in found.effects] == ["cycle_offset"]


@pytest.mark.parametrize("law", ["stress_shift"])
def test_a_law_that_explains_how_runs_differ_is_preferred(law: str, rig) -> None:
    found = study_campaign(rig(shift=2.0).campaign(), PRIORS, pooled=True)
    assert [e.id for e in found.effects] == [law]
    assert "run_offset" not in found.classes[law]


def test_runs_that_follow_their_load_are_no_name(rig) -> None:
    """The law is hidden and not in the catalogue; what the runs have of their own is a straight line in the load."""
    laws = {k: e for k, e in EFFECTS.items() if "stress" not in k}
    found = study_campaign(rig(shift=2.0).campaign(), PRIORS, pooled=True, effects=laws)
    assert [e.id for e in found.effects] == ["run_offset"]
    assert (found.verdict, found.named) == ("unnamed", ())
    assert found.followed["run_offset"].covariate == "load"
    assert found.followed["run_offset"].share > 0.99


def test_one_cycle_that_differs_is_told_as_one(rig) -> None:
    plain = rig(cycles=6, samples=30, periods=(60.0,), loads=(1.0,), peaks=(95.0,), seed=5).campaign()
    off = dict.fromkeys("123456", 0.0) | {"4": 0.06 * SPAN}
    found = study_campaign(moved_by(plain, off, by_cycle=True), PRIORS, pooled=False)
    assert [e.id for e in found.effects] == ["cycle_offset"]
    assert (found.verdict, found.named) == ("unnamed", ())
    assert found.followed["cycle_offset"].member == "cycle 4 of c0"


@pytest.mark.parametrize("conditions", [1, 2])
def test_cycles_that_settle_are_no_name(conditions: int, rig) -> None:
    """What dies away in each condition has a cause, though no law of the catalogue is it; scatter has none."""
    plain = rig(cycles=6, samples=30, periods=(60.0,) * conditions, loads=(1.0,) * conditions,
                peaks=(95.0,) * conditions, seed=5).campaign()  # fmt: skip
    settling = {f"{k + 1}": 0.08 * SPAN * 0.45**k for k in range(6)}
    only = {"cycle_offset": EFFECTS["cycle_offset"]}
    found = study_campaign(moved_by(plain, settling, by_cycle=True), PRIORS, pooled=True, effects=only)
    assert [e.id for e in found.effects] == ["cycle_offset"]
    assert (found.verdict, found.named) == ("unnamed", ())
    followed = found.followed["cycle_offset"]
    assert (followed.covariate, followed.settles, followed.member) == ("cycle", True, None)
    assert 0.95 < followed.share <= 1.0


def test_a_few_cycles_that_differ_are_told_as_few(rig) -> None:
    plain = rig(
        cycles=5, samples=30, periods=(60.0,) * 2, loads=(1.0,) * 2, peaks=(95.0,) * 2, seed=5
    ).campaign()
    records = []
    for r in plain.records:
        off = 0.07 * SPAN * (r.inputs["cycle"] == {"c0": 2.0, "c1": 4.0}[r.condition.id])
        records.append(replace(r, observed={**r.observed, "displacement": r.observed["displacement"] + off}))
    only = {"cycle_offset": EFFECTS["cycle_offset"]}
    found = study_campaign(replace(plain, records=tuple(records)), PRIORS, pooled=True, effects=only)
    assert [e.id for e in found.effects] == ["cycle_offset"]
    assert (found.verdict, found.named) == ("unnamed", ())
    assert found.followed["cycle_offset"].member == "cycle 2 of c0, cycle 4 of c1"


def test_odd_cycles_that_differ_from_even_ones_are_no_name(rig) -> None:
    plain = rig(cycles=6, samples=30, periods=(60.0,), loads=(1.0,), peaks=(95.0,), seed=5).campaign()
    off = {f"{k}": 0.05 * SPAN * (k % 2) for k in range(1, 7)}
    only = {"cycle_offset": EFFECTS["cycle_offset"]}
    found = study_campaign(moved_by(plain, off, by_cycle=True), PRIORS, pooled=False, effects=only)
    assert [e.id for e in found.effects] == ["cycle_offset"]
    assert (found.verdict, found.named) == ("unnamed", ())
    assert found.followed["cycle_offset"].alternates


@pytest.mark.parametrize(("members", "few"), [(8, 2), (12, 3), (15, 3)])
def test_members_that_scatter_are_rarely_told_as_few(members: int, few: int) -> None:
    """Numbers that scatter in one dimension alone, the least that tells: 1 % of 1,000 at most, and 2 % by chance."""
    rng = np.random.default_rng(members)

    def told(x: np.ndarray) -> bool:
        def left(own: list[int]) -> float:
            design = np.column_stack([np.ones(members), np.eye(members)[:, own]])
            rest = x - design @ np.linalg.lstsq(design, x, rcond=None)[0]
            return 1e4 * float(rest @ rest)  # known to a hundredth of how much they scatter

        alone = scatter._alone(left, members)
        return alone is not None and len(alone) == few

    assert sum(told(rng.standard_normal(members)) for _ in range(1000)) <= 20


def test_a_part_of_the_measurements_may_lack_members(rig) -> None:
    """Folds leave cycles out, and what these have of their own is then known by its prior alone."""
    plain = rig(cycles=7, samples=30, periods=(60.0,), loads=(1.0,), peaks=(95.0,), seed=5).campaign()
    off = dict.fromkeys("1234567", 0.0) | {"4": 0.06 * SPAN}
    whole = baseline_of(moved_by(plain, off, by_cycle=True))
    kept = tuple(h.part(h.inputs["cycle"] != 6.0) for h in whole.hypothesis.histories)
    fitted = fit_with_noise(replace(whole.hypothesis, histories=kept), whole.z)
    effect = EFFECTS["cycle_offset"]
    screened, _ = screen_all(fitted, [effect])
    (judged,) = candidates(fitted, screened, [], Rivals.of(fitted))
    assert judged.fitted is not None
    found = followed_setting(judged.fitted, effect)
    assert found is not None
    assert found.member == "cycle 4 of c0"
    two = tuple(h.part(np.isin(h.inputs["cycle"], [4.0, 5.0])) for h in kept)
    hypothesis = replace(judged.fitted.hypothesis, histories=two)
    assert followed_setting(fit_with_noise(hypothesis, judged.fitted.z), effect) is None


def test_runs_of_other_loads_that_do_not_follow_them_are_a_name(rig) -> None:
    loads = (1.0, 1.5, 2.0, 2.5)
    plain = rig(periods=(60.0,) * 4, loads=loads, peaks=(95.0,) * 4, sd=0.004, seed=2).campaign()
    off = {"c0": 0.03 * SPAN, "c1": -0.045 * SPAN, "c2": 0.03 * SPAN, "c3": -0.045 * SPAN}
    found = study_campaign(moved_by(plain, off), PRIORS, pooled=True)
    assert (found.verdict, [e.id for e in found.named]) == ("named", ["run_offset"])
    assert not found.followed


def test_a_setting_is_followed_by_the_share_that_a_weighted_line_explains(scattered_runs: Campaign) -> None:
    """Checked with the numbers of each run, weighed by the inverse of their covariance, by normal equations."""
    fitted = baseline_of(scattered_runs)
    effect = EFFECTS["run_offset"]
    screened, _ = screen_all(fitted, [effect])
    (judged,) = candidates(fitted, screened, [], Rivals.of(fitted))
    assert judged.fitted is not None
    found = judged.fitted
    assert followed_setting(found, effect) is None, "equal settings can't be followed"
    assert followed_setting(found, EFFECTS["stress_shift"]) is None
    at = found.hypothesis.effect_positions["run_offset"]
    numbers, jacobian = numbers_of_members(found.theta[at])
    step = 1e-6 * np.eye(at.size)
    moved = [numbers_of_members(_by_logarithms(found.theta[at], row))[0] for row in step]
    np.testing.assert_allclose(jacobian, (np.stack(moved, axis=1) - numbers[:, None]) / 1e-6, atol=1e-5)
    load = np.array([1.0, 1.2, 1.5, 2.0])
    told = [
        h.of(h.channels, load=np.full(h.n, x)) for h, x in zip(histories(scattered_runs), load, strict=True)
    ]
    values = scatter._settings(told, "run", range(4))["load"]
    np.testing.assert_allclose(values, (load - load.mean()) / load.std())
    cov = jacobian @ found.covariance[np.ix_(at, at)] @ jacobian.T
    left = []
    for columns in (np.ones((4, 1)), np.column_stack([np.ones(4), load])):
        x = np.kron(np.eye(3), columns)
        weight = np.linalg.inv(cov)
        best = np.linalg.solve(x.T @ weight @ x, x.T @ weight @ numbers)
        left.append((numbers - x @ best) @ weight @ (numbers - x @ best))
    whitening = np.linalg.inv(np.linalg.cholesky(cov))
    assert scatter._left(whitening, numbers, np.ones((4, 1))) == pytest.approx(left[0], rel=1e-6)
    own = scatter._left(whitening, numbers, np.column_stack([np.ones(4), values]))
    assert own == pytest.approx(left[1], rel=1e-6)


def _by_logarithms(theta: np.ndarray, step: np.ndarray) -> np.ndarray:
    return np.concatenate([theta[:2] * np.exp(step[:2]), theta[2:] + step[2:]])


def test_screening_lays_all_members_together(scattered_runs: Campaign) -> None:
    fitted = baseline_of(scattered_runs)
    effect = EFFECTS["run_offset"]
    found = lay_together(fitted, effect)
    extended = fitted.hypothesis.extended(effect)
    theta = extended.space.constrain(found.start)[extended.effect_positions["run_offset"]]
    offsets = theta[0] * theta[2:6] / SPAN
    np.testing.assert_allclose(offsets - offsets.mean(), [0.03, -0.045, 0.01, 0.005], atol=0.005)
    screened, _ = screen_all(fitted, [effect])
    (judged,) = candidates(fitted, screened, [], Rivals.of(fitted))
    assert judged.fitted is not None
    reached = judged.fitted.log_likelihood - fitted.log_likelihood
    assert found.gain == pytest.approx(reached, rel=0.1)
    assert screened[0].of(fitted.whitened[:, None])[0] == pytest.approx(screened[0].ln_bayes_factor, abs=1e-6)


def test_a_law_holds_beside_a_random_effect_only_where_it_explains_the_members(rig, scattered_runs) -> None:
    effect = EFFECTS["run_offset"]
    for campaign, holds in ((rig(shift=2.0).campaign(), True), (scattered_runs, False)):
        fitted = baseline_of(campaign)
        screened, _ = screen_all(fitted, [effect])
        (judged,) = candidates(fitted, screened, [], Rivals.of(fitted))
        assert judged.fitted is not None
        assert holds_beside(EFFECTS["stress_shift" if holds else "training_drift"], judged.fitted) is holds


def test_random_effects_say_what_their_members_are() -> None:
    assert {e.id: members_of(e) for e in EFFECTS.values() if members_of(e)} == {
        "run_offset": ("condition",), "cycle_offset": ("cycle",),
    }  # fmt: skip


def test_a_time_constant_that_no_sensor_has_is_not_plausible(rig) -> None:
    fitted = baseline_of(rig(lag=0.4).campaign())
    extended = fitted.hypothesis.extended(EFFECTS["training_drift"])
    drift, pace = 1.0, np.log(12.0)
    assert is_plausible(extended, np.append(fitted.z, [drift, pace]))
    assert not is_plausible(extended, np.append(fitted.z, [drift, np.log(12.0) + 3.5 * 0.85]))


def test_an_effect_with_a_number_beyond_its_range_is_judged_with_the_nearest_within(rig) -> None:
    """The rest is fitted anew, the size too, and nothing adapts by the number that is held."""
    fitted = baseline_of(rig(drift=0.02).campaign())
    extended = fitted.hypothesis.extended(EFFECTS["training_drift"])
    middle, wide = np.log(12.0), 0.85
    far = fit_held(extended, np.append(fitted.z, [0.001, middle + 4.0 * wide]), fitted.noise, 1)
    assert not is_plausible(extended, far.z)
    nearest = within_range(far)
    assert nearest.z[-1] == pytest.approx(middle + 3.2905 * wide, abs=1e-3)
    assert is_plausible(extended, nearest.z)
    assert not np.any(nearest.jacobian[:, -1])
    assert np.any(nearest.jacobian[:, -2])
    again = fit_held(extended, nearest.z, fitted.noise, 1)
    assert nearest.log_likelihood == pytest.approx(again.log_likelihood, abs=0.05)
    assert within_range(nearest) is nearest


def test_numbers_beyond_their_range_do_not_count_where_the_nearest_within_explain_nearly_as_much(rig) -> None:
    """A hundredth of what the effect explains: strong signals tell numbers apart that no form has exactly."""
    fitted = baseline_of(rig(drift=0.02).campaign())
    extended = fitted.hypothesis.extended(EFFECTS["training_drift"])
    far = fit_held(extended, np.append(fitted.z, [0.001, np.log(12.0) + 4.0 * 0.85]), fitted.noise, 1)
    lost = LEAST_LN_BAYES_FACTOR + 3.0
    costly = replace(far, ln_evidence=within_range(far).ln_evidence + lost)
    assert within_range(costly, 90.0 * lost) is costly
    assert is_plausible(extended, within_range(costly, 110.0 * lost).z)


@pytest.mark.parametrize(("share", "beyond"), [(1.9, False), (2.1, True), (-2.1, True)])
def test_an_effect_cannot_add_several_times_what_was_measured(rig, share: float, beyond: bool) -> None:
    fitted = baseline_of(rig(channels=("force", "displacement")).campaign())
    extended = fitted.hypothesis.extended(EFFECTS["bias_spring"])
    span = {b.channel: np.ptp(np.concatenate([fitted.observed[o.at] for o in fitted.blocks if o.channel == b.channel]))
            for b in fitted.blocks}  # fmt: skip
    stiffness = share * span["force"] / span["displacement"]
    position = extended.effect_positions["bias_spring"]
    theta = np.append(fitted.theta, stiffness)
    assert position.tolist() == [theta.size - 1]
    assert cancels(held_at(extended, extended.space.unconstrain(theta), fitted.noise)) is beyond
