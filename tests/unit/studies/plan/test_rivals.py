"""The campaign of a gap study is looked for where the study says, or the call."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from sma_bayes.studies.plan import rivals


@pytest.mark.parametrize(("given", "expected"), [(None, "kept"), (Path("given"), "given")])
def test_data_are_where_the_study_or_the_call_says(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, given: Path | None, expected: str
) -> None:
    asked = []

    def read(source: str, *, data_dir: object) -> SimpleNamespace:
        asked.append((source, str(data_dir)))
        return SimpleNamespace(sha256="0")

    found = SimpleNamespace(source="bench", data_dir="kept", data_sha256="0")
    monkeypatch.setattr(rivals, "GAP", SimpleNamespace(is_in=lambda folder: True))
    monkeypatch.setattr(rivals, "read_document", lambda *call: found)
    monkeypatch.setattr(rivals, "read_campaign", read)
    monkeypatch.setattr(rivals, "comparable", lambda campaign: SimpleNamespace(campaign=campaign))
    assert rivals.read_gap(tmp_path, given)[0] is found
    assert asked == [("bench", expected)]


@pytest.mark.parametrize(
    ("evidence", "members", "apart", "known"),
    [(2.0, ("a",), False, 2.0), (180.0, ("a",), True, 0.0), (180.0, ("a", "b"), False, 0.0)],
)
def test_a_class_of_the_gap_study_is_not_told_apart(
    evidence: float, members: tuple[str, ...], apart: bool, known: float
) -> None:
    """Neither by a ln Bayes factor of 180, where the better law leaves as much; new measurements begin at none."""
    explanations = tuple(
        SimpleNamespace(name=name, fitted=SimpleNamespace(ln_evidence=value))
        for name, value in (("a", evidence), ("b", 0.0))
    )
    found = SimpleNamespace(added=(SimpleNamespace(class_=members),))
    two = rivals.RivalExplanations(found, None, explanations, ((0, 1),), ())  # type: ignore[arg-type]
    assert two.told_apart((0, 1)) is apart
    assert two.known((0, 1)) == known
