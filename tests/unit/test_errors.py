"""Errors: one message says what, where, what was expected and what to do."""

from __future__ import annotations

import copy
import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from sma_bayes import errors
from sma_bayes.errors import MeasurementError, PriorError, QuantityError, SmaBayesError, near_matches

FAMILY = sorted(
    (c for c in vars(errors).values() if isinstance(c, type) and issubclass(c, SmaBayesError)),
    key=lambda c: c.__name__,
)
EVERY = pytest.mark.parametrize("kind", FAMILY)
PARTS = ("found", "file", "row", "column", "expected", "remedy")


def full(kind: type[SmaBayesError]) -> SmaBayesError:
    return kind(
        "text in a number column",
        file=Path("bench") / "2A.csv",
        row=1042,
        column="force_N",
        expected="a number",
        remedy="correct the cell",
    )


def fail_in_a_worker(kind: type[SmaBayesError]) -> None:
    raise full(kind)


def test_the_family_is_complete() -> None:
    assert {kind.__name__ for kind in FAMILY} == {
        "SmaBayesError",
        "MeasurementError",
        "ReadingError",
        "CampaignError",
        "StudyError",
        "QuantityError",
        "PriorError",
        "UnknownNameError",
        "OutputError",
        "ResumeError",
        "WorkerError",
    }


@EVERY
def test_message_tells_where_what_and_what_to_do(kind: type[SmaBayesError]) -> None:
    where = str(Path("bench") / "2A.csv")
    assert str(full(kind)) == (
        f"{where}, row 1042, column 'force_N': text in a number column\n"
        "expected: a number\n"
        "what to do: correct the cell"
    )


@pytest.mark.parametrize(
    ("place", "head"),
    [
        ({}, "wrong"),
        ({"file": "a.csv"}, "a.csv: wrong"),
        ({"row": 3}, "row 3: wrong"),
        ({"row": 0}, "row 0: wrong"),
        ({"column": "time"}, "column 'time': wrong"),
        ({"file": "a.csv", "column": "time"}, "a.csv, column 'time': wrong"),
    ],
)
def test_message_leaves_out_what_is_not_known(place: dict[str, object], head: str) -> None:
    assert str(MeasurementError("wrong", **place)) == head


def test_place_is_by_keyword_only() -> None:
    with pytest.raises(TypeError):
        SmaBayesError("wrong", "a.csv")


@EVERY
@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_errors_survive_pickling(kind: type[SmaBayesError], protocol: int) -> None:
    error = full(kind)
    back = pickle.loads(pickle.dumps(error, protocol=protocol))
    assert type(back) is kind
    assert str(back) == str(error)
    assert [getattr(back, part) for part in PARTS] == [getattr(error, part) for part in PARTS]


def test_errors_survive_copying() -> None:
    error = full(PriorError)
    for back in (copy.copy(error), copy.deepcopy(error)):
        assert type(back) is PriorError
        assert str(back) == str(error)


def test_errors_come_back_whole_from_a_worker_process() -> None:
    with (
        ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool,
        pytest.raises(PriorError) as caught,
    ):
        pool.submit(fail_in_a_worker, PriorError).result()
    assert str(caught.value) == str(full(PriorError))


@given(st.builds(SmaBayesError, st.text(), file=st.none() | st.text(), row=st.none() | st.integers()))
def test_any_error_survives_pickling(error: SmaBayesError) -> None:
    back = pickle.loads(pickle.dumps(error))
    assert str(back) == str(error)
    assert back.args == error.args


def test_near_matches_lists_the_nearest_first() -> None:
    assert near_matches("temperatur", ["temperature", "time"]) == "did you mean 'temperature'?"
    assert near_matches("A33", ["B3", "A3"]) == "did you mean 'A3'?"
    assert near_matches("paralel", ["parallel", "parallels"]) == "did you mean 'parallel' or 'parallels'?"


def test_near_matches_lists_everything_where_nothing_is_near() -> None:
    assert near_matches("xyz", iter(("b", "a"))) == "known: 'a', 'b'"


def test_an_error_with_another_place_keeps_its_kind_and_what_is_not_changed() -> None:
    first = QuantityError("no such unit", row=3, expected="one of length", remedy="correct it")
    second = first.but(file="a.csv", column="x", remedy=None)
    assert type(second) is QuantityError
    assert str(second) == "a.csv, row 3, column 'x': no such unit\nexpected: one of length"
    assert str(first.but("no unit")).startswith("row 3: no unit\n")
