"""The same seed gives the same study, on one process or on two."""

from __future__ import annotations

import json

import pytest

from sma_bayes.workflow import study_gap


@pytest.mark.parametrize("secret", [{}, {"lag": 0.3}], ids=["nothing hidden", "lag hidden"])
def test_processes_and_repetition_change_nothing(secret: dict[str, float], rig) -> None:
    campaign = rig(samples=30, seed=5, **secret).campaign()

    def text(jobs: int) -> str:
        found = study_gap(campaign, pool="campaign", seed=3, jobs=jobs)
        assert found.pop("wall_s") > 0.0
        return json.dumps(found, indent=1)

    assert text(1) == text(2)
