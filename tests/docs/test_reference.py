"""The reference says of each document what its declaration says."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest
from jsonschema import Draft202012Validator

from sma_bayes.runs.schema import json_schema
from sma_bayes.studies.registry import declared_documents

DOCUMENTS = declared_documents()
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def generator() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_reference", ROOT / "scripts" / "make_reference.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_what_is_published_is_what_is_declared(generator: ModuleType) -> None:
    for path, text in generator.written().items():
        assert path.read_text(encoding="utf-8") == text, f"{path.name}: run scripts/make_reference.py"
    published = {path.name for path in (ROOT / "docs" / "reference" / "schemas").iterdir()}
    assert published == {f"{verb}.schema.json" for verb in DOCUMENTS}


@pytest.mark.parametrize("verb", DOCUMENTS)
def test_a_schema_is_one_by_the_standard_and_describes_every_key(verb: str) -> None:
    schema = json_schema(DOCUMENTS[verb])
    Draft202012Validator.check_schema(schema)
    for part in (schema, *schema.get("$defs", {}).values()):
        assert part["description"]
        for key, told in part["properties"].items():
            assert told.get("description"), f"{part['title']}.{key}"
