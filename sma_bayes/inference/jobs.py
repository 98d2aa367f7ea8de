"""Independent tasks on several processes."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from joblib import Parallel, delayed
from joblib.externals.loky.process_executor import TerminatedWorkerError

from sma_bayes.errors import WorkerError

T = TypeVar("T")
R = TypeVar("R")


def processes(jobs: int | None, tasks: int) -> int:
    """How many processes to use: `jobs`, or one for each core, but never more than there are tasks.

    Examples
    --------
    >>> processes(4, 2)
    2
    """
    wanted = jobs if jobs is not None and jobs > 0 else (os.cpu_count() or 1)
    return max(1, min(wanted, tasks))


def run(task: Callable[[T], R], items: Sequence[T], jobs: int | None) -> Iterator[R]:
    """Results of ``task(item)`` in the order of `items`, as they become ready.

    A task must not depend on the process that it runs in; then neither do the results.

    Raises
    ------
    WorkerError
        If a process came to an end in the middle of a task. What a task itself raises arrives as it is.
    """
    workers = processes(jobs, len(items))
    if workers == 1:
        yield from map(task, items)
        return
    try:
        yield from Parallel(n_jobs=workers, return_as="generator", pre_dispatch="2*n_jobs")(
            delayed(task)(item) for item in items
        )
    except TerminatedWorkerError as error:
        raise WorkerError(
            f"a worker process came to an end in the middle of its task, {_signals(error)}",
            expected="memory for all processes, and a disk that isn't full",
            remedy="repeat with a smaller --jobs; --resume keeps what has been done",
        ) from None


def _signals(error: TerminatedWorkerError) -> str:
    told = re.search(r"exit codes of the workers are (\{.*\})", str(error))
    return told[1].strip("{}") if told else "no one knows why"
