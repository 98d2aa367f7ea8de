"""`gap.json` as tools outside the project read it: names and kinds are fixed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from sma_bayes.records.types import Branch, Campaign, Condition, Record
from sma_bayes.workflow import study_gap

NUMBER, TEXT = (int, float), str
PERIODIC = {
    "condition": TEXT, "channel": TEXT, "frequency": NUMBER, "width": NUMBER, "unit": TEXT, "amplitude": NUMBER,
    "size_sigma": NUMBER, "ln_bayes_factor": NUMBER,
}  # fmt: skip
NOISE = {"condition": TEXT, "channel": TEXT, "sd": NUMBER, "lag1": NUMBER, "scatter": NUMBER}
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


def test_names_and_kinds_are_those_of_the_contract(found: Any) -> None:
    assert found["schema"] == "sma-bayes/gap/1"
    holds(found, GAP)
    holds(found["gap"], GAINED)
    for d in (*found["disagreement"], *found["within_chance"]):
        holds(d, DISAGREEMENT)
        assert d["branch"] in ("heating", "cooling")
        assert d["from"] <= d["to"]
    for line in found["periodic"]:
        holds(line, PERIODIC)
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
    if gap["before"] > gap["floor"]:
        share = (gap["before"] - gap["after"]) / (gap["before"] - gap["floor"])
        assert gap["shrink"] == pytest.approx(share, abs=1e-9)
    else:
        assert gap["shrink"] == 0.0


def test_every_effect_of_the_catalogue_is_judged_once(found: Any) -> None:
    from sma_bayes.effects import EFFECTS

    assert sorted(c["id"] for c in found["candidates"]) == sorted(EFFECTS)
