"""What a comparison is expected to take is told before the first record is compared."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.progress import LogLines
from sma_bayes.records.types import Record
from sma_bayes.runs.documents import COMPARISON
from sma_bayes.studies.compare import workflow
from sma_bayes.studies.compare.comparison import StartedComparison, start_comparison
from sma_bayes.studies.options import FitOptions, prior_set
from sma_bayes.studies.run_context import RunContext

OPTIONS = FitOptions(prior_set(None))


@pytest.fixture(scope="module")
def begun(make_record: Callable[..., Record]) -> StartedComparison:
    return start_comparison(make_record(("force",), n=40), OPTIONS.priors, noise="independent")


def test_a_start_knows_what_the_rest_takes(begun: StartedComparison) -> None:
    assert 0.0 < begun.expected_s < 100.0
    assert [c.name for c in begun.running] == list(begun.modes)
    assert len(begun.seeds) == len(begun.running)


@pytest.mark.parametrize(("each", "told"), [(200.0, True), (5.0, False)])
def test_it_is_announced(
    each: float, told: bool, begun: StartedComparison, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workflow, "start_comparison", lambda *_, **__: replace(begun, expected_s=each))
    out = io.StringIO()
    work = RunContext(COMPARISON, 1, "none", LogLines(file=out))
    assert len(workflow._started([begun.setting.record] * 3, OPTIONS, work)) == 3
    assert ("3 comparisons of " in out.getvalue()) is told
    assert ("about 10 min, give or take a factor of three" in out.getvalue()) is told


def test_very_many_records_are_started_one_by_one_with_the_same_outcome(
    begun: StartedComparison, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workflow, "MAX_STARTED_RECORDS", 0)
    work = RunContext(COMPARISON, 1, "none")
    options = replace(OPTIONS, noise="independent")
    records = [begun.setting.record]
    assert workflow._started(records, options, work) is records
    later = workflow._compare(records[0], options, None)
    before = workflow._compare(begun, options, None)
    for name, one in before.fitted.items():
        assert one.evidence.value == later.fitted[name].evidence.value
        np.testing.assert_array_equal(one.loo.log_density, later.fitted[name].loo.log_density)
