"""The JSON documents of an output folder, and what is said of those that can't be used."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sma_bayes.checksum import numbers_checksum
from sma_bayes.errors import OutputError
from sma_bayes.runs.documents import (
    COMPARISON,
    CONDITIONS,
    FIT,
    GAP,
    RUN_MARKER,
    STUDY,
    Document,
    files_beside,
    read_mark,
    sealed,
)

DOCUMENTS = (FIT, COMPARISON, GAP, CONDITIONS, STUDY)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda d: d.verb)
def test_what_is_written_is_read(tmp_path: Path, document: Document) -> None:
    written = sealed({"schema": document.schema, **{key: [1, 2] for key in document.keys}})
    (tmp_path / document.file).write_text(json.dumps(written), encoding="utf-8")
    assert document.read(tmp_path) == written
    assert [d.verb for d in DOCUMENTS if d.is_in(tmp_path)] == [document.verb]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("{ broken", "can't be read"),
        ("[]", "has the schema None"),
        ('{"schema": "sma-bayes/gap/9"}', "has the schema 'sma-bayes/gap/9'"),
        ('{"schema": "sma-bayes/gap/1", "effects": [], "partial": [], "gap": {}}', "lacks 'thresholds'"),
    ],
)
def test_a_document_that_can_not_be_used_is_named(tmp_path: Path, text: str, told: str) -> None:
    (tmp_path / "gap.json").write_text(text, encoding="utf-8")
    with pytest.raises(OutputError, match=rf"gap\.json: {told}") as caught:
        GAP.read(tmp_path)
    assert caught.value.remedy


def test_the_mark_tells_what_is_not_finished(tmp_path: Path) -> None:
    assert not GAP.is_in(tmp_path)
    (tmp_path / RUN_MARKER).write_text('{"kind": "gap"}', encoding="utf-8")
    assert [d.verb for d in DOCUMENTS if d.is_in(tmp_path)] == ["gap"]
    with pytest.raises(OutputError, match="holds a gap study that is not finished"):
        GAP.read(tmp_path)


def test_numbers_are_the_same_whatever_a_run_took() -> None:
    """Times, workers, figures and a self-check that came later don't count; any number does."""
    found = {"records": [{"wall_s": 1.0, "n": 3, "parameters": {"B1": {"median": 2.5}}}], "wall_s": 2.0}
    again = {
        "records": [{"wall_s": 9.0, "n": 3, "parameters": {"B1": {"median": 2.5}}, "self_check": {"passes": True}}],
        "wall_s": 8.0, "figures": "all", "workers": {"where": "here"}, "content_sha256": "x",
    }  # fmt: skip
    assert numbers_checksum(found) == numbers_checksum(again)
    other = {"records": [{"n": 3, "parameters": {"B1": {"median": 2.4}}}]}
    assert numbers_checksum(found) != numbers_checksum(other)


@pytest.mark.parametrize("text", [None, "{ broken", "[]"])
def test_a_mark_that_says_nothing(tmp_path: Path, text: str | None) -> None:
    if text is not None:
        (tmp_path / RUN_MARKER).write_text(text, encoding="utf-8")
    assert read_mark(tmp_path) is None
    assert not any(d.is_in(tmp_path) for d in DOCUMENTS)


def run_with_files(folder: Path, document: Document) -> dict[str, object]:
    for name in ("curves/a.csv", "curves/b.csv", "tables/of.csv", "figures/of.csv"):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(f"x\n{len(name)}\n{name}\n", encoding="utf-8")
    found = {"schema": document.schema, **{key: [1] for key in document.keys}}
    written = sealed({**found, "files_sha256": files_beside(folder)})
    (folder / document.file).write_text(json.dumps(written), encoding="utf-8")
    return written


@pytest.mark.parametrize("document", [COMPARISON, CONDITIONS, GAP], ids=lambda d: d.verb)
def test_a_file_that_is_not_the_one_that_was_written_is_refused(tmp_path: Path, document: Document) -> None:
    written = run_with_files(tmp_path, document)
    assert list(written["files_sha256"]) == ["curves/a.csv", "curves/b.csv"]  # type: ignore[call-overload]
    (tmp_path / "tables/of.csv").write_text("made anew by the report", encoding="utf-8")
    assert document.read(tmp_path) == written
    (tmp_path / "curves/a.csv").write_bytes((tmp_path / "curves/b.csv").read_bytes())
    with pytest.raises(OutputError, match=rf"is not the file that {document.file} tells of") as caught:
        document.read(tmp_path)
    assert caught.value.file == str(tmp_path / "curves/a.csv")
