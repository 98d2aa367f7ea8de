"""`gap.json` as tools outside the project read it: names and kinds are fixed."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from sma_bayes import study_gap
from sma_bayes.records.types import Branch, Campaign, Condition, Record

NUMBER, TEXT = (int, float), str
PERIODIC = {
    "condition": TEXT, "channel": TEXT, "frequency": NUMBER, "width": NUMBER, "unit": TEXT, "amplitude": NUMBER,
    "size_sigma": NUMBER, "ln_bayes_factor": NUMBER,
}  # fmt: skip
NOISE = {"condition": TEXT, "channel": TEXT, "sd": NUMBER, "lag1": NUMBER, "scatter": NUMBER}
SWEEP = {
    "condition": TEXT, "branch": TEXT, "channel": TEXT, "cycle": NUMBER, "offset": NUMBER, "stroke": NUMBER,
    "shift": NUMBER, "width": NUMBER, "offset_sd": NUMBER, "stroke_sd": NUMBER, "shift_sd": NUMBER, "width_sd": NUMBER,
}  # fmt: skip
LAW = {"form": TEXT, "share": NUMBER, "ln_ratio": NUMBER, "untestable": TEXT}
BAND = {"start": NUMBER, "stop": NUMBER, "unit": TEXT, "ratio": NUMBER, "p_value": NUMBER}
REMAINDER = {"covariate": TEXT, "channel": TEXT, "ln_bayes_factor": NUMBER, "share": NUMBER}
GAP = {
    "verdict": TEXT, "p_value": NUMBER, "disagreement": list, "effects": list, "candidates": list, "gap": dict,
}  # fmt: skip
DISAGREEMENT = {
    "condition": TEXT, "branch": TEXT, "channel": TEXT, "covariate": TEXT, "from": NUMBER, "to": NUMBER, "unit": TEXT,
    "size_sigma": NUMBER,
}  # fmt: skip
EFFECT = {
    "id": TEXT, "title": TEXT, "equation": TEXT, "class": list, "probability": NUMBER, "ln_bayes_factor": NUMBER,
    "parameters": dict, "next_experiment": (str, type(None)),
}  # fmt: skip
PARAMETER = {"unit": TEXT, "median": NUMBER, "q05": NUMBER, "q95": NUMBER}
MAYBE = (int, float, type(None))
CANDIDATE = {
    "id": TEXT, "ln_bayes_factor": MAYBE, "delta_elpd_held_out": MAYBE, "delta_elpd_se": MAYBE, "status": TEXT,
    "why": TEXT,
}  # fmt: skip
GAINED = {
    "metric": TEXT, "before": NUMBER, "after": NUMBER, "floor": NUMBER, "shrink": NUMBER, "held_out": TEXT,
    "noise": NUMBER, "way_to_noise": NUMBER, "channels": dict,
}  # fmt: skip
CHANNEL = {
    "unit": TEXT, "before": NUMBER, "after": NUMBER, "noise": NUMBER, "before_sigma": NUMBER, "after_sigma": NUMBER,
    "way_to_noise": NUMBER,
}  # fmt: skip


def campaign(training: float) -> Campaign:
    """Two springs, four cycles each, that grow by `training` metres while they are trained."""
    rng = np.random.default_rng(4)
    records = []
    for condition in ("a", "b"):
        for branch, middle in ((Branch.HEATING, 52.0), (Branch.COOLING, 46.0)):
            up = np.linspace(25.0, 75.0, 30)
            temperature = np.tile(up if branch is Branch.HEATING else up[::-1], 4)
            cycle = np.repeat(np.arange(4.0), 30)
            clock = 60.0 * cycle + np.tile(np.arange(30.0), 4) + 30.0 * (branch is Branch.COOLING)
            stroke = 0.01 + 0.02 / (1.0 + np.exp(-0.32 * (temperature - middle)))
            stroke = stroke + training * (1.0 - np.exp(-cycle / 1.5)) + 5e-5 * rng.standard_normal(120)
            inputs = {"temperature": temperature, "time": clock, "cycle": cycle + 1.0, "segment": cycle}
            units = {"temperature": "degC", "time": "s", "displacement": "m"}
            records.append(
                Record(
                    Condition(condition),
                    branch,
                    inputs,
                    {"displacement": stroke},
                    clock.astype(int) + 2,
                    units,
                )
            )
    return Campaign("springs", "springs", "0" * 64, tuple(records))


@pytest.fixture(scope="module", params=[0.0, 6e-4], ids=["nothing hidden", "training hidden"])
def found(request: pytest.FixtureRequest) -> Any:
    """A study, written and read as JSON."""

    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is not JSON")

    study = study_gap(campaign(request.param), pool="campaign", jobs=1)
    return json.loads(json.dumps(study), parse_constant=refuse)


def holds(document: Mapping[str, Any], kinds: Mapping[str, Any]) -> None:
    assert set(kinds) <= set(document)
    for key, kind in kinds.items():
        assert isinstance(document[key], kind), (key, document[key])
        assert not isinstance(document[key], bool), key


def test_the_published_schema_takes_it(found: Any, published: Callable[[str], Draft202012Validator]) -> None:
    published("gap").validate(found)
    less = {**found, "remaining": {**found["remaining"]}}
    del less["remaining"]["share"]
    assert not published("gap").is_valid(less)


def test_names_and_kinds_are_those_of_the_contract(found: Any) -> None:
    assert found["schema"] == "sma-bayes/gap/1"
    holds(found, GAP)
    holds(found["gap"], GAINED)
    assert set(found["gap"]["channels"]) == set(found["channels"])
    for channel in found["gap"]["channels"].values():
        holds(channel, CHANNEL)
    for d in (*found["disagreement"], *found["within_chance"]):
        holds(d, DISAGREEMENT)
        assert d["branch"] in ("heating", "cooling")
        assert d["from"] <= d["to"]
    for line in found["periodic"]:
        holds(line, PERIODIC)
    for sweep in found["sweeps"]["numbers"]:
        holds(sweep, SWEEP)
    assert (found["sweeps"]["law"] is None) == (found["verdict"] == "none")
    if found["sweeps"]["law"] is not None:
        holds(found["sweeps"]["law"], LAW)
    assert found["suspects"] == []
    for n in found["noise"]:
        holds(n, NOISE)
        if n["spectrum"] is not None:
            holds(n["spectrum"], BAND)
    for c in found["candidates"]:
        holds(c, CANDIDATE)
        assert c["status"] in ("named", "rejected", "untestable")
        assert (c["ln_bayes_factor"] is None) == (c["status"] == "untestable")
    for e in (*found["effects"], *found["partial"]):
        holds(e, EFFECT)
        assert e["class"][0] == e["id"]
        assert 0.0 <= e["probability"] <= 1.0
        assert 0.0 <= e["share"] <= 1.0
        if e["remainder"] is not None:
            holds(e["remainder"], REMAINDER)
            assert e["remainder"]["share"] == pytest.approx(1.0 - e["share"])
        for p in e["parameters"].values():
            holds(p, PARAMETER)
            assert p["q05"] <= p["median"] <= p["q95"]


def test_the_parts_agree_with_the_verdict(found: Any) -> None:
    named = [c["id"] for c in found["candidates"] if c["status"] == "named"]
    assert named == [e["id"] for e in found["effects"]]
    assert (found["verdict"] == "named") == bool(named)
    assert (found["verdict"] == "none") == (not found["disagreement"])
    assert (found["verdict"] == "none") == (found["p_value"] > found["thresholds"]["p_value"])
    assert found["verdict"] != "none" or not found["periodic"]
    gap = found["gap"]
    way = (gap["before"] - gap["after"]) / (gap["before"] - 1.0) if gap["before"] > 1.0 else 0.0
    assert gap["way_to_noise"] == pytest.approx(way, abs=1e-9)
    if gap["before"] > gap["floor"]:
        share = (gap["before"] - gap["after"]) / (gap["before"] - gap["floor"])
        assert gap["shrink"] == pytest.approx(share, abs=1e-9)
    else:
        assert gap["shrink"] == 0.0


def test_every_effect_of_the_catalogue_is_judged_once(found: Any) -> None:
    from sma_bayes.effects import EFFECTS

    assert sorted(c["id"] for c in found["candidates"]) == sorted(EFFECTS)


@pytest.fixture(scope="module")
def heated() -> Any:
    """The same springs without training, warmed by a current that is switched."""
    plain = campaign(0.0)
    rng = np.random.default_rng(6)
    gain, loss, room = 2.0, 0.05, 20.0
    records = []
    for record in plain.records:
        on = record.branch is Branch.HEATING
        goal = room + gain * 1.5**2 / loss if on else room
        passed = np.tile(np.arange(30.0), 4)
        low = room + (goal - room) / (1.0 + np.exp(30.0 * loss)) if on else None
        top = room + gain * 1.5**2 / loss * (1.0 - 1.0 / (1.0 + np.exp(30.0 * loss)))
        temperature = goal + ((low if on else top) - goal) * np.exp(-loss * passed)
        middle = 52.0 if on else 46.0
        stroke = (
            0.01 + 0.02 / (1.0 + np.exp(-0.32 * (temperature - middle))) + 2e-4 * rng.standard_normal(120)
        )
        inputs = {
            **record.inputs,
            "temperature": temperature + 0.05 * rng.standard_normal(120),
            "current": np.full(120, 1.5 if on else 0.0),
        }
        records.append(
            replace(
                record,
                inputs=inputs,
                observed={"displacement": stroke},
                units={**record.units, "current": "A"},
            )
        )
    study = study_gap(replace(plain, records=tuple(records)), pool="campaign", jobs=1)
    return json.loads(json.dumps(study))


def test_where_temperature_is_an_outcome_heating_holds_the_same_keys(heated: Any) -> None:
    heating = heated["heating"]
    holds(heating, GAP)
    holds(heating["gap"], GAINED)
    assert set(heating["gap"]["channels"]) == {"temperature"}
    assert "temperature" not in heated["channels"]
    assert set(heated) - set(heating) >= {"schema", "heating"}
    assert heating["verdict"] == "none", heating["p_value"]
    of_heat = {c["id"] for c in heating["candidates"]}
    assert {"latent_heat", "thermocouple_lag", "convective_loss"} <= of_heat
    assert of_heat & {c["id"] for c in heated["candidates"]} == {"thermocouple_lag", "contact_error"}
    for name, unit in {"gain": "K/(s A^2)", "loss": "1/s", "time_constant": "s", "switching": "1"}.items():
        holds(heating["parameters"][name], PARAMETER)
        assert heating["parameters"][name]["unit"] == unit
    known = {"gain": 2.0, "loss": 0.05, "time_constant": 20.0, "ambient": 20.0, "switching": 1.0}
    for name, true in known.items():
        p = heating["parameters"][name]
        assert abs(p["median"] - true) < 2.5 * (p["q95"] - p["q05"]) / 2.0, (name, p)


def test_without_a_current_there_is_no_heating(found: Any) -> None:
    assert found["heating"] is None
