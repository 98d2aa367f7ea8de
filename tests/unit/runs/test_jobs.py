"""Tasks on several processes: order, errors, and processes that are ended from outside."""

from __future__ import annotations

import os
import platform
import signal
import time
from multiprocessing import active_children
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from sma_bayes.account import Account
from sma_bayes.errors import PriorError, WorkerError
from sma_bayes.runs import jobs as jobs_module
from sma_bayes.runs.jobs import MAX_ATTEMPTS, processes, run
from sma_bayes.runs.workers import stop_workers


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
    assert str(caught.value) == ("p.toml, row 4, key 'both.B2': no prior\nexpected: one\nwhat to do: add it")


def die_once(item: tuple[int, Path]) -> int:
    number, mark = item
    if number == 3 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def threads(_: int) -> list[int]:
    multiply = np.ones((200, 200)) @ np.ones((200, 200))  # so that the library has its threads up
    return [int(multiply[0, 0]), *(int(pool["num_threads"]) for pool in threadpool_info())]


def test_a_task_that_always_kills_its_process_is_given_up() -> None:
    account = Account()
    with pytest.raises(WorkerError, match=r"came to an end .*SIGKILL.*4 times in a row") as caught:
        list(run(die, range(5), 2, account=account))
    assert "--resume" in str(caught.value)
    assert len(account.lost) >= MAX_ATTEMPTS  # more where tasks before it had been under way


def test_what_a_killed_process_was_doing_is_done_again(tmp_path: Path) -> None:
    account = Account()
    items = [(i, tmp_path / "mark") for i in range(8)]
    assert list(run(die_once, items, 2, account=account)) == list(range(8))
    assert len(account.lost) == 1
    assert "SIGKILL" in account.lost[0]
    assert account.run_document()["workers"] == {"where": "2 processes", "lost": account.lost}


@pytest.mark.parametrize("jobs", [1, 2])
def test_linear_algebra_has_one_thread_wherever_a_task_is_done(jobs: int) -> None:
    assert all(set(found) <= {200, 1} for found in run(threads, range(2), jobs))


@pytest.mark.parametrize("jobs", [1, 2])
def test_the_account_holds_what_tasks_took(jobs: int) -> None:
    account = Account()
    list(run(time.sleep, [0.05] * 4, jobs, account=account, stage="sleep"))
    assert account.wall["sleep"] >= 0.2
    assert account.cpu["sleep"] < account.wall["sleep"]
    assert set(account.document()) == {"stages_s", "stages_cpu_s"}


def own_process(_: int) -> int:
    return os.getpid()


def test_light_tasks_start_no_process() -> None:
    account = Account()
    assert set(run(own_process, range(6), None, account=account, light=True)) == {os.getpid()}
    assert account.run_document()["workers"]["where"] == "this process"


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="a machine with one core")
def test_light_tasks_that_add_up_are_shared_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jobs_module, "LEAST_SAVING_S", 0.0)
    first, second, *others = run(own_process, range(6), None, light=True)
    assert {first, second} == {os.getpid()}
    assert os.getpid() not in others


def test_a_first_task_that_waits_for_imports_starts_no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        jobs_module,
        "_timed",
        lambda task, item: jobs_module._Done(task(item), 0.0, 0.1 if item else 100.0),
    )
    assert set(run(own_process, range(6), None, light=True)) == {os.getpid()}


def test_processes_that_are_asked_for_are_started() -> None:
    assert os.getpid() not in set(run(own_process, range(6), 2, light=True))


def test_workers_are_ended_at_once_and_the_next_task_gets_new_ones() -> None:
    first = set(run(own_process, range(4), 2))
    stop_workers()
    assert not active_children()
    assert not first & set(run(own_process, range(4), 2))


def test_no_more_processes_than_tasks() -> None:
    assert processes(8, 3) == 3
    assert processes(None, 100) == min(100, os.cpu_count() or 1)
    assert processes(1, 0) == 1


def pages_asked_for(times: int) -> int:
    """Pages that a process asks the system for while it makes ten arrays of 1 MB and frees them, so many times."""
    import resource

    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(times):
        assert len([np.ones(125_000) for _ in range(10)]) == 10
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="of the C library's own threshold")
def test_freed_memory_is_used_again() -> None:
    times, pages_of_once = 20, 10_000_000 / 4096
    for pages in run(pages_asked_for, [times, times], 2):
        assert pages < 2 * pages_of_once
