"""Real records whose fits do not converge under the noise that evidence prefers do under one that is advised.

Or with another seed besides, as the advice has it: sweeps of ele_hys_2 that differ by a third of their stroke leave a
posterior on which one seed of three runs out of evaluations.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from sma_bayes import fit
from sma_bayes.records.campaign import read_campaign
from sma_bayes.report.screen import SIMPLER_NOISE_MODELS

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "examples"


@pytest.mark.parametrize(
    ("example", "record", "noise"),
    [
        ("guarneros_spring_force", "AB3-heating", "ar1"),
        ("wire_in_water", "ele_hys_2-cooling", "independent"),
        ("wire_in_water", "ele_hys_2-heating", "independent"),
    ],
)
def test_a_simpler_noise_converges_and_does_not_pass_for_adequate(
    shared_data: Path, example: str, record: str, noise: str
) -> None:
    campaign = read_campaign(EXAMPLES / f"{example}.toml", data_dir=shared_data / example)
    alone = replace(campaign, records=(campaign.record(record),))
    found = next(
        (f for seed in (0, 1) if (f := fit(alone, noise=noise, jobs=1, seed=seed)[record]).converged), None
    )
    assert noise in SIMPLER_NOISE_MODELS
    assert found is not None
    assert not found.summarised.adequate
