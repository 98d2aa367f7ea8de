"""What a study says of its candidates, and what it stores of every sample."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sma_bayes.effects import EFFECTS
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.types import Branch, Campaign, Condition, Record
from sma_bayes.studies.gap.cautions import cautions
from sma_bayes.studies.gap.check import LEAST_SAMPLES, comparable
from sma_bayes.studies.gap.document import THRESHOLDS, gap_of_model
from sma_bayes.studies.gap.outcome import GapOutcome, gap_outcome, judgement, probability
from sma_bayes.studies.gap.schema import EffectParameter, GapOfModel
from sma_bayes.studies.gap.series import series_columns, series_of
from sma_bayes.studies.gap.store import posterior_tree

UNITS = {"temperature": "degC", "time": "s", "displacement": "m"}


def spring(condition: str, branch: Branch, rng: np.random.Generator, training: float) -> Record:
    """A spring in four cycles."""
    up = np.linspace(25.0, 75.0, 30)
    heating = branch is Branch.HEATING
    temperature = np.tile(up if heating else up[::-1], 4)
    cycle = np.repeat(np.arange(4.0), 30)
    clock = 60.0 * cycle + np.tile(np.arange(30.0), 4) + 30.0 * (not heating)
    stroke = 0.01 + 0.02 / (1.0 + np.exp(-0.32 * (temperature - (52.0 if heating else 46.0))))
    stroke = stroke + training * (1.0 - np.exp(-cycle / 1.5)) + 5e-5 * rng.standard_normal(120)
    inputs = {"temperature": temperature, "time": clock, "cycle": cycle + 1.0, "segment": cycle}
    return Record(
        Condition(condition), branch, inputs, {"displacement": stroke}, clock.astype(int) + 2, UNITS
    )


@pytest.fixture(scope="module")
def springs() -> Campaign:
    rng = np.random.default_rng(4)
    records = [spring(c, b, rng, 6e-4) for c in ("a", "b") for b in Branch]
    return Campaign("springs", "springs", "0" * 64, tuple(records))


@pytest.fixture(scope="module")
def outcome(springs: Campaign) -> GapOutcome:
    few = {name: EFFECTS[name] for name in ("training_drift", "amplitude_fatigue", "saturation")}
    return gap_outcome(springs, read_priors("modified_sigmoid"), pooled=True, effects=few)


def test_statuses_come_with_their_reason(outcome):
    told = {c.effect.id: judgement(outcome.study, c) for c in outcome.study.steps[0].candidates}
    assert told["training_drift"][0] == "named"
    assert told["amplitude_fatigue"][0] == "rejected"
    assert told["saturation"] == ("untestable", "force was not observed")


def test_without_a_name_what_was_added_is_only_partial(outcome):
    unnamed = replace(outcome, study=replace(outcome.study, verdict="unnamed"))
    found = gap_of_model(unnamed)
    assert found.effects == ()
    assert [e.id for e in found.partial] == ["training_drift"]
    first = found.candidates[0]
    assert (first.id, first.status) == ("training_drift", "rejected")
    assert "too much of the disagreement remains" in first.why


def test_a_made_needless_effect_is_not_named(outcome):
    study = replace(outcome.study, final=outcome.study.baseline)
    status, why = judgement(study, outcome.study.steps[0].candidates[0])
    assert (status, why) == ("rejected", "added in round 1, and made needless by what was added later")


def test_probability_shares_one_half_among_what_was_tested(outcome):
    step = outcome.study.steps[0]
    even = tuple(replace(c, ln_bayes_factor=0.0, beside=None) for c in step.candidates)
    best = replace(step.look.best, ln_bayes_factor=0.0)
    level = replace(step, candidates=even, look=replace(step.look, gains=[best]))
    tested = [c for c in even if not c.untestable]
    assert probability(level, tested[0]) == pytest.approx(0.5 / (len(tested) + 1))


@pytest.mark.parametrize(
    ("p_value", "memory", "missed"), [(0.5, 0.5, False), (0.01, 0.5, True), (0.5, 0.96, True)]
)
def test_what_is_left_and_noise_that_lasts_are_taken_for_misfit(outcome, p_value, memory, missed):
    last = outcome.study.steps[-1]
    noise = tuple(replace(n, memory=np.full(n.memory.size, memory)) for n in outcome.study.final.noise)
    study = replace(
        outcome.study,
        final=replace(outcome.study.final, noise=noise),
        steps=(*outcome.study.steps[:-1], replace(last, look=replace(last.look, p_value=p_value))),
    )
    assert study.misses_something is missed


def test_numbers_are_those_of_least_squares_where_something_is_left():
    """A training that grows by a kink, which no law of the catalogue does: without it at 0.2 mm, with it at 3."""
    rng = np.random.default_rng(4)
    records = [bent(spring(c, b, rng, 6e-4)) for c in ("a", "b") for b in Branch]
    campaign = Campaign("springs", "springs", "0" * 64, tuple(records))
    few = {"training_drift": EFFECTS["training_drift"]}
    found = gap_outcome(campaign, read_priors("modified_sigmoid"), pooled=True, effects=few)
    assert found.study.misses_something
    stated = gap_of_model(found)
    assert stated.readings_as_one == found.readings_as_one > 1.0
    (said,) = (text for text in cautions(stated) if "least squares" in text)
    assert f"{found.readings_as_one:.3g} readings count as one" in said
    (effect,) = stated.added
    low, _, high = effect.parameters["d"].quantiles
    sds = np.sqrt(np.diag(found.study.final.covariance))
    z = found.study.final.hypothesis.space.names.index("training_drift.d")
    assert high - low > 2.0 * 3.29 * sds[z]


def bent(record: Record) -> Record:
    """The same with a curve that is not the model's: a fifth of its stroke comes 8 K later."""
    temperature = record.inputs["temperature"]
    middle = 60.0 if record.branch is Branch.HEATING else 54.0
    late = 4e-3 * (1.0 / (1.0 + np.exp(-0.9 * (temperature - middle))))
    return replace(record, observed={"displacement": record.observed["displacement"] + late})


def test_series_add_up(outcome):
    series = series_of(outcome.study, outcome.flat)
    observed = np.concatenate([h.observed["displacement"] for h in outcome.study.final.hypothesis.histories])
    np.testing.assert_allclose(series.measured, observed, rtol=1e-12)
    columns = series_columns(outcome.study, series)
    assert {len(v) for v in columns.values()} == {observed.size}
    cycle = np.array(columns["cycle"])
    added = series.effects["training_drift"]
    assert np.all(added["q05"] <= added["median"])
    assert np.all(added["median"] <= added["q95"])
    np.testing.assert_allclose(added["median"][cycle == 1.0], 0.0, atol=1e-15)
    hidden = 6e-4 * (1.0 - np.exp(-2.0))
    assert np.median(added["median"][cycle == 4.0]) == pytest.approx(hidden, rel=0.1)
    left = outcome.study.final.whiten(series.measured - series.after)
    np.testing.assert_allclose(series.whitened_after, left, atol=1e-8)


def test_the_tree_holds_draws_with_units_and_the_prior_of_effects_alone(outcome):
    tree = posterior_tree(outcome, outcome.draws, seed=0)
    assert set(tree["prior"].data_vars) == {"training_drift.d", "training_drift.N0"}
    assert tree["posterior"]["training_drift.d"].attrs["unit"] == "m"
    assert tree["posterior"]["A1 heating"].shape == tree["sample_stats"]["lp"].shape


@pytest.mark.parametrize(("low", "high", "far"), [(0.0, 1.0, False), (2.1, 3.0, True), (-3.0, -2.1, True)])
def test_a_posterior_beyond_the_literature_is_noticed(low: float, high: float, far: bool):
    told = {"unit": "m", "meaning": "growth", "q05": low, "median": low, "q95": high}
    told |= {"rhat": 1.0, "ess_bulk": 1e3, "ess_tail": 1e3, "prior": {"q05": -2.0, "q95": 2.0}}
    assert EffectParameter.model_validate(told).outside_prior is far


EFFECT: dict[str, Any] = {
    "id": "x", "title": "", "equation": "", "reference": "", "round": 1, "class": ["x", "y"], "probability": 1.0,
    "ln_bayes_factor": 9.0, "guard": None, "guard_covariate": "", "ln_bayes_factor_beside": None, "share": None,
    "shape_apart": False,
    "share_in_own_noise": None, "ln_bayes_factor_beyond_shape": None,
    "one_stage": None, "remainder": None, "parameters": {},
    "next_experiment": None,
}  # fmt: skip
NOISE: dict[str, Any] = {
    "condition": "c",
    "channel": "force",
    "sd": 1.0,
    "lag1": 0.1,
    "scatter": 1.0,
    "growth": 0.3,
    "growth_sd": 0.1,
}
NOTHING: dict[str, Any] = {
    "verdict": "named", "p_value": 1e-9, "p_value_extrapolated": False, "steady_noise": False, "converged": True,
    "disagreement": [],
    "within_chance": [], "periodic": [], "effects": [EFFECT], "partial": [], "candidates": [], "rounds": [],
    "remaining": {
        "p_value": 0.5, "channel": "force", "covariate": "time", "ln_bayes_factor": 0.0, "share": 0.0,
        "share_without_shape": 0.0,
    },
    "gap": {
        "metric": "", "before": 2.0, "after": 1.0, "floor": 1.0, "shrink": 1.0, "noise": 1.0, "way_to_noise": 1.0,
        "channels": {}, "held_out": "", "chosen_without": [["x"], ["y"]],
    },
    "thresholds": THRESHOLDS.as_json(), "sweeps": {"law": None, "numbers": []}, "suspects": [],
    "channels": {
        "force": {"name": "force", "symbol": "F", "unit": "N"},
        "displacement": {"name": "strain", "symbol": "e", "unit": "1"},
    },
    "units": {}, "conditions": [], "noise": [],
}  # fmt: skip
"""A named verdict with nothing to doubt."""


def doubtful(**changes: Any) -> GapOfModel:
    """The same but for the changes."""
    parts = {key: NOTHING[key] | changes.pop(key) for key in ("gap", "remaining") if key in changes}
    return GapOfModel.model_validate(NOTHING | parts | changes)


def noisy(p_value: float) -> dict[str, Any]:
    """Noise of a channel whose spectrum has a band that is not its model's."""
    band = {"start": 0.1, "stop": 0.2, "unit": "Hz", "ratio": 3.2, "p_value": p_value}
    return {**NOISE, "spectrum": band}


HELPING = {"verdict": "unnamed", "effects": [], "partial": [EFFECT]}


def loaded(effect: str, *loads: float) -> dict[str, Any]:
    """An effect that was named, of conditions under these loads [N]."""
    told = {"n": 50, "cycles": 1, "rows_averaged": 1}
    named = {**EFFECT, "id": effect, "class": [effect]}
    return {
        "effects": [named],
        "gap": {"chosen_without": [[effect]]},
        "conditions": [{"id": f"run-{i}", "settings": {"load": w}, **told} for i, w in enumerate(loads)],
    }


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({}, []),
        ({"gap": {"after": 1.9, "shrink": 0.1}}, ["closes 10 % of what can be explained"]),
        ({"gap": {"chosen_without": [["x"], ["z"]]}}, ["in 1 of 2 cases"]),
        (
            {"remaining": {"p_value": 1e-9, "channel": "force", "covariate": "time", "share": 0.08}},
            ["(p < 10⁻⁶), with a remainder of 8 % along time, in force."],
        ),
        (
            {
                "remaining": {
                    "p_value": 1e-9,
                    "channel": "temperature shift",
                    "covariate": "displacement",
                    "share": 1e-3,
                }
            },
            ["with a remainder of less than 1 % along strain, in all channels, as a shift of temperature."],
        ),
        (
            {"remaining": {"p_value": 1e-9, "channel": "force", "covariate": "temperature", "share": 0.17}},
            ["17 % along temperature, in force. That is the shape of the curve, the same in every cycle"],
        ),
        ({"gap": {"after": 1.4, "floor": 1.4}}, ["still 1.40 times what noise alone"]),
        (
            {"noise": [{**NOISE, "channel": "displacement", "lag1": 0.97, "spectrum": None}]},
            ["What passes for noise of c strain hardly changes from sample to sample (correlation 0.97"],
        ),
        (
            {"steady_noise": True},
            ["At first nothing was seen: one cycle unlike the others, or jumps, had passed"],
        ),
        ({"noise": [noisy(2e-3)]}, []),
        (
            {"noise": [noisy(1e-4), noisy(1e-6), noisy(0.5)]},
            [
                "The noise of c force does not look like its model, AR(1): between 0.1 and 0.2 Hz it has 3.2 times the "
                "power that is assumed (so do 1 of the others)."
            ],
        ),
        (loaded("dead_load", 1.0, 2.0), ["dead_load: whatever else differs between run-0 and run-1"]),
        (loaded("stress_shift", 1.0, 2.0), ["a third load tells, or one of the two measured again"]),
        (
            {
                **loaded("dead_load", 1.0, 2.0),
                "verdict": "unnamed",
                "effects": [],
                "partial": [{**EFFECT, "id": "dead_load"}],
                "gap": {"after": 1.9},
            },
            ["dead_load: whatever else"],
        ),
        (loaded("dead_load", 1.0, 2.0, 3.0), []),
        (
            loaded("run_offset", 1.0, 2.0, 3.0),
            [
                "run_offset says how much conditions differ, not why: each has load of its own, and a law of that"
            ],
        ),
        (
            {
                **loaded("run_offset", 1.0, 2.0, 3.0),
                "verdict": "unnamed",
                "effects": [],
                "partial": [
                    {
                        **EFFECT,
                        "id": "run_offset",
                        "follows": {"covariate": "ambient_temperature", "share": 0.987, "member": None},
                    }
                ],
                "gap": {"after": 1.9},
            },
            [
                "run_offset is no name: 99 % of what conditions have of their own goes with their ambient temperature"
            ],
        ),
        (
            {
                **loaded("cycle_offset", 1.0),
                "verdict": "unnamed",
                "effects": [],
                "partial": [
                    {
                        **EFFECT,
                        "id": "cycle_offset",
                        "follows": {"covariate": "cycle", "share": 0.96, "member": "cycle 4 of 2A"},
                    }
                ],
                "gap": {"after": 1.9},
            },
            ["cycle_offset is no name: 96 % of how cycles differ is cycle 4 of 2A alone"],
        ),
        (
            {
                **loaded("cycle_offset", 1.0),
                "verdict": "unnamed",
                "effects": [],
                "partial": [
                    {
                        **EFFECT,
                        "id": "cycle_offset",
                        "follows": {"covariate": "cycle", "share": 0.96, "member": None, "settles": True},
                    }
                ],
                "gap": {"after": 1.9},
            },
            ["cycle_offset is no name: 96 % of what cycles have of their own settles with the cycle in each"],
        ),
        (loaded("run_offset", 1.0, 2.0, 1.0), ["run_offset says how much conditions differ, not why."]),
        (loaded("run_offset", 1.0, 1.0), ["run_offset says how much conditions differ, not why."]),
        (
            loaded("cycle_offset", 1.0),
            ["cycle_offset says how much cycles differ, not why: what follows slowly"],
        ),
        (
            {"readings_as_one": 12.3},
            ["those of least squares, and 12.3 readings count as one in their intervals"],
        ),
        (loaded("dead_load", 1.0, 2.0, 1.0), []),
        (loaded("training_drift", 1.0, 2.0), []),
        ({"verdict": "unnamed", "effects": []}, []),
        ({**HELPING, "gap": {"after": 2.02}}, ["is 2.020 with it and 2.000 without"]),
        ({**HELPING, "gap": {"after": 1.9}}, []),
    ],
)
def test_cautions_say_what_speaks_against_a_name(changes: dict[str, Any], says: list[str]):
    told = cautions(doubtful(**changes))
    assert len(told) == len(says)
    assert all(part in text for part, text in zip(says, told, strict=True))


def test_a_condition_needs_enough_samples_of_both_branches_together(springs):
    few = [
        replace(
            r,
            inputs={k: v[: LEAST_SAMPLES // 2 - 1] for k, v in r.inputs.items()},
            observed={k: v[: LEAST_SAMPLES // 2 - 1] for k, v in r.observed.items()},
            row=r.row[: LEAST_SAMPLES // 2 - 1],
        )
        for r in springs.records[:2]
    ]
    with pytest.raises(Exception, match=f"has {LEAST_SAMPLES - 2} samples"):
        comparable(replace(springs, records=(*few, *springs.records[2:])))


def test_what_can_be_compared_stays_as_it_is(springs):
    found = comparable(springs)
    assert found.remarks == ()
    assert [r.key for r in found.campaign.records] == [r.key for r in springs.records]
