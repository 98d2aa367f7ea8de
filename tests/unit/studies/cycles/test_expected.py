"""What a study of cycles is expected to take is told before it begins, where that is more than a minute."""

from __future__ import annotations

import io
from types import ModuleType

import numpy as np
import pytest

from sma_bayes.progress import LogLines
from sma_bayes.records.types import Campaign
from sma_bayes.studies.cycles import workflow
from sma_bayes.studies.cycles.expected import expected_s

MEASURED = (
    ("seven real cycles", [(2, 17)], 2.1),
    ("twenty simulated cycles", [(4, 30)], 4.4),
    ("a hundred", [(4, 110)], 19.9),
    ("two hundred and forty", [(4, 250)], 49.4),
    ("three conditions of thirty", [(4, 40)] * 3, 21.5),
)
"""Curves and cycles of each condition, and processor time in one process on 26 November 2026 [s]."""


@pytest.mark.parametrize(("conditions", "took"), [m[1:] for m in MEASURED], ids=[m[0] for m in MEASURED])
def test_it_is_what_studies_took(conditions: list[tuple[int, float]], took: float) -> None:
    assert took / 2.0 < expected_s(conditions, 1) < 2.0 * took


def test_conditions_are_shared_among_processes() -> None:
    assert expected_s([(4, 40), (4, 40)], 2) == pytest.approx(expected_s([(4, 40)], 1))
    assert expected_s([(4, 400), (1, 10)], 2) == pytest.approx(expected_s([(4, 400)], 1))
    assert expected_s([], 2) == 0.0


@pytest.mark.parametrize(("ahead", "told"), [(490, True), (10, False)])
def test_what_takes_long_is_announced(
    ahead: int, told: bool, training_spring: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Begun(Exception):
        pass

    def begin(*_: object, **__: object) -> None:
        raise Begun

    monkeypatch.setattr(workflow, "run", begin)
    rng = np.random.default_rng(0)
    truth = training_spring.draw_truth(rng, 2)
    records = training_spring.measured(truth, rng, ("force", "displacement"))
    out = io.StringIO()
    with pytest.raises(Begun):
        workflow.cycles(
            Campaign("bench", "", "", tuple(records)), ahead=ahead, jobs=1, progress=LogLines(file=out)
        )
    assert ("1 condition, pooling cycles: about" in out.getvalue()) is told
    assert ("give or take a factor of three" in out.getvalue()) is told
