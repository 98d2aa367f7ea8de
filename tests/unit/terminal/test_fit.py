"""What the screen says of fits that are not adequate."""

from __future__ import annotations

from typing import Any

import pytest

from sma_bayes.assess.adequacy import REMEDIES, SENTENCES
from sma_bayes.terminal.fit import SUBJECTS, adequacy_sentences


def record(key: str, *why: tuple[str, str]) -> dict[str, Any]:
    return {"key": key, "why": [{"kind": kind, "channel": "", "message": text} for kind, text in why]}


def test_an_adequate_run_says_nothing() -> None:
    assert adequacy_sentences([record("a-heating"), record("a-cooling")], "modified_sigmoid") == []


def test_the_sentence_names_record_reason_and_what_to_try() -> None:
    why = ("curve", "the curve misses strain by up to 5.0% of its range, at 60 degC")
    (sentence,) = adequacy_sentences([record("a-heating", why), record("a-cooling")], "modified_sigmoid")
    assert sentence == (
        "The curve does not describe a-heating: the curve misses strain by up to 5.0% of its range, at 60 °C; "
        "try `--model auto` or `sma-bayes gap`."
    )


def test_what_was_tried_already_is_not_advised() -> None:
    for kind in ("curve", "check"):
        (sentence,) = adequacy_sentences([record("a-heating", (kind, "x"))], "auto")
        assert "--model auto" not in sentence
        assert sentence.endswith("`sma-bayes gap`.")


def test_many_records_are_counted_and_the_first_reason_is_that_of_the_first() -> None:
    records = [record(f"{i}-heating", ("curve", f"reason {i}"), ("check", "another")) for i in range(5)]
    (sentence,) = adequacy_sentences(records, "modified_sigmoid")
    assert sentence.startswith(
        "The curve does not describe 0-heating, 1-heating, 2-heating and 2 more: 0-heating: reason 0;"
    )


def test_kinds_are_told_apart() -> None:
    records = [record("a", ("noise", "x")), record("b", ("prior", "y")), record("c", ("tempered", "z"))]
    found = adequacy_sentences(records, "modified_sigmoid")
    assert [s.partition(":")[0].split()[-1] for s in found] == ["a", "b", "c"]
    assert len(set(found)) == 3


@pytest.mark.parametrize("kind", SENTENCES)
def test_every_kind_of_reason_has_its_words(kind: str) -> None:
    assert "{records}" in SUBJECTS[kind]
    assert REMEDIES[kind]
