"""Many records: whole conditions as tasks, resumed without doing them again, and shared out on a cluster of Dask."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import sma_bayes
from sma_bayes import fit_campaign
from sma_bayes.errors import WorkerError
from sma_bayes.records.campaign import read_campaign
from sma_bayes.studies.fit import tasks as fit_tasks

Same = Callable[[Path, Path], None]
CONDITIONS = 4
NOISE = "independent"
"""What is told to all fits: which is chosen is none of these tests' business, and takes most of the time."""


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small test house: one spring, a few conditions, two branches each."""
    from make_test_house import write_test_house

    folder = tmp_path_factory.mktemp("house")
    assert write_test_house(folder, springs=1, conditions=CONDITIONS, points=40, seed=3) == 2 * CONDITIONS
    return folder


@pytest.fixture(scope="module")
def whole(house: Path) -> Path:
    """Fitted branch by branch in one process, which is what few conditions get."""
    fit_campaign(read_campaign(house), house / "whole", jobs=1, figures=False, noise=NOISE)
    return house / "whole"


@pytest.fixture
def by_condition(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a task of each condition, as for a campaign of many."""
    monkeypatch.setattr(fit_tasks, "CONDITION_TASKS_FROM", 1)


@pytest.mark.usefixtures("by_condition")
def test_whole_conditions_give_the_numbers_of_single_branches(
    house: Path, whole: Path, assert_same_run: Same
) -> None:
    seen: list[tuple[int, int]] = []
    fit_campaign(
        read_campaign(house),
        house / "conditions",
        jobs=1,
        figures=False,
        noise=NOISE,
        progress=lambda done, total, _: seen.append((done, total)),
    )
    assert_same_run(whole, house / "conditions")
    assert seen == [(n, 2 * CONDITIONS) for n in range(0, 2 * CONDITIONS + 1, 2)]
    assert not (house / "conditions" / "parts").exists()


def finished_and_resumed(
    house: Path, out: Path, stop_at: int, monkeypatch: pytest.MonkeyPatch, lost: str = ""
) -> Any:
    """Interrupt a fit, remove a file of it, go on: parts that were kept, and conditions that were done once more."""
    sampled = []

    def interrupt(done: int, total: int, message: str) -> None:
        if done == stop_at:
            raise KeyboardInterrupt

    def count(task: fit_tasks.FitTask) -> Any:
        sampled.append(task.records[0].key)
        return sample(task)

    sample = fit_tasks.sample_task
    with pytest.raises(KeyboardInterrupt):
        fit_campaign(read_campaign(house), out, jobs=1, figures=False, noise=NOISE, progress=interrupt)
    parts = [p.stem for p in sorted((out / "parts").iterdir())]
    if lost:
        (out / "bands" / lost).unlink()
    monkeypatch.setattr(fit_tasks, "sample_task", count)
    fit_campaign(read_campaign(house), out, jobs=1, figures=False, noise=NOISE, resume=True)
    return parts, {key.rpartition("-")[0] for key in sampled}


@pytest.mark.usefixtures("by_condition")
def test_conditions_that_were_finished_are_not_done_again(
    house: Path, whole: Path, assert_same_run: Same, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, lost = house / "resumed", "spring001-02-heating-force.csv"  # so this one has to be done again
    parts, done = finished_and_resumed(house, out, 4, monkeypatch, lost)
    assert parts == ["spring001-01", "spring001-02"]
    assert done == {f"spring001-{n:02}" for n in range(2, CONDITIONS + 1)}
    assert_same_run(whole, out)


def test_of_few_conditions_too_only_the_one_under_way_is_done_again(
    house: Path, whole: Path, assert_same_run: Same, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of few conditions each record is a task."""
    out = house / "resumed-records"
    parts, done = finished_and_resumed(house, out, 5, monkeypatch)
    assert parts == ["spring001-01", "spring001-02"]
    assert done == {f"spring001-{n:02}" for n in range(3, CONDITIONS + 1)}
    assert_same_run(whole, out)


# --- a cluster ----------------------------------------------------------------------------------------


def start(*arguments: object) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-W", "ignore", "-m", "dask", *map(str, arguments)]
    once_more = os.environ | {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1"}
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=once_more)


def until(ready: Callable[[], object], seconds: float = 60.0) -> None:
    deadline = time.monotonic() + seconds
    while not ready():
        assert time.monotonic() < deadline, "the cluster did not come up"
        time.sleep(0.05)


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Address of a scheduler with two workers of one thread, all processes of their own; and the workers."""
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    from distributed import Client

    file = tmp_path / "scheduler.json"
    common = ("--scheduler-file", file, "--no-dashboard")
    running = [start("scheduler", *common, "--host", "127.0.0.1", "--port", 0)]
    try:
        until(file.exists)
        place = ("--local-directory", tmp_path / "dask")
        running += [start("worker", *common, "--nthreads", 1, "--no-nanny", *place) for _ in range(2)]
        with Client(scheduler_file=str(file), set_as_default=False, timeout=60) as client:
            client.wait_for_workers(2, timeout=60)
            address = client.scheduler.address
        yield address, running[1:]
    finally:
        for process in reversed(running):
            process.kill()
            process.wait()


@pytest.mark.slow
@pytest.mark.usefixtures("by_condition")
def test_a_cluster_that_loses_a_worker_gives_the_numbers_of_one_process(
    house: Path,
    whole: Path,
    scheduler: tuple[str, list[subprocess.Popen[bytes]]],
    assert_same_run: Same,
) -> None:
    address, workers = scheduler

    def kill_one(done: int, total: int, message: str) -> None:
        if done == 2:
            workers[0].send_signal(signal.SIGKILL)

    with sma_bayes.cluster(address):
        found = fit_campaign(
            read_campaign(house), house / "cluster", figures=False, noise=NOISE, progress=kill_one
        )
    assert_same_run(whole, house / "cluster")
    assert found["workers"]["where"] == f"cluster {address}, 2 workers"
    assert len(found["workers"]["lost"]) == 1
    assert workers[0].wait(10) == -signal.SIGKILL
    assert workers[1].poll() is None


@pytest.mark.slow
def test_a_client_of_ones_own_stays_open_and_tasks_have_one_thread_each(
    scheduler: tuple[str, list[subprocess.Popen[bytes]]],
) -> None:
    from distributed import Client

    from sma_bayes.runs.jobs import run

    address, workers = scheduler
    with Client(address, set_as_default=False) as client:
        with sma_bayes.cluster(client):
            found = list(run(threads_and_process, range(6), jobs=1))
        assert client.status == "running"
    assert {pid for pid, _ in found} <= {w.pid for w in workers}
    assert all(pools <= {1} for _, pools in found)


def threads_and_process(_: int) -> tuple[int, set[int]]:
    import numpy as np
    from threadpoolctl import threadpool_info

    np.linalg.norm(np.ones((100, 100)) @ np.ones((100, 100)))
    return os.getpid(), {int(pool["num_threads"]) for pool in threadpool_info()}


@pytest.mark.slow
def test_a_task_that_ends_every_worker_is_given_up(
    scheduler: tuple[str, list[subprocess.Popen[bytes]]],
) -> None:
    from sma_bayes.runs.jobs import run

    with (
        sma_bayes.cluster(scheduler[0]),
        pytest.raises(WorkerError, match="came to an end in the middle of the same task"),
    ):
        list(run(end_this_process, [0], None))


def end_this_process(_: int) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def test_without_the_extra_the_message_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with (
        pytest.raises(WorkerError, match=r"pip install \"\.\[cluster\]\""),
        sma_bayes.cluster("tcp://127.0.0.1:1"),
    ):
        pass


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense", "nonsense://here"])
def test_a_scheduler_that_is_not_there_is_told_of(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    monkeypatch.setattr("sma_bayes.runs.jobs.CONNECT_S", 0.5)
    with pytest.raises(WorkerError, match=r"can't be reached"), sma_bayes.cluster(address):
        pass
