"""The campaign of the simulated rig: its files are read like any other, and its truth is not far from them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sma_bayes import read_campaign
from sma_bayes.errors import UnknownNameError
from sma_bayes.simulated.campaign import (
    LOADS,
    SOURCE,
    course_of,
    log_of,
    measurement_files,
    simulated_campaign,
    truth_of,
)
from sma_bayes.simulated.rig import DEFAULT_RIG, GRAVITY


def test_the_files_are_the_campaign(tmp_path: Path) -> None:
    for name, text in measurement_files(5).items():
        (tmp_path / name).write_text(text, encoding="utf-8", newline="\n")
    read, campaign = read_campaign(tmp_path), simulated_campaign(5)
    assert campaign.source == f"{SOURCE}, seed 5"
    assert read.sha256 == campaign.sha256 != simulated_campaign(6).sha256
    assert [r.key for r in read.records] == [f"{c}-{b}" for c in LOADS for b in ("heating", "cooling")]
    assert [f.kind for f in campaign.findings] == ["simulated", *(f.kind for f in read.findings)]
    assert not [f for f in read.findings if f.dropped]
    assert read.records[0].declared_units["displacement"] == "mm"
    assert read.records[0].condition.load == pytest.approx(0.1 * GRAVITY)
    assert read.records[0].temperature_sd == DEFAULT_RIG.temperature_sd


def test_measurements_scatter_about_the_truth() -> None:
    """Within six standard deviations of noise and thermometer; the truth of another branch is far off."""
    for record in simulated_campaign(0).records:
        condition = record.condition.id
        t = record.temperature - log_of(condition, 0).offset
        for channel, sd in (("force", DEFAULT_RIG.force_sd), ("displacement", DEFAULT_RIG.displacement_sd)):
            true = truth_of(condition, record.branch, t)[channel]
            slope = np.abs(np.gradient(true, t))
            room = 6.0 * np.hypot(sd, slope * 0.2)
            assert np.all(np.abs(record.observed[channel] - true) < room)


def test_an_unknown_condition_is_named() -> None:
    with pytest.raises(UnknownNameError, match="no condition '300g'"):
        course_of("300g")
