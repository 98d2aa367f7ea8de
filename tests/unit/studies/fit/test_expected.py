"""What fits are expected to take is told before they begin, where that is more than a minute."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import pytest

from sma_bayes.progress import LogLines
from sma_bayes.records.types import Record
from sma_bayes.response import AUTO_MODEL, DEFAULT_MODEL
from sma_bayes.runs.documents import FIT
from sma_bayes.studies.fit import workflow
from sma_bayes.studies.fit.tasks import expected_s, tasks_of
from sma_bayes.studies.options import FitOptions, models_of, prior_set
from sma_bayes.studies.run_context import RunContext

PLAIN, AUTO = (FitOptions(prior_set(None), model=name) for name in (DEFAULT_MODEL, AUTO_MODEL))


def test_it_grows_with_samples_and_curves_and_is_shared_among_processes(
    make_record: Callable[..., Record],
) -> None:
    few, many = ((make_record(("force",), n=n),) for n in (30, 300))
    assert expected_s([many], PLAIN, 1) > 10.0 * expected_s([few], PLAIN, 1)
    curves = len(models_of(few, AUTO))
    assert curves > 3
    assert expected_s([many], AUTO, 1) == pytest.approx(curves * expected_s([many], PLAIN, 1), rel=0.1)
    assert expected_s([few, few], PLAIN, 2) == pytest.approx(expected_s([few], PLAIN, 2))
    assert expected_s([], PLAIN, 2) == 0.0


def test_records_that_take_long_are_worth_processes(make_record: Callable[..., Record]) -> None:
    """Two branches of 300 readings would be fitted one after the other else, and the second be waited for.

    Two of 200 are done sooner than processes start.
    """
    few, many = ((make_record(("force",), n=n),) for n in (200, 300))
    assert [t.light for t in tasks_of([few, many], PLAIN, None)] == [True, False]
    assert [t.light for t in tasks_of([few], AUTO, None)] == [False]


@pytest.mark.parametrize(
    ("options", "records", "told"),
    [(PLAIN, 3, "3 records, sampling"), (AUTO, 3, "3 records, choosing among"), (PLAIN, 1, "")],
)
def test_what_takes_long_is_announced(
    options: FitOptions,
    records: int,
    told: str,
    make_record: Callable[..., Record],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(workflow, "fitted", lambda *_: iter(()))
    out = io.StringIO()
    work = RunContext(FIT, 1, "none", LogLines(file=out))
    workflow._fitted([(make_record(("force",), n=400),)] * records, options, tmp_path, work, ())
    assert told in out.getvalue()
    assert ("give or take a factor of three" in out.getvalue()) is bool(told)
