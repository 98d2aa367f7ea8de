"""Independent tasks side by side: on processes of this machine, or on a Dask cluster.

`run` is the same call in both cases. A cluster is chosen around it:

>>> from sma_bayes.runs.jobs import cluster
>>> with cluster("tcp://head:8786"):  # doctest: +SKIP
...     fit_campaign(campaign, "results")

Results do not depend on where tasks are done, to the bit, as long as the machines agree in kind and in the versions
of Python and of the packages; versions are checked. Linear algebra runs on one thread wherever a task does, and a
worker of a cluster does one task at a time even if it has more threads.
"""

from __future__ import annotations

import logging
import os
import re
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from itertools import islice
from typing import Any, Generic, TypeVar

import numpy as np

from sma_bayes.account import Account
from sma_bayes.errors import WorkerError
from sma_bayes.fitting.posterior import versions
from sma_bayes.runs.workers import follow, signals_left_to_parent
from sma_bayes.threads import one_thread

T = TypeVar("T")
R = TypeVar("R")

WORKER_IDLE_S = 21_600.0
"""Time after which a process without work retires [s].

By joblib's default, 300 s, a stage that follows another after five minutes may hand out tasks just as the processes
retire, and wait for ever: seen once on a busy machine, with joblib 1.6."""

KEPT_BYTES = 31 * 2**20
"""Freed memory that a process keeps for its next arrays [B]; glibc takes no more than 32 MiB for a threshold."""

LEAST_SAVING_S = 4.0
"""Time that processes have to save on light tasks, to be started for them [s]; to start two takes half of it."""

MAX_ATTEMPTS = 4
"""How often a task is begun, at most, where worker processes come to an end in the middle of it."""
TASKS_PER_THREAD = 2
"""Tasks that a cluster is given at a time, for each of its threads."""
CONNECT_S = 10.0
"""How long a scheduler, and then its first worker, is waited for [s]."""

_CLIENT: ContextVar[Any] = ContextVar("client", default=None)
"""Connection to the cluster that is in use, a `distributed.Client`; None for processes of this machine."""

_ONE_AT_A_TIME = threading.Lock()
"""Held while a worker of a cluster does a task: limits on threads and matplotlib belong to the whole process."""


@dataclass(frozen=True, slots=True)
class _Done(Generic[R]):
    """What a task gave, and the time that it took [s]."""

    result: R
    wall: float
    cpu: float


def processes(jobs: int | None, tasks: int) -> int:
    """How many processes to use: `jobs`, or one for each core, but never more than there are tasks.

    Examples
    --------
    >>> processes(4, 2)
    2
    """
    wanted = jobs if jobs is not None and jobs > 0 else (os.cpu_count() or 1)
    return max(1, min(wanted, tasks))


def by_the_clock(each: Sequence[float], jobs: int | None) -> float:
    """What tasks take together where they are shared among processes [s]; no less than the longest of them.

    Examples
    --------
    >>> by_the_clock([2.0, 2.0, 2.0, 2.0], 2)
    4.0
    >>> by_the_clock([1.0, 5.0], 2)
    5.0
    """
    return max(sum(each) / processes(jobs, len(each)), *each) if each else 0.0


def run(
    task: Callable[[T], R],
    items: Sequence[T],
    jobs: int | None,
    *,
    account: Account | None = None,
    stage: str | None = None,
    light: bool = False,
) -> Iterator[R]:
    """Results of ``task(item)`` in the order of `items`, as they become ready.

    A task must not depend on the process that it runs in; then neither do the results. Where a worker process comes
    to an end in the middle of a task, for instance for want of memory, what was under way is done again.

    Parameters
    ----------
    task : callable
    items : sequence
    jobs : int, optional
        Processes of this machine; by default one for each core. Of no effect inside `cluster`.
    account : Account, optional
        Told of the workers, of those that were lost and, if there is a `stage`, of the time that tasks took.
    stage : str, optional
        Stage of the account to which the time is added.
    light : bool
        Tasks that hardly take longer than to start a process. Without `jobs` they are done in this process, as long as
        that is not expected to cost `LEAST_SAVING_S`.

    Raises
    ------
    WorkerError
        If a task was begun `MAX_ATTEMPTS` times and its process came to an end each time, or the cluster can't be
        reached any more. What a task itself raises arrives as it is.
    """
    account = account if account is not None else Account()
    for done in _done(task, items, jobs, account, light):
        if stage is not None:
            account.add(stage, done.wall, done.cpu)
        yield done.result


def _done(
    task: Callable[[T], R], items: Sequence[T], jobs: int | None, account: Account, light: bool
) -> Iterator[_Done[R]]:
    client = _CLIENT.get()
    if client is not None:
        return _on_cluster(task, items, client, account)
    workers = processes(jobs, len(items))
    if workers == 1:
        return (_timed(task, item) for item in items)
    if light and jobs is None:
        return _here_first(task, items, workers, account)
    return _on_processes(task, items, workers, account)


def _here_first(
    task: Callable[[T], R], items: Sequence[T], workers: int, account: Account
) -> Iterator[_Done[R]]:
    """Tasks here, and on processes what is left once that is worth starting them.

    What a task takes is told by those after the first, which waits for imports, as each new process would.
    """
    spent = 0.0
    for number, item in enumerate(items):
        left = len(items) - number
        saved = spent / (number - 1) * left * (1.0 - 1.0 / workers) if number > 1 else 0.0
        if left > 1 and saved > LEAST_SAVING_S:
            yield from _on_processes(task, items[number:], min(workers, left), account)
            return
        done = _timed(task, item)
        if number:
            spent += done.cpu  # the clock would tell of what else the machine is doing
        yield done


def _timed(task: Callable[[T], R], item: T) -> _Done[R]:
    """Do a task on one thread."""
    _keep_freed_memory()
    wall, cpu = time.perf_counter(), time.process_time()
    with one_thread():
        result = task(item)
    return _Done(result, time.perf_counter() - wall, time.process_time() - cpu)


def _keep_freed_memory() -> None:
    """Let the C library keep what is freed, not give it back to the system and ask for it anew, page by page.

    glibc gives freed memory back above a threshold, 128 KiB at first, that rises to the size of the largest array
    freed so far (man 3 mallopt, M_MMAP_THRESHOLD and M_TRIM_THRESHOLD). Arrays of a task are mostly larger than
    that. One is made and freed here, of whose memory nothing is touched; other C libraries take no notice.
    """
    np.empty(KEPT_BYTES, dtype=np.uint8)


def _on_processes(
    task: Callable[[T], R], items: Sequence[T], workers: int, account: Account
) -> Iterator[_Done[R]]:
    from joblib import Parallel, delayed
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    account.workers = f"{workers} processes"
    finished, tries = 0, 1
    while finished < len(items):
        parallel = Parallel(
            n_jobs=workers,
            return_as="generator",
            pre_dispatch="2*n_jobs",
            idle_worker_timeout=WORKER_IDLE_S,
            initializer=follow,
            initargs=(os.getpid(),),
        )
        try:
            with signals_left_to_parent():
                results = parallel(delayed(_timed)(task, item) for item in items[finished:])
            for done in results:
                finished, tries = finished + 1, 1
                yield done
        except TerminatedWorkerError as error:
            account.lost.append(_signals(error))
            if tries == MAX_ATTEMPTS:
                raise WorkerError(
                    f"a worker process came to an end in the middle of its task, {_signals(error)}, "
                    f"{MAX_ATTEMPTS} times in a row",
                    expected="memory for all processes, and a disk that isn't full",
                    remedy="repeat with a smaller --jobs; --resume keeps what has been done",
                ) from None
            tries += 1


def _signals(error: Exception) -> str:
    told = re.search(r"exit codes of the workers are (\{.*\})", str(error))
    return told[1].strip("{}") if told else "the cause is not known"


# --- on a cluster -------------------------------------------------------------------------------------


@contextmanager
def cluster(scheduler: Any) -> Iterator[None]:
    """Do the tasks of everything inside a ``with`` block on a Dask cluster.

    Workers need this package in the same version, and have to see the output folder under the same path.

    Parameters
    ----------
    scheduler : str or distributed.Client
        Address of a scheduler, such as ``tcp://head:8786``, or a client that is connected; the latter stays open.

    Raises
    ------
    WorkerError
        If the package distributed is not installed, the scheduler can't be reached, it has no worker, or a worker
        has other versions.
    """
    client = _connected(scheduler) if isinstance(scheduler, str) else scheduler
    try:
        _check_workers(client)
        token = _CLIENT.set(client)
        try:
            yield
        finally:
            _CLIENT.reset(token)
    finally:
        if client is not scheduler:
            client.close()


def _connected(address: str) -> Any:
    try:
        from distributed import Client
    except ImportError:
        raise WorkerError(
            f"--scheduler {address}: the package distributed is not installed",
            expected="what talks to a Dask cluster",
            remedy='python -m pip install ".[cluster]" from the checkout, here and on the workers',
        ) from None
    for handler in logging.getLogger("distributed").handlers:
        handler.setLevel(logging.CRITICAL)  # what matters arrives as an error of ours
    try:
        return Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:  # a time-out is an OSError
        raise WorkerError(
            f"--scheduler {address}: can't be reached ({str(error).splitlines()[0]})",
            expected="the address of a running scheduler, such as tcp://head:8786",
            remedy="start one with `dask scheduler`, and workers with `dask worker ADDRESS --nthreads 1`",
        ) from None


def _check_workers(client: Any) -> None:
    address = client.scheduler.address
    try:
        client.wait_for_workers(1, timeout=CONNECT_S)
    except TimeoutError:
        raise WorkerError(
            f"{address}: the scheduler has no worker",
            expected=f"one within {CONNECT_S:g} s",
            remedy=f"start some with `dask worker {address} --nthreads 1`",
        ) from None
    try:
        client.run(_check_versions, versions())
    except WorkerError:
        raise
    except Exception as error:
        raise WorkerError(
            f"{address}: a worker can't run sma_bayes ({type(error).__name__}: {error})",
            expected="this package on every worker, in the same version",
            remedy='python -m pip install ".[cluster]" from the checkout, on the workers',
        ) from None


def _check_versions(wanted: dict[str, str]) -> None:
    here = versions()
    other = [f"{name} {here.get(name)} instead of {v}" for name, v in wanted.items() if here.get(name) != v]
    if other:
        raise WorkerError(
            f"a worker has {', '.join(other)}",
            expected="the same versions everywhere, as draws depend on them",
            remedy="install them on the workers",
        )


def _on_worker(call: tuple[Callable[[T], R], T, dict[str, str]]) -> _Done[R]:
    task, item, wanted = call
    with _ONE_AT_A_TIME:
        _check_versions(wanted)
        return _timed(task, item)


def _on_cluster(
    task: Callable[[T], R], items: Sequence[T], client: Any, account: Account
) -> Iterator[_Done[R]]:
    """Straight by the client: joblib's backend waits for ever for a task whose workers all died (joblib 1.6)."""
    from distributed import CancelledError, KilledWorker
    from distributed.comm import CommClosedError

    def told(event: tuple[float, dict[str, Any]]) -> None:
        _, message = event
        begun = message.get("processing-tasks", ())
        if message.get("action") == "remove-worker" and begun:
            account.lost.append(f"{message['worker']}, {len(begun)} tasks")

    account.workers = f"cluster {client.scheduler.address}, {len(client.nthreads())} workers"
    calls = iter([(task, item, versions()) for item in items])
    under_way: deque[Any] = deque()
    client.subscribe_topic("all", told)
    try:
        while True:
            room = TASKS_PER_THREAD * max(1, sum(client.nthreads().values())) - len(under_way)
            under_way += [client.submit(_on_worker, call, pure=False) for call in islice(calls, max(room, 0))]
            if not under_way:
                return
            yield under_way.popleft().result()
    except KilledWorker as error:
        raise WorkerError(
            f"workers of the cluster came to an end in the middle of the same task, {error.last_worker.address} last",
            expected="memory for all workers",
            remedy="give workers more memory; --resume keeps what has been done",
        ) from None
    except (CancelledError, CommClosedError) as error:
        raise WorkerError(
            f"the connection to the scheduler was lost ({type(error).__name__})",
            expected="a scheduler that runs until the end",
            remedy="start it again and repeat with --resume, which keeps what has been done",
        ) from None
    finally:
        _leave(client, under_way)


def _leave(client: Any, under_way: Iterable[Any]) -> None:
    """Take back what nobody waits for any more, if there is still somebody to tell."""
    if client.status == "running":
        client.unsubscribe_topic("all")
        client.cancel(list(under_way))
