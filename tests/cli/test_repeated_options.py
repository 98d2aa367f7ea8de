"""Options given twice: an error where they take one value, never the last one without a word."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from typer.core import TyperOption

from sma_bayes.cli import command_of_verb
from sma_bayes.studies.registry import VERBS

OPTIONS = [
    (verb, option)
    for verb in VERBS
    for option in command_of_verb(verb).params
    if isinstance(option, TyperOption)
]
OF_ONE_VALUE = [
    pytest.param(verb, name, id=f"{verb}{name}")
    for verb, option in OPTIONS
    if not (option.multiple or option.is_flag)
    for name in option.opts
]
OTHERS = [  # but --json, of which `run` reads the output as such
    pytest.param(verb, option, id=f"{verb}{option.opts[0]}")
    for verb, option in OPTIONS
    if (option.multiple or option.is_flag) and not option.is_eager and option.opts != ["--json"]
]


@pytest.mark.parametrize(("verb", "name"), OF_ONE_VALUE)
def test_one_value_is_given_once(run: Callable[..., Any], verb: str, name: str) -> None:
    outcome = run(verb, name, "1", f"{name}=2" if name.startswith("--") else f"{name}2")
    assert outcome.status == 2
    assert outcome.out == ""
    assert "was given 2 times: it takes one value, give it once" in outcome.err


@pytest.mark.parametrize(("verb", "option"), OTHERS)
def test_what_may_be_repeated_is(run: Callable[..., Any], verb: str, option: TyperOption) -> None:
    given = [option.opts[0]] if option.is_flag else [option.opts[0], "1"]
    outcome = run(verb, *given, *given, "--help")
    assert outcome.status == 0
    assert outcome.out.startswith("Usage: ")
