"""Limits of processor time that hold, and the processes in which samplers are measured under them.

A sampler that runs in Python is broken off by a signal. One may also run in a compiled loop of its own for as long
as it likes and never look at signals, so the limit can't be left to it: samplers run in processes of their own, which
the kernel ends (`RLIMIT_CPU`) if breaking off did not help, and which are ended by the clock if they wait for ever.
"""

from __future__ import annotations

import multiprocessing
import os
import resource
import signal
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Any, Final

PATIENCE_BY_THE_CLOCK = 10.0
"""How many times its allowance of processor time a call may last by the clock, which other load slows down."""
AT_LEAST_S = 60.0
"""Seconds by the clock that any call is given."""


def processor_s() -> float:
    """Processor time of this process so far, to the microsecond also while it is limited.

    While a process has a limit or a timer of processor time, Linux answers with a sum that it brings up to date every
    few milliseconds; asked for the time of the thread it does so at once.
    """
    time.thread_time()
    return time.process_time()


BY_TICKS: Final = ~0 << 3
"""Clock of this process by which Linux holds `RLIMIT_CPU`: time by the ticks that found it at work. In ten minutes it
was 6.6 s ahead of that of `processor_s` (``include/linux/posix-timers.h``, CPUCLOCK_PROF)."""


def limited_s() -> float:
    """Processor time of this process so far, as the limit of the kernel counts it, if that can be asked for."""
    try:
        return time.clock_gettime(BY_TICKS)
    except OSError:  # no Linux
        return processor_s()


class TimeUp(Exception):
    """A block was still at it when its processor time had run out."""


AGAIN_S = 1.0
"""Processor seconds between two attempts to break a block off."""


@contextmanager
def at_most(seconds: float, grace_s: float) -> Iterator[None]:
    """Raise `TimeUp` when a block has used so much processor time; end the process when that has not helped.

    It is raised again each second: what rings while an object is done away with is not heard.

    Parameters
    ----------
    seconds : float
    grace_s : float
        Processor seconds for compiled code to come to its end, before the kernel ends the process.
    """

    rung = False

    def ring(number: int, frame: object) -> None:
        nonlocal rung
        rung = True
        raise TimeUp

    before = signal.signal(signal.SIGPROF, ring)
    outside = _allow(seconds + grace_s)
    signal.setitimer(signal.ITIMER_PROF, seconds, AGAIN_S)
    try:
        yield
    except Exception as error:
        if rung:  # some make another error of what breaks them off
            raise TimeUp from error
        raise
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
        resource.setrlimit(resource.RLIMIT_CPU, outside)


def _allow(seconds: float) -> tuple[int, int]:
    """Let the kernel end this process after so much more processor time, if not sooner; what was allowed before."""
    before = resource.getrlimit(resource.RLIMIT_CPU)
    soon = int(limited_s() + seconds) + 1
    within = soon if before[0] == resource.RLIM_INFINITY else min(soon, before[0])
    resource.setrlimit(resource.RLIMIT_CPU, (within, before[1]))
    return before


class Ended(Exception):
    """A call was ended before it came back.

    Attributes
    ----------
    cpu_s, wall_s : float
        What it had taken.
    """

    def __init__(self, cpu_s: float, wall_s: float) -> None:
        super().__init__(f"ended after {cpu_s:.1f} s of processor time, {wall_s:.1f} s by the clock")
        self.cpu_s = cpu_s
        self.wall_s = wall_s


class Worker:
    """A process that calls functions; started when it is first needed, and anew after it had to be ended."""

    def __init__(self) -> None:
        self._process: SpawnProcess | None = None
        self._line: Connection | None = None
        self._used_s = 0.0

    @property
    def alive(self) -> bool:
        """Whether there is a process that remembers earlier calls."""
        return self._process is not None

    def call(
        self, function: Callable[..., Any], *args: Any, allowed_s: float, wall_s: float | None = None
    ) -> Any:
        """Result of ``function(*args)`` in the process.

        Parameters
        ----------
        function : callable
            What can be imported; its arguments and result can be pickled.
        allowed_s : float
            Processor seconds after which the process is ended, kept to the second.
        wall_s : float, optional
            The same by the clock; `PATIENCE_BY_THE_CLOCK` times the allowance, and `AT_LEAST_S`, if not given.

        Raises
        ------
        Ended
            If the call did not come back in time.
        RuntimeError
            If it raised.
        """
        began = time.perf_counter()
        line = self._line or self._start()
        line.send((function, args, allowed_s))
        try:
            if not line.poll(wall_s or AT_LEAST_S + PATIENCE_BY_THE_CLOCK * allowed_s):
                raise EOFError
            result, failure, self._used_s = line.recv()
        except EOFError:
            before = self._used_s
            raise Ended(self.close() - before, time.perf_counter() - began) from None
        if failure:
            raise RuntimeError(failure)
        return result

    def _start(self) -> Connection:
        context = multiprocessing.get_context("spawn")
        self._line, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs,), daemon=True)
        self._process.start()
        theirs.close()
        self._used_s = 0.0
        return self._line

    def close(self) -> float:
        """End the process, if there is one; the processor time that it has taken [s]."""
        if self._process is None or self._line is None:
            return 0.0
        before = _of_children_s()
        self._process.kill()
        self._process.join()
        self._line.close()
        self._process = self._line = None
        return _of_children_s() - before

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _of_children_s() -> float:
    """Processor time of all children that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _serve(line: Connection) -> None:
    resource.setrlimit(
        resource.RLIMIT_CORE, (0, 0)
    )  # a process that runs out of time leaves no image of itself
    while True:
        try:
            function, args, allowed_s = line.recv()
        except EOFError:
            os._exit(0)
        before = _allow(allowed_s)
        result, failure = None, ""
        try:
            with open(os.devnull, "w") as nowhere, redirect_stdout(nowhere), redirect_stderr(nowhere):
                result = function(*args)  # samplers like to talk, and to print what breaks them off
        except Exception:
            failure = traceback.format_exc()
        resource.setrlimit(resource.RLIMIT_CPU, before)
        line.send((result, failure, processor_s()))
