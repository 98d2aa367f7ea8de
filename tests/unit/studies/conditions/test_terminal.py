"""What the screen says of a study of conditions: units, no absurd numbers, and which prediction to use."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from sma_bayes.runs.documents import CONDITIONS
from sma_bayes.runs.finished_run import FinishedRun
from sma_bayes.studies.conditions.schema import ConditionsDocument
from sma_bayes.studies.conditions.tables import (
    UNINFORMATIVE_SPANS,
    _effect_rows,
    feature_table,
    preferred_way,
)
from sma_bayes.studies.conditions.terminal import conditions_text
from sma_bayes.studies.conditions.workflow import STEP


def held(**ways: tuple[float, float]) -> dict[str, Any]:
    return {
        "condition": "c", "settings": {}, "branch": "heating", "channel": "displacement", "quantity": "displacement",
        "unit": "mm", "temperature_unit": "degC", "span": 2.0, "from": ["a", "b"], "extrapolates": [],
        "prior_led": False, "correction_applied": True, "on_log": False, "file": "held_out/c-heating-displacement.csv",
        "ways": {
            name.replace("_", " "): {
                "covers_curve": covers, "covers_samples": None, "holds_whole": None, "width": 2.0 * width, "error": 0.1,
            }
            for name, (covers, width) in ways.items()
        },
    }  # fmt: skip


def study(*held_out: dict[str, Any]) -> dict[str, Any]:
    return {
        "schema": "sma-bayes/conditions/1", "campaign": "bench", "source": "fit", "seed": 0,
        "options": {"scatter": 0.1, "at": [], "leave_out": [], "model": None}, "model_choice": None, "refitted": [],
        "versions": {}, "data_sha256": "", "specimen": False, "groups": [], "features": [], "effects": [],
        "populations": [], "cautions": [], "remarks": [], "converged": True, "held_out": list(held_out),
        "figures": "none", "stages_s": {}, "stages_cpu_s": {}, "workers": {"where": "here", "lost": []}, "wall_s": 1.0,
        "predictions": [
            {"condition": "new", "settings": {}, "branch": "heating", "from": ["a", "b"], "extrapolates": [],
             "prior_led": False, "temperature": {"unit": "degC", "covered_from": 20.0, "covered_to": 90.0},
             "channels": {},
             "features": [{"name": "As", "channel": "displacement", "unit": "degC", "q05": 60.1, "median": 61.234,
                           "q95": 62.3, "meaning": "start"}]},
        ],
    }  # fmt: skip


def test_a_factor_between_shares_that_are_over_is_left_out_of_the_table() -> None:
    interval = {"q05": 27.0, "median": 18000.0, "q95": 2.7e7}

    def shown(share: float) -> int:
        features = [
            {"condition": c, "branch": "cooling", "name": "share_left", "channel": "displacement", "unit": "1",
             "q05": value, "median": value, "q95": value, "measured": False,
             "defined": 1.0, "at_edge": None, "meaning": "left"}
            for c, value in (("a", 5e-9), ("b", share))
        ]  # fmt: skip
        effect = {
            "feature": "share_left", "branch": "cooling", "channel": "displacement", "unit": "1", "kind": "factor",
            "setting": "load", "setting_unit": "N", "from": 1.0, "to": 2.0, "conditions": ["a", "b"],
            "tested": interval, "beyond": interval, "probability_rises": 0.98, "scatter": None, "spare": 0,
            "defined": 1.0,
            "aliased_with": [], "confounded_with": [],
        }  # fmt: skip
        told = {**study(), "features": features, "effects": [effect]}
        told["groups"] = [
            {
                "conditions": ["a", "b"],
                "stated": ["load"],
                "varied": {},
                "rank": 2,
                "columns": 2,
                "spare": 0,
                "aliased": {},
            }
        ]
        return len(list(_effect_rows(ConditionsDocument.model_validate(told))))

    assert shown(1e-4) == 0
    assert shown(0.1) == 1


def test_every_sure_direction_is_told() -> None:
    """Of an effect of the load on the slope, sure by 98 %, it was said that 0 effects are sure."""
    interval = {"q05": 0.53, "median": 0.65, "q95": 0.84}
    effect = {
        "feature": "greatest_slope", "branch": "heating", "channel": "force", "unit": "1", "kind": "factor",
        "setting": "load", "setting_unit": "N", "from": 1.0, "to": 3.0, "conditions": ["a", "b", "c"],
        "tested": interval, "beyond": interval, "probability_rises": 0.022, "scatter": None, "spare": 1,
        "aliased_with": [], "confounded_with": [], "defined": 1.0,
    }  # fmt: skip
    left = {**effect, "feature": "share_left"}
    found = {**study(held(hierarchical=(0.9, 0.4))), "effects": [effect, left, {**effect, "beyond": None}]}
    text = conditions_text(found)
    assert "greatest slope of force, heating ×0.650 [0.530, 0.840]" in text
    assert "1 of 1 effects have a 95 % sure direction" in text
    assert STEP.told(found) == "1 of 1 effects have a 95 % sure direction, 1 predicted, 1 left out"


def test_of_two_conditions_it_is_told_how_they_differ_and_why_no_more() -> None:
    effect = {
        "feature": "Af", "branch": "heating", "channel": "displacement", "unit": "degC", "kind": "difference",
        "setting": "load", "setting_unit": "N", "from": 1.0, "to": 2.0, "conditions": ["a", "b"],
        "tested": {"q05": 25.3, "median": 29.9, "q95": 35.1}, "beyond": None, "probability_rises": None,
        "scatter": None, "spare": 0, "why": "no condition is left to tell the scatter", "aliased_with": [],
        "confounded_with": [], "defined": 1.0,
    }  # fmt: skip
    text = conditions_text({**study(), "effects": [effect]})
    assert (
        "Af, heating 29.9 [25.3, 35.1] °C" in text
        or "Af of displacement, heating 29.9 [25.3, 35.1] °C" in text
    )
    assert "no more is known: no condition is left to tell the scatter" in text


def test_draws_that_have_no_such_number_are_told_beside_it() -> None:
    interval = {"q05": 50.0, "median": 51.0, "q95": 52.0}
    features = [
        {"condition": "a", "branch": "heating", "name": "midpoint", "channel": channel, "unit": "degC", **interval,
         "measured": False, "defined": defined, "at_edge": None, "meaning": "half-way"}
        for channel, defined in (("force", 0.97), ("displacement", 1.0))
    ]  # fmt: skip
    table = feature_table(
        FinishedRun(Path(), CONDITIONS, ConditionsDocument.model_validate({**study(), "features": features}))
    )
    remarks = [row[-1] for row in table.rows]
    assert remarks == ["none in 3 % of the draws", ""]


def advice(found: dict[str, Any]) -> str:
    return preferred_way(ConditionsDocument.model_validate(found))


def test_units_are_those_that_people_write_and_shares_that_say_nothing_are_not_told() -> None:
    text = conditions_text(study(held(hierarchical=(0.95, 0.2), curves_by_hand=(1.0, 3e22))))
    assert "61.23 [60.10, 62.30] °C" in text
    assert "degC" not in text
    assert "e+22" not in text
    assert "width no limit" in text


def test_of_ways_that_hold_what_was_left_out_the_narrowest_is_advised() -> None:
    found = study(
        held(hierarchical=(0.95, 0.4), curves_by_hand=(0.9, 0.2), parameters_by_hand=(0.3, 0.01)),
        held(hierarchical=(0.95, 0.4), curves_by_hand=(0.8, 0.2), parameters_by_hand=(0.2, 0.01)),
    )
    assert advice(found).startswith(
        "where predictions disagree use curves by hand: its 90 % band, 0.2 of the span wide, held 85 % of the curves "
        "that were left out (of 2: 80 to 90 % each)"
    )
    assert advice(found) in conditions_text(found)


@pytest.mark.parametrize(("held_share", "short"), [(0.85, True), (0.9, False), (1.0, False)])
def test_that_the_advised_band_holds_less_than_it_says_is_told(held_share: float, short: bool) -> None:
    found = study(held(hierarchical=(held_share, 0.4)))
    assert ("less sure than its band says" in advice(found)) == short


def test_where_no_way_holds_it_that_is_said() -> None:
    assert advice(study(held(hierarchical=(0.5, UNINFORMATIVE_SPANS)))).startswith(
        "no method of prediction covers"
    )
    assert advice(study()) == ""
