"""The limit of processor time holds for any call, and a worker that had to be ended serves again."""

from __future__ import annotations

import math
import resource
import statistics
import time

import pytest
from benchmark import workers
from benchmark.workers import Ended, TimeUp, Worker, at_most, processor_s


def test_a_call_comes_back_and_what_fails_is_told() -> None:
    with Worker() as worker:
        assert worker.call(math.factorial, 20, allowed_s=30.0) == math.factorial(20)
        with pytest.raises(RuntimeError, match="math domain error"):
            worker.call(math.sqrt, -1.0, allowed_s=30.0)
        assert worker.alive
    assert not worker.alive


def test_a_compiled_loop_without_end_is_ended_and_the_next_call_served() -> None:
    """`sum` of a range does not look at signals' handlers before it is through, which would take days."""
    with Worker() as worker:
        assert worker.call(abs, -1, allowed_s=30.0) == 1
        with pytest.raises(Ended) as ended:
            worker.call(sum, range(10**15), allowed_s=0.2)
        assert 0.1 < ended.value.cpu_s < 3.0  # the kernel looks once a second
        assert not worker.alive
        assert worker.call(abs, -2, allowed_s=30.0) == 2


def test_a_process_whose_clocks_disagree_is_not_ended_before_its_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """After minutes of work the kernel's count by ticks is seconds away from the one that is exact."""
    try:
        time.clock_gettime(workers.BY_TICKS)
    except OSError:
        pytest.skip("this system has one clock of processor time")
    monkeypatch.setattr(workers, "processor_s", lambda: 0.0)
    with at_most(100.0, 20.0):
        soft, _ = resource.getrlimit(resource.RLIMIT_CPU)
    assert 119.0 < soft - time.clock_gettime(workers.BY_TICKS) < 122.0


def test_what_waits_for_ever_is_ended_by_the_clock() -> None:
    with Worker() as worker, pytest.raises(Ended) as ended:
        worker.call(time.sleep, 1000.0, allowed_s=30.0, wall_s=0.5)
    assert ended.value.cpu_s < 20.0


def test_a_loop_in_python_is_broken_off_and_limits_are_put_back() -> None:
    before = resource.getrlimit(resource.RLIMIT_CPU)
    began = time.process_time()
    with pytest.raises(TimeUp), at_most(0.1, 100.0):
        sum(0 for _ in iter(int, 1))  # for ever, but in Python
    assert time.process_time() - began < 5.0
    assert resource.getrlimit(resource.RLIMIT_CPU) == before


def test_processor_time_is_up_to_date_while_it_is_limited() -> None:
    """It used to lag by a millisecond or more in the median, of runs that take ten."""
    lags = []
    with at_most(100.0, 100.0):
        for _ in range(40):
            process, thread, wall = processor_s(), time.thread_time(), time.perf_counter()
            while time.perf_counter() - wall < 0.003:
                pass
            process = processor_s() - process  # before the thread's time, which would bring it up to date
            lags.append(abs(process - (time.thread_time() - thread)))
    assert statistics.median(lags) < 0.0002


def endless() -> None:
    """As a sampler may do it: in Python, and with an error of its own for whatever stops it."""
    try:
        sum(0 for _ in iter(int, 1))
    except TimeUp:
        raise TypeError("stopped") from None


def test_what_makes_another_error_of_it_is_broken_off_too() -> None:
    with pytest.raises(TimeUp), at_most(0.1, 100.0):
        endless()
    with pytest.raises(TypeError, match="its own"), at_most(100.0, 100.0):
        raise TypeError("its own")


def test_a_block_that_did_not_hear_the_first_call_is_broken_off_by_the_next() -> None:
    unheard = 0

    def deaf_once() -> None:
        nonlocal unheard
        try:
            while True:
                sum(range(100_000))
        except TimeUp:
            unheard += 1
            while True:
                sum(range(100_000))

    with pytest.raises(TimeUp), at_most(0.05, 5.0):
        deaf_once()
    assert unheard == 1
