"""What a gap study is expected to take is told before it begins, where that is more than a minute."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import replace

import pytest

from sma_bayes.progress import LogLines
from sma_bayes.records.types import Campaign, Condition, Record
from sma_bayes.response import AUTO_MODEL
from sma_bayes.studies.gap import workflow
from sma_bayes.studies.gap.expected import choice_s, expected_s, study_s
from sma_bayes.studies.options import FitOptions, prior_set

PLAIN = FitOptions(prior_set(None))
STUDIES = (
    ("flexinol, pooled", 1995, 8, 9.6),
    ("force of a spring, pooled", 3058, 8, 26.4),
    ("raw NiTi", 1426, 16, 8.3),
    ("NiTiHf, pooled", 110, 8, 6.4),
    ("seven cycles", 597, 8, 5.6),
    ("NiTiCo", 1226, 32, 20.7),
    ("NiTiCo, pooled", 1226, 8, 23.8),
    ("50 simulated records", 10_000, 400, 81.1),
    ("the same, pooled", 10_000, 16, 16.3),
)
"""Values and parameters of curves, and processor time of the search and of holding out in 2026 [s]."""


@pytest.mark.parametrize(
    ("values", "parameters", "took"), [s[1:] for s in STUDIES], ids=[s[0] for s in STUDIES]
)
def test_it_is_what_studies_took(values: int, parameters: int, took: float) -> None:
    assert took / 3.3 < study_s(values, parameters) < 3.3 * took


@pytest.mark.parametrize(("records", "samples", "took"), [(2, 298, 28.1), (8, 153, 80.9)])
def test_choosing_a_curve_is_what_it_took(records: int, samples: int, took: float) -> None:
    assert took / 2.0 < records * choice_s(5, samples) < 2.0 * took
    assert choice_s(1, samples) == 0.0


def test_it_is_shared_among_processes(make_record: Callable[..., Record]) -> None:
    groups = [(make_record(n=300),)] * 3
    auto = FitOptions(prior_set(None, AUTO_MODEL), model=AUTO_MODEL)
    for options in (PLAIN, auto):
        assert 1.5 < expected_s(groups, options, 1) / expected_s(groups, options, 3) < 3.0
    assert expected_s(groups, auto, 1) > 2.0 * expected_s(groups, PLAIN, 1)


@pytest.mark.parametrize(("records", "told"), [(60, True), (2, False)])
def test_what_takes_long_is_announced(
    records: int, told: bool, make_record: Callable[..., Record], monkeypatch: pytest.MonkeyPatch
) -> None:
    class Begun(Exception):
        pass

    def begin(*_: object, **__: object) -> None:
        raise Begun

    monkeypatch.setattr(workflow, "with_shared_model", begin)
    one = make_record(n=100)
    several = tuple(replace(one, condition=Condition(f"c{i}")) for i in range(records))
    out = io.StringIO()
    with pytest.raises(Begun):
        workflow.study_gap(Campaign("bench", "", "", several), jobs=1, progress=LogLines(file=out))
    assert (f"{records} records, looking for" in out.getvalue()) is told
    assert ("give or take a factor of three" in out.getvalue()) is told
