"""Tasks on several processes: order, errors, and processes that are ended from outside."""

from __future__ import annotations

import os
import signal

import pytest

from sma_bayes.errors import PriorError, WorkerError
from sma_bayes.inference.jobs import processes, run


def square(x: int) -> int:
    return x * x


def refuse(x: int) -> int:
    if x == 3:
        raise PriorError("no prior", file="p.toml", row=4, column="both.B2", expected="one", remedy="add it")
    return x


def die(x: int) -> int:
    if x == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return x


@pytest.mark.parametrize("jobs", [1, 2])
def test_results_come_in_order(jobs: int) -> None:
    assert list(run(square, range(20), jobs)) == [x * x for x in range(20)]
    assert list(run(square, [], jobs)) == []


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_error_arrives_as_it_was_raised(jobs: int) -> None:
    with pytest.raises(PriorError) as caught:
        list(run(refuse, range(8), jobs))
    assert str(caught.value) == (
        "p.toml, row 4, column 'both.B2': no prior\nexpected: one\nwhat to do: add it"
    )


def test_a_process_that_is_killed_is_told() -> None:
    with pytest.raises(WorkerError, match=r"came to an end .*SIGKILL") as caught:
        list(run(die, range(8), 2))
    assert "--resume" in str(caught.value)


def test_no_more_processes_than_tasks() -> None:
    assert processes(8, 3) == 3
    assert processes(None, 100) == min(100, os.cpu_count() or 1)
    assert processes(1, 0) == 1
