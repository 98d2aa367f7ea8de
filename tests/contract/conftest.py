"""What all contract tests share."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

SCHEMAS = Path(__file__).parents[2] / "docs" / "reference" / "schemas"


@pytest.fixture(scope="session")
def published() -> Callable[[str], Draft202012Validator]:
    """The published JSON Schema of what a verb writes or prints, as an independent reader takes it."""

    def validator(verb: str) -> Draft202012Validator:
        return Draft202012Validator(json.loads((SCHEMAS / f"{verb}.schema.json").read_text(encoding="utf-8")))

    return validator
