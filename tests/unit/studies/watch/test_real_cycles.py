"""Real cycles: the first of seven as fitted, the rest as they would come from the logger."""

from __future__ import annotations

from pathlib import Path

import pytest

from sma_bayes.records.campaign import read_campaign
from sma_bayes.studies.watch.evidence import log_evidence
from sma_bayes.studies.watch.reading import FittedSweeps, NewFileReader
from sma_bayes.studies.watch.reference import reference_of

EXAMPLE = Path(__file__).parents[4] / "docs" / "examples" / "smareact_isobaric_7cycle.toml"
ENDS = {4: 3.281, 5: 4.063}
"""Hours at which cycles end, at the hot end."""


def hours(line: str) -> float | None:
    """Time of a row; None of the lines above."""
    try:
        return float(line.strip().strip('"').split(",")[0])
    except ValueError:
        return None


@pytest.mark.parametrize("fitted", [4, 5])
def test_cycles_that_go_on_as_they_trained_are_no_change(
    shared_data: Path, tmp_path: Path, fitted: int
) -> None:
    lines = (shared_data / "smareact_isobaric_7cycle" / "isobaric_7cycle.txt").read_text().splitlines(True)
    times = [hours(line) for line in lines]
    head = next(i for i, h in enumerate(times) if h is not None)
    cut = next(i for i, h in enumerate(times) if h is not None and h >= ENDS[fitted])
    (tmp_path / "isobaric_7cycle.txt").write_text("".join(lines[:cut]))
    (tmp_path / "campaign.toml").write_text(EXAMPLE.read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / "later.txt").write_text("".join([*lines[:head], *lines[cut:]]))
    campaign = read_campaign(tmp_path)
    reference = reference_of(campaign.records, {r.key: "sinh_arcsinh" for r in campaign.records}, 0)
    assert reference.fitted == fitted
    assert reference.law != "none"
    sweeps = {r.branch.value: FittedSweeps(r) for r in campaign.records}
    reader = NewFileReader(campaign.declaration, tmp_path / "campaign.toml", "1096N", sweeps)
    later = reader.read(tmp_path / "later.txt")
    assert len(later.cycles) == 7 - fitted
    evidence = log_evidence(reference.watched([reference.measure(c.sweeps) for c in later.cycles]))
    assert evidence.max() < 3.0
