"""Parts of a summary come back as they were; a spoilt one is told of."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from sma_bayes.assess.correlation import Agreement, agreement
from sma_bayes.assess.correlation_average import Averages, Scored
from sma_bayes.assess.loops import QuantityInterval
from sma_bayes.errors import OutputError
from sma_bayes.runs.fit_document import RecordSummary, TemperatureSummary
from sma_bayes.studies.fit.parts import Part, part_path, read_part, remove_parts, write_part


def scored(seed: int) -> Scored:
    rng = np.random.default_rng(seed)
    found = agreement(rng.standard_normal(20), rng.standard_normal((50, 20)), parameters=4)
    return Scored("c-heating", "heating", "force", "force", "N", "c-heating", True, found, "replicated")


def test_a_part_comes_back_as_it_was(tmp_path: Path) -> None:
    record = RecordSummary(
        condition="c", branch="heating", key="c-heating", n=20, channels=("force",), quantities={},
        temperature=TemperatureSummary(unit="degC", lowest=0.1 + 0.2, highest=90.0), converged=True, adequate=True,
        why=(), model="modified_sigmoid", nearest={}, discrepancy={}, parameters={}, ln_evidence=None,
    )  # fmt: skip
    loop = QuantityInterval(
        name="loop_area", condition="c", channel="force", unit="N degC", q05=None, median=0.1, q95=1.0
    )
    part = Part([record], [loop], [scored(0), scored(1)])
    write_part(tmp_path, "c", part)
    back = read_part(tmp_path, "c")
    assert (back.records, back.loops) == (part.records, part.loops)
    for one, other in zip(part.scored, back.scored, strict=True):
        assert all(
            getattr(one, f.name) == getattr(other, f.name) for f in fields(Scored) if f.name != "agreement"
        )
        for f in fields(Agreement):
            assert np.array_equal(getattr(one.agreement, f.name), getattr(other.agreement, f.name)), f.name
    totals = [Averages(), Averages()]
    for which, found in zip(totals, (part, back), strict=True):
        for s in found.scored:
            which.add(s)
    assert totals[0].entries() == totals[1].entries()


@pytest.mark.parametrize("content", [b"", b"half", b"PK\x03\x04 and no more"])
def test_a_spoilt_part_is_told_of(tmp_path: Path, content: bytes) -> None:
    write_part(tmp_path, "c", Part([], [], []))
    part_path(tmp_path, "c").write_bytes(content)
    with pytest.raises(OutputError, match=r"c\.npz: can't be read") as caught:
        read_part(tmp_path, "c")
    assert "remove the file" in str(caught.value)


def test_parts_are_removed_and_nothing_else(tmp_path: Path) -> None:
    write_part(tmp_path, "c", Part([], [], []))
    (tmp_path / "parts" / "note.txt").write_text("mine", encoding="utf-8")
    remove_parts(tmp_path)
    assert [p.name for p in (tmp_path / "parts").iterdir()] == ["note.txt"]
    (tmp_path / "parts" / "note.txt").unlink()
    remove_parts(tmp_path)
    assert not (tmp_path / "parts").exists()
