"""What is timed, and why a run ended."""

from __future__ import annotations

from collections.abc import Generator
from typing import Any

import numpy as np
import pytest
from benchmark.judgement import Reference
from benchmark.measure import GRACE_S, PATIENCE, Task, measure, measure_in, to_target
from benchmark.problems import Case
from benchmark.progress import GROUPS, Progress, Settings
from benchmark.workers import Ended, Worker

from sma_bayes.sampling.laplace import find_mode

REFERENCE = Reference.of(np.random.default_rng(0).standard_normal((20_000, 2)), 20_000.0)


def normal(seed: int, steps: int, scale: float = 1.0, anew: bool = False) -> Progress:
    z = scale * np.random.default_rng(seed).standard_normal((GROUPS, steps, 8, 2))
    return Progress(z, z.size // 2, (0.0,), anew)


def busy() -> None:
    sum(range(2_000_000))


def test_the_target_is_reached_by_draws_of_the_right_posterior() -> None:
    found = to_target((normal(seed, 50) for seed in range(1)), REFERENCE, 5.0)
    assert found.ended == "target"
    assert found.verdict.reached
    assert np.isfinite(found.claimed_s)


def test_draws_of_another_posterior_claim_only() -> None:
    found = to_target((normal(seed, 50, scale=0.7) for seed in range(2)), REFERENCE, 5.0)
    assert found.ended == "itself"
    assert found.verdict.convergence.converged
    assert not found.verdict.reached
    assert np.isfinite(found.claimed_s)


def test_time_is_up_inside_a_sampler_before_it_has_any_draws() -> None:
    def run() -> Generator[Progress, float, None]:
        while True:
            busy()
        yield normal(0, 1)

    found = to_target(run(), REFERENCE, 0.2)
    assert found.ended == "time"
    assert 0.2 <= found.clock.cpu_s < 2.0
    assert np.isnan(found.claimed_s)
    assert np.isnan(found.verdict.errors).all()


class Hands:
    """Clocks that show what they are told to."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 0.0
        monkeypatch.setattr("benchmark.measure.time", self)
        monkeypatch.setattr("benchmark.measure.processor_s", self.perf_counter)

    def perf_counter(self) -> float:
        return self.now


def seconds_to_target(anew: bool, all_runs: bool, monkeypatch: pytest.MonkeyPatch) -> float:
    hands = Hands(monkeypatch)

    def run() -> Generator[Progress, float, None]:
        hands.now += 3.0
        yield normal(0, 5, anew=anew)
        hands.now += 10.0
        yield normal(1, 50, anew=anew)

    return to_target(run(), REFERENCE, 100.0, all_runs=all_runs).clock.cpu_s


def test_of_a_sampler_that_begins_anew_the_last_run_counts_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both reach the target between the checks, at the same number of draws: 3 s + 10 s a share, or 3 s + 7 s."""
    goes_on, begins_anew = (seconds_to_target(anew, False, monkeypatch) for anew in (False, True))
    assert 3.0 < begins_anew < 10.0
    assert begins_anew - 3.0 == pytest.approx(0.7 * (goes_on - 3.0))
    assert seconds_to_target(True, True, monkeypatch) == goes_on  # cold: what it compiled is in the first


def test_who_is_unaided_pays_for_looks_and_stops_at_one(monkeypatch: pytest.MonkeyPatch) -> None:
    hands = Hands(monkeypatch)

    def look(*_: object) -> None:
        hands.now += 2.0

    monkeypatch.setattr("benchmark.measure.assess", look)

    def run() -> Generator[Progress, float, None]:
        hands.now += 3.0
        yield normal(0, 5)
        hands.now += 10.0
        yield normal(1, 50)

    found = to_target(run(), REFERENCE, 100.0, unaided=True)
    assert (found.clock.steps, found.clock.cpu_s) == (50, 3.0 + 2.0 + 10.0 + 2.0)


def test_who_is_unaided_climbs_to_the_mode_in_its_own_time(monkeypatch: pytest.MonkeyPatch) -> None:
    climbs = []

    def climbing(*arguments: Any, **options: Any) -> Any:
        climbs.append(arguments)
        return find_mode(*arguments, **options)

    monkeypatch.setattr("benchmark.problems.find_mode", climbing)
    task = Task("now", Case("S", "independent", 40), 0, "emcee-de", Settings(), 0, 0, 0.01, unaided=True)
    problem = task.problem()
    _ = problem.mode
    row = measure(task, problem, Reference.of(np.zeros((1, problem.dimension)), 1.0))
    assert len(climbs) == 2
    assert row.kind == "unaided"


class Stubborn(Worker):
    """A worker whose every call has to be ended."""

    def call(self, *_: object, **__: object) -> None:
        raise Ended(cpu_s=50.0, wall_s=70.0)


def test_a_run_whose_process_was_ended_is_a_row_that_says_so() -> None:
    task = Task("now", Case("S", "independent", 40), 0, "pymc", Settings(), 0, 0, limit_s=10.0)
    row = measure_in(Stubborn(), task, task.problem())
    assert (row.ended, row.reached, row.steps) == ("killed", False, 0)
    assert row.cpu_s == PATIENCE * 10.0 + GRACE_S  # the rest went into checks, or the kernel's second
    assert np.isnan([row.rhat, row.ess_bulk, row.share_errors, row.claimed_s]).all()
