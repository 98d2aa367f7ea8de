"""Time a sampler to a target that only draws of the right posterior can meet."""

from __future__ import annotations

import os
import time
from collections.abc import Generator
from contextlib import suppress
from dataclasses import dataclass, replace
from tempfile import TemporaryDirectory

import numpy as np
from benchmark.judgement import TARGET, Reference, Verdict, judge
from benchmark.problems import Case, Problem
from benchmark.progress import Progress, Settings
from benchmark.rows import OWN, Row
from benchmark.samplers import ONE_BY_ONE, SAMPLERS
from benchmark.workers import Ended, TimeUp, Worker, at_most, processor_s

from sma_bayes.sampling.convergence import assess

PATIENCE = 1.2
"""Multiple of the limit of time at which a sampler that has not handed over its draws is broken off."""
GRACE_S = 5.0
"""Processor seconds beyond that, after which its process is ended if it can't be broken off."""
PREPARATION_S = 300.0
"""Processor seconds in which a sampler must have compiled what it shares."""
CHECKS = 10.0
"""Multiple of the limit that a run may take with its checks."""
WARM_UP_S = 5.0
"""Processor seconds of a run that is not measured, before those that are: all that is imported late is then there."""
LATE = 0.02
"""By what share of the steps the moment at which the target was reached may be found too late."""


@dataclass(frozen=True, slots=True)
class Task:
    """One run that is asked for.

    Attributes
    ----------
    session : str
        When the script was started; ratios are taken within a session.
    case : Case
    index : int
        Which of the 18 records.
    sampler : str
    settings : Settings
    repeat, place : int
        Repeat, which is the seed too; and place in the order of the samplers.
    limit_s : float
        Of processor time.
    unaided : bool
        Whether the sampler is on its own: the clock runs while it climbs to the mode and while its draws are looked
        at, and it stops at a look. Otherwise an oracle stops it for nothing at the step at which the target is reached.
    """

    session: str
    case: Case
    index: int
    sampler: str
    settings: Settings
    repeat: int
    place: int
    limit_s: float
    unaided: bool = False

    def problem(self) -> Problem:
        """The posterior to sample."""
        return Problem.of(self.case.records()[self.index], self.case.noise)


@dataclass(frozen=True, slots=True)
class Clock:
    """Steps made, and the time that they took."""

    steps: int
    wall_s: float
    cpu_s: float

    def towards(self, later: Clock, share: float) -> Clock:
        """The clock at a share of the steps between."""
        return Clock(
            round(self.steps + share * (later.steps - self.steps)),
            self.wall_s + share * (later.wall_s - self.wall_s),
            self.cpu_s + share * (later.cpu_s - self.cpu_s),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """Where the clock stopped, and why."""

    progress: Progress
    verdict: Verdict
    claimed_s: float
    clock: Clock
    ended: str


def to_target(
    steps: Generator[Progress, float, None],
    reference: Reference,
    limit_s: float,
    *,
    all_runs: bool = False,
    unaided: bool = False,
) -> Outcome:
    """Run a sampler until its draws meet the target and are right, or its time is up.

    With `all_runs` the earlier runs of a sampler that begins anew count, too: what it imports and compiles is in them.
    Checks are not timed, and the step at which the target was reached is found afterwards, unless it is `unaided`.
    """
    dimension = reference.mean.size
    before = now = Clock(0, 0.0, 0.0)
    last = Outcome(Progress.none(dimension), Verdict.none(dimension), float("nan"), now, "time")
    growth = None
    while now.cpu_s < limit_s:
        found, now, ended = _timed(steps, growth, now, PATIENCE * limit_s, all_runs)
        if found is None:
            return replace(last, clock=now, ended=ended)
        if unaided:
            now = _looked_at(found, now)
        progress, verdict, claimed = found, judge(found, reference), last.claimed_s
        if verdict.convergence.converged and np.isnan(claimed):
            claimed = now.wall_s
        if verdict.reached:
            if before.steps and not unaided:
                progress, verdict, now = _earliest(progress, verdict, before, now, reference)
            return Outcome(progress, verdict, min(claimed, now.wall_s), now, "target")
        last = Outcome(progress, verdict, claimed, now, "time")
        growth = _growth(verdict.least, limit_s / max(now.cpu_s, 1e-3))
        before = now
    return last


def _timed(
    steps: Generator[Progress, float, None], growth: float | None, now: Clock, most_s: float, all_runs: bool
) -> tuple[Progress | None, Clock, str]:
    """Let a sampler go on: its draws, the clock after it, and why there are none if there are none."""
    wall, cpu = time.perf_counter(), processor_s()
    progress, ended = None, ""
    try:
        with at_most(max(most_s - now.cpu_s, 0.1), GRACE_S):
            progress = steps.send(growth)
    except StopIteration:
        ended = "itself"
    except TimeUp:
        ended = "time"
    spent = Clock(now.steps, time.perf_counter() - wall, processor_s() - cpu)
    if progress is None:
        return None, Clock(now.steps, now.wall_s + spent.wall_s, now.cpu_s + spent.cpu_s), ended
    since = Clock(0, 0.0, 0.0) if progress.anew and not all_runs else now
    steps_made = progress.chains.shape[1]
    return progress, Clock(steps_made, since.wall_s + spent.wall_s, since.cpu_s + spent.cpu_s), ended


def _looked_at(progress: Progress, now: Clock) -> Clock:
    """The clock after a user has looked at draws, with this package's diagnosis, the fastest at hand."""
    wall, cpu = time.perf_counter(), processor_s()
    chains = progress.chains
    assess(chains[:, int(progress.discards[0] * chains.shape[1]) :], TARGET)
    return Clock(now.steps, now.wall_s + time.perf_counter() - wall, now.cpu_s + processor_s() - cpu)


def _earliest(
    progress: Progress, verdict: Verdict, before: Clock, now: Clock, reference: Reference
) -> tuple[Progress, Verdict, Clock]:
    """Where the target was reached since the check before, by bisection; steps take equal times."""
    low, high = before.steps, now.steps
    best = progress, verdict, now
    while high - low > max(1, LATE * low):
        middle = (low + high) // 2
        share = (middle - before.steps) / (now.steps - before.steps)
        shorter = progress.cut(middle)
        found = judge(shorter, reference)
        if found.reached:
            high = middle
            best = shorter, found, before.towards(now, share)
        else:
            low = middle
    return best


def _growth(least: float, most: float) -> float:
    """By what factor to go on: as the effective sample size suggests, but not far beyond the limit of time."""
    return float(np.clip(TARGET.ess / max(least, 1.0), 1.1, min(2.0, max(1.1 * most, 1.1))))


def prepare(name: str, problem: Problem, settings: Settings) -> None:
    """What a sampler does once for all records: import, compile, and a look whether its target is the same.

    Raises
    ------
    ValueError
        If it samples another posterior.
    """
    sampler = SAMPLERS[name]
    if hasattr(sampler, "prepare"):
        sampler.prepare(problem)
    with suppress(TimeUp), at_most(WARM_UP_S, PREPARATION_S):
        next(sampler.run(problem, settings, 1000))


def measure(task: Task, problem: Problem, reference: Reference, *, all_runs: bool = False) -> Row:
    """Time one sampler on one record, in this process."""
    if task.unaided:
        problem = replace(problem)  # as it is before anyone has climbed to its mode
    elif task.sampler != OWN:  # what this package does in its own time others are given
        _ = problem.mode, problem.float_posterior
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        steps = SAMPLERS[task.sampler].run(problem, task.settings, task.repeat)
        outcome = to_target(
            steps, reference, task.limit_s, all_runs=all_runs, unaided=task.unaided and task.sampler != OWN
        )
    return row_of(task, problem, outcome)


def measure_cold(task: Task, reference: Reference, began: float) -> Row:
    """Time one sampler on one record in a process that started for it at `began` and has done nothing yet.

    What PyTensor compiled in earlier processes and keeps on disk is not there either.
    """
    problem = task.problem()
    wall_s, cpu_s = time.time() - began, processor_s()
    with TemporaryDirectory() as empty:
        os.environ["PYTENSOR_FLAGS"] = f"base_compiledir={empty}"
        row = measure(task, problem, reference, all_runs=True)
    return replace(
        row,
        kind="cold",
        claimed_s=wall_s + row.claimed_s,
        wall_s=wall_s + row.wall_s,
        cpu_s=cpu_s + row.cpu_s,
    )


def measure_in(worker: Worker, task: Task, problem: Problem) -> Row:
    """Time one sampler on one record in its worker, which is prepared if it is new."""
    try:
        if not worker.alive:
            worker.call(prepare, task.sampler, problem, task.settings, allowed_s=PREPARATION_S)
        row = worker.call(measure, task, problem, problem.reference, allowed_s=_allowed(task))
    except Ended as ended:
        return _killed(task, problem, ended)
    return row


def measure_in_fresh(task: Task, problem: Problem) -> Row:
    """Time one sampler on one record in a fresh process, from its start."""
    with Worker() as worker:
        try:
            row = worker.call(measure_cold, task, problem.reference, time.time(), allowed_s=_allowed(task))
        except Ended as ended:
            return replace(_killed(task, problem, ended), kind="cold")
    return row


def _allowed(task: Task) -> float:
    """Processor seconds for a run with its checks, which are not timed, but take theirs, too."""
    return PREPARATION_S + CHECKS * task.limit_s


def _killed(task: Task, problem: Problem, ended: Ended) -> Row:
    """Row of a run whose process had to be ended; its draws are lost, and so is what its checks had said."""
    clock = Clock(0, ended.wall_s, min(ended.cpu_s, PATIENCE * task.limit_s + GRACE_S))
    nothing = Progress.none(problem.dimension)
    outcome = Outcome(nothing, Verdict.none(problem.dimension), float("nan"), clock, "killed")
    return row_of(task, problem, outcome)


def row_of(task: Task, problem: Problem, outcome: Outcome) -> Row:
    """The row of a run that has ended."""
    own = task.sampler == OWN
    verdict = outcome.verdict
    convergence = verdict.convergence
    return Row(
        session=task.session,
        kind="unaided" if task.unaided else "warm",
        channels=task.case.channels,
        noise=task.case.noise,
        length=str(task.case.points or "demo"),
        record=problem.posterior.records[0].key,
        points=problem.posterior.n,
        parameters=problem.dimension,
        sampler=task.sampler,
        walkers=outcome.progress.chains.shape[2],
        start="own" if own else task.settings.start,
        log_prob=task.settings.log_prob if task.sampler in ONE_BY_ONE else "batched",
        repeat=task.repeat,
        place=task.place,
        limit_s=task.limit_s,
        reached=outcome.ended == "target",
        claimed_s=outcome.claimed_s,
        wall_s=outcome.clock.wall_s,
        cpu_s=outcome.clock.cpu_s,
        warm_s=problem.warm_s,
        evaluations=outcome.progress.evaluations,
        steps=outcome.progress.chains.shape[1],
        discard=verdict.discard,
        rhat=float(np.max(convergence.rhat)),
        ess_bulk=float(np.min(convergence.ess_bulk)),
        ess_tail=float(np.min(convergence.ess_tail)),
        share_errors=float(np.max(np.abs(verdict.errors))),
        mean_shift=float(np.max(np.abs(verdict.shift))),
        sd_low=float(verdict.ratio.min()),
        sd_high=float(verdict.ratio.max()),
        ended=outcome.ended,
    )
