"""The document of a fit: written, read and described from one declaration."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from sma_bayes.errors import OutputError
from sma_bayes.runs.fit_document import FitSummary, ParameterSummary, read_fit
from sma_bayes.runs.schema import json_schema

Edit = Callable[[Path, Callable[[dict[str, Any]], None]], Path]


def test_what_is_read_is_what_was_written_byte_by_byte(finished: Path) -> None:
    written = (finished / "summary.json").read_text(encoding="utf-8")
    assert json.dumps(read_fit(finished).as_json(), indent=1, allow_nan=False) + "\n" == written


def test_the_schema_describes_what_is_written(finished: Path) -> None:
    schema = json_schema(FitSummary)
    Draft202012Validator.check_schema(schema)
    summary = json.loads((finished / "summary.json").read_text(encoding="utf-8"))
    validator = Draft202012Validator(schema)
    validator.validate(summary)
    del summary["records"][0]["parameters"]["A1"]["role"]
    assert [e.message for e in validator.iter_errors(summary)] == ["'role' is a required property"]


def test_every_key_is_declared(finished: Path) -> None:
    def undeclared(part: Any) -> list[str]:
        extra = list(part.model_extra or ())
        for name in part.model_fields_set:
            value = getattr(part, name)
            inside = (
                value.values() if isinstance(value, dict) else value if isinstance(value, tuple) else (value,)
            )
            for x in inside:
                for y in x.values() if isinstance(x, dict) else (x,):
                    extra += undeclared(y) if hasattr(y, "model_fields_set") else []
        return extra

    assert undeclared(read_fit(finished)) == []


def test_a_key_of_a_later_version_is_no_obstacle(run_copy: Path, edit_summary: Edit) -> None:
    assert read_fit(edit_summary(run_copy, lambda s: s["records"][0].update(later=1))).seed == 0


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda s: s["records"][0].pop("adequate"), "lacks 'adequate' in records.0"),
        (
            lambda s: s["records"][1]["parameters"]["A1"].pop("role"),
            "lacks 'role' in records.1.parameters.A1",
        ),
        (lambda s: s["records"][0].update(n="many"), "has 'many' as 'n' in records.0"),
        (lambda s: s.update(records={"a": 1}), "as 'records'"),
    ],
)
def test_what_is_missing_or_of_another_kind_is_named(
    run_copy: Path, edit_summary: Edit, change: Callable[[dict[str, Any]], None], told: str
) -> None:
    with pytest.raises(OutputError, match=told) as caught:
        read_fit(edit_summary(run_copy, change))
    assert "summary.json" in str(caught.value)
    assert "fit again into another folder" in str(caught.value)


def test_what_is_not_finite_is_null() -> None:
    p = ParameterSummary(unit="1", channel="", role="noise", sd=float("nan"), rhat=float("inf"), mean=1.0)
    assert p.as_json() == {"unit": "1", "channel": "", "role": "noise", "mean": 1.0, "sd": None, "rhat": None}
    assert p.of_noise
