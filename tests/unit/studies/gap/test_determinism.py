"""The same seed gives the same study, on one process or on two."""

from __future__ import annotations

import json

from sma_bayes import study_gap


def test_processes_and_repetition_change_nothing(rig) -> None:
    campaign = rig(samples=30, seed=5, lag=0.3).campaign()

    def text(jobs: int) -> str:
        found = study_gap(campaign, pool="campaign", seed=3, jobs=jobs)
        assert found.pop("wall_s") > 0.0
        took = [found.pop(key) for key in ("stages_s", "stages_cpu_s")]
        assert all(
            {"study", "hold_out", "score", "sample"} <= set(t) and min(t.values()) >= 0.0 for t in took
        )
        assert found.pop("workers") == {
            "where": f"{jobs} processes" if jobs > 1 else "this process",
            "lost": [],
        }
        return json.dumps(found, indent=1)

    assert text(1) == text(2)
