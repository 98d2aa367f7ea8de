"""Short options that everybody tries."""

from __future__ import annotations

from collections.abc import Callable
from inspect import getdoc
from pathlib import Path
from typing import Any

import pytest

from sma_bayes import __version__
from sma_bayes.studies.registry import VERBS, command_of


@pytest.mark.parametrize("arguments", [("-h",), ("fit", "-h"), ("ask", "--help")])
def test_help_is_a_letter_away(run: Callable[..., Any], arguments: tuple[str, ...]) -> None:
    outcome = run(*arguments)
    assert outcome.status == 0
    assert outcome.out.startswith("Usage: ")


def test_the_help_has_a_whole_sentence_about_each_verb(run: Callable[..., Any]) -> None:
    told = "".join(run("-h").out.split())
    for verb in VERBS:
        sentence = (getdoc(command_of(verb)) or "").partition("\n")[0].rstrip(".")
        assert verb + "".join(sentence.split()) in told


@pytest.mark.parametrize("option", ["-V", "--version"])
def test_the_version(run: Callable[..., Any], option: str) -> None:
    assert run(option).out == f"sma-bayes {__version__}\n"


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shells_can_complete(run: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, shell: str) -> None:
    monkeypatch.setenv("_SMA_BAYES_COMPLETE", f"source_{shell}")
    assert "_SMA_BAYES_COMPLETE" in run().out


def test_every_step_is_told_on_standard_error(
    run: Callable[..., Any], measured: Path, tmp_path: Path
) -> None:
    options = ("--noise", "independent", "--figures", "none", "--jobs", 1)
    outcome = run("fit", measured, "--out", tmp_path / "out", *options, "-v", "--json")
    assert outcome.status == 0
    assert outcome.out.startswith("{")
    told = outcome.err.splitlines()
    assert any("run-heating, after" in line for line in told)
    assert any("2 of 2: sampled run-cooling" in line for line in told)
    silent = run("fit", measured, "--out", tmp_path / "again", *options)
    assert (silent.status, silent.err) == (0, "")
