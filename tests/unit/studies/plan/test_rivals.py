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
