"""Worker processes of this machine: they leave signals to their parent, and end when it does, however it ends."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import active_children, resource_tracker
from typing import Final

from sma_bayes.interruption import SIGNALS, held, kill

WATCH_S: Final = 0.5
"""How often a worker looks whether its parent still lives [s]."""


def follow(parent: int) -> None:
    """End this process soon after its parent, from now on; called in a worker as it starts.

    A process whose parent has ended belongs to another one. Windows does not tell so; there, loky sees to it.

    Parameters
    ----------
    parent : int
        Number of the parent process.
    """
    if os.name == "posix":
        threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(WATCH_S)
    os._exit(1)


@contextmanager
def signals_left_to_parent() -> Iterator[None]:
    """Hold back signals while processes are started in a ``with`` block: what starts there never gets them.

    A terminal sends them to all processes of a command, but only the parent knows how to end it in order. Those that
    it gets meanwhile arrive at the end of the block.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from joblib.externals.loky.backend import resource_tracker as loky_tracker

    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        with _silent_when_started():
            for tracker in (resource_tracker, loky_tracker):
                tracker.ensure_running()  # lets SIGINT and SIGTERM in again as it starts
        signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
        with held():  # another thread may get them, and a process that is started half tells of it
            yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _silent_when_started() -> Iterator[None]:
    """Let processes that start in a ``with`` block give no warnings.

    What counts the resources of a run takes away what an interrupted one has left, and need not tell of it.
    """
    before = os.environ.get("PYTHONWARNINGS")
    os.environ["PYTHONWARNINGS"] = "ignore"
    try:
        yield
    finally:
        del os.environ["PYTHONWARNINGS"]
        if before is not None:
            os.environ["PYTHONWARNINGS"] = before


def stop_workers() -> None:
    """End all workers at once, whatever they are doing; the next task gets new ones."""
    children = active_children()
    if not children:
        return
    from joblib.externals.loky.backend.process import LokyProcess

    for worker in children:
        if isinstance(worker, LokyProcess):
            kill(worker)
            worker.join()
