"""What the screen says of a study of conditions: units, no absurd numbers, and which prediction to use."""

from __future__ import annotations

from typing import Any

from sma_bayes.studies.conditions.tables import HOPELESS, preferred_way
from sma_bayes.studies.conditions.terminal import conditions_text


def held(**ways: tuple[float, float]) -> dict[str, Any]:
    return {
        "condition": "c", "branch": "heating", "quantity": "displacement", "on_log": False, "span": 2.0,
        "extrapolates": [],
        "ways": {
            name.replace("_", " "): {"covers_curve": covers, "width": 2.0 * width, "error": 0.1}
            for name, (covers, width) in ways.items()
        },
    }  # fmt: skip


def study(*held_out: dict[str, Any]) -> dict[str, Any]:
    return {
        "campaign": "bench", "seed": 0, "specimen": False, "groups": [], "effects": [], "cautions": [], "remarks": [],
        "converged": True, "held_out": list(held_out),
        "predictions": [
            {"condition": "new", "branch": "heating", "extrapolates": [], "from": ["a", "b"],
             "features": [{"name": "As", "channel": "displacement", "branch": "heating", "median": 61.234, "q05": 60.1,
                           "q95": 62.3, "unit": "degC"}]},
        ],
    }  # fmt: skip


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
    assert preferred_way(found).startswith(
        "where predictions disagree use curves by hand: its 90 % band held 85%"
    )
    assert preferred_way(found) in conditions_text(found)


def test_where_no_way_holds_it_that_is_said() -> None:
    assert preferred_way(study(held(hierarchical=(0.5, HOPELESS)))).startswith("no way of predicting holds")
    assert preferred_way(study()) == ""
