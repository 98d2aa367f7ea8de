"""Typed documents: what is declared is what is written, read, and stated by the JSON Schema."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from pydantic import Field, ValidationError

from sma_bayes.errors import OutputError
from sma_bayes.runs.documents import Document, sealed
from sma_bayes.runs.schema import DocumentPart, Items, Number, NumberOrNull, json_schema, read_document


class Reading(DocumentPart):
    """One reading."""

    at: Number = Field(description="temperature [°C]")
    value: NumberOrNull = Field(description="what was read [N]")
    remark: str = Field(default="", description="only where there is one")


class Readings(DocumentPart):
    """All of them."""

    schema_: str = Field(alias="schema", description="name and version of this declaration")
    readings: Items[Reading] = Field(description="one after the other")
    by_name: dict[str, Reading] = Field(description="the same by name")


READINGS = Document("read", "readings.json", "sma-bayes/readings/1", "readings")


def readings() -> Readings:
    return Readings(
        schema=READINGS.schema,
        readings=(
            Reading(at=np.float64(2.5), value=float("nan")),
            Reading(at=3, value=np.int64(4), remark="late"),
        ),
        by_name={"one": Reading(at=1.0, value=float("inf"))},
    )


def test_what_is_written_is_as_it_was_given() -> None:
    assert json.dumps(readings().as_json()) == (
        '{"schema": "sma-bayes/readings/1", "readings": [{"at": 2.5, "value": null}, '
        '{"at": 3, "value": 4, "remark": "late"}], "by_name": {"one": {"at": 1.0, "value": null}}}'
    )


def test_what_was_written_is_read_with_keys_of_later_versions(tmp_path: Path) -> None:
    written = sealed({**readings().as_json(), "later": {"than": "this"}})
    (tmp_path / READINGS.file).write_text(json.dumps(written), encoding="utf-8")
    found = read_document(READINGS, Readings, tmp_path)
    assert found.readings[1].remark == "late"
    assert found.by_name["one"].value is None
    assert found.as_json() == written


@pytest.mark.parametrize(
    ("part", "told"),
    [
        ({"at": 1.0}, "lacks 'value' in readings.0"),
        ({"at": None, "value": 1.0}, "has None as 'at' in readings.0, not a finite number"),
        ({"at": True, "value": 1.0}, "has True as 'at' in readings.0, not a finite number"),
        ({"at": 1.0, "value": "1"}, "has '1' as 'value' in readings.0, not a finite number"),
        ({"at": 1.0, "value": 1.0, "remark": 5}, "has 5 as 'remark' in readings.0, not a valid string"),
    ],
)
def test_a_key_that_is_missing_or_of_another_kind_is_named(
    tmp_path: Path, part: dict[str, object], told: str
) -> None:
    written = sealed({"schema": READINGS.schema, "readings": [part], "by_name": {}})
    (tmp_path / READINGS.file).write_text(json.dumps(written), encoding="utf-8")
    with pytest.raises(OutputError) as caught:
        read_document(READINGS, Readings, tmp_path)
    assert caught.value.found == told
    assert caught.value.file == str(tmp_path / READINGS.file)
    assert caught.value.expected
    assert caught.value.remedy
    assert list(jsonschema.Draft202012Validator(json_schema(Readings)).iter_errors(written))


def test_the_schema_takes_what_is_written() -> None:
    jsonschema.Draft202012Validator.check_schema(json_schema(Readings))
    jsonschema.Draft202012Validator(json_schema(Readings)).validate(readings().as_json())


@pytest.mark.parametrize("value", [float("nan"), None, "1", True])
def test_a_number_that_must_be_there_is_not_replaced(value: object) -> None:
    with pytest.raises(ValidationError, match="a finite number"):
        Reading.model_validate({"at": value, "value": 1.0})


@dataclass(frozen=True)
class Sensed:
    """What a part tells of; it knows more than the part tells."""

    at: float
    value: float
    sensor: str = "left"


@dataclass(frozen=True)
class Session:
    """With a schema of its own, which is not that of the document."""

    schema_: str
    readings: tuple[Sensed, ...]


class FromFile(DocumentPart):
    """A reading with the name of its file."""

    source: str
    at: Number


def test_a_key_may_be_called_source() -> None:
    assert FromFile.about(Sensed(20.0, 1.0), source="a.csv").as_json() == {"source": "a.csv", "at": 20.0}


def test_a_part_takes_the_keys_that_are_called_alike_at_any_depth() -> None:
    session = Session("another", (Sensed(20.0, np.nan), Sensed(30.0, 2.0)))
    told = Readings.about(session, schema=READINGS.schema, by_name={"last": session.readings[1]})
    assert told.as_json() == {
        "schema": READINGS.schema,
        "readings": [{"at": 20.0, "value": None}, {"at": 30.0, "value": 2.0}],
        "by_name": {"last": {"at": 30.0, "value": 2.0}},
    }
    with pytest.raises(ValidationError, match="by_name"):
        Readings.about(session, schema=READINGS.schema)


def test_a_part_with_other_keys_leaves_the_first_as_it_was() -> None:
    first = Reading(at=20.0, value=1.0)
    assert (first.but(value=2.0).as_json(), first.value) == ({"at": 20.0, "value": 2.0}, 1.0)
