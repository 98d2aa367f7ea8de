"""What verbs write and print as JSON comes from declarations, never from dictionaries written by hand.

That each document has the keys that its published schema declares, and no others, is checked wherever a test of
`tests/cli` calls a verb with --json or --out.
"""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from typing import get_args

import pytest

from sma_bayes.studies.registry import VERBS, command_of, declared_documents

PACKAGE = Path(__file__).resolve().parents[2] / "sma_bayes"
MARK = "sma-bayes/run/1"
"""Schema of the mark of a folder, `run.json`: what a run was asked, which only the same verb reads."""
PRIORS = "sma-bayes/priors/1"
"""Schema of files of priors, which are TOML."""
PRINTS_OF_ANOTHER = {"demo": "fit", "paper": "reproduction"}
"""Verbs that print the document of another, or one of another name."""


def nodes() -> Iterator[tuple[str, ast.AST]]:
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            yield f"{path.relative_to(PACKAGE)}:{getattr(node, 'lineno', 0)}", node


def test_no_document_is_a_dictionary_written_by_hand() -> None:
    found = []
    for place, node in nodes():
        if isinstance(node, ast.Dict):
            stated = {
                k.value: v for k, v in zip(node.keys, node.values, strict=True) if isinstance(k, ast.Constant)
            }
            schema = stated.get("schema")
            if schema is not None and not (isinstance(schema, ast.Constant) and schema.value == MARK):
                found.append(place)
    assert found == []


def test_no_dictionary_written_by_hand_is_passed_off_as_a_declared_part() -> None:
    """A constructor is checked by mypy key by key; what `model_validate` is given is not."""
    found = [
        place
        for place, node in nodes()
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and node.func.attr == "model_validate"
        and any(isinstance(inner, ast.Dict) for given in node.args for inner in ast.walk(given))
    ]
    assert found == []


def test_every_name_of_a_schema_is_that_of_a_declared_document() -> None:
    declared = {get_args(d.model_fields["schema_"].annotation)[0] for d in declared_documents().values()}
    named = {
        node.value
        for _, node in nodes()
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and re.fullmatch(r"sma-bayes/.+/\d+", node.value)
    }
    assert named - {MARK, PRIORS} == declared


@pytest.mark.parametrize(
    "verb",
    [
        verb
        for verb, package in VERBS.items()
        if package.__name__.startswith("sma_bayes.")
        and "as_json" in inspect.signature(command_of(verb)).parameters
    ],
)
def test_a_verb_that_prints_json_declares_it(verb: str) -> None:
    assert PRINTS_OF_ANOTHER.get(verb, verb) in declared_documents()
