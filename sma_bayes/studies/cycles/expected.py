"""What a study of cycles is expected to take, so that it can be told before it begins."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from sma_bayes.runs.jobs import by_the_clock

OF_A_CURVE_S: Final = 0.1
OF_A_CYCLE_S: Final = 0.045
"""Processor time of a common curve: a constant, and of each cycle, those that are forecast included [s]. Of seventeen
studies of real and simulated sweeps, 7 to 250 cycles of 1 to 3 conditions, 2 to 50 s, all took this within a factor of
1.6; one of five models to choose from took 1.7 times as long as with one."""


def expected_s(conditions: Iterable[tuple[int, float]], jobs: int | None) -> float:
    """What a study is expected to take by the clock, within a factor of three [s].

    Parameters
    ----------
    conditions : iterable of tuple of int and float
        Common curves of a condition, and its cycles, forecasts included.
    jobs : int, optional
        See `run`; a condition is a task.
    """
    return by_the_clock(
        [curves * (OF_A_CURVE_S + OF_A_CYCLE_S * cycles) for curves, cycles in conditions], jobs
    )
