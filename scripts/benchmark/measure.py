"""Time a sampler to a target that only draws of the right posterior can meet.

R-hat and effective sample size alone are met too early by ensembles that start from a Laplace approximation: all
start alike, agree with each other, and have not yet forgotten their start. So a run also has to agree with a
longer run of this package; and where a run of this package does not, it has not reached the target either.
"""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields, replace

import numpy as np
from benchmark.problems import Case, Problem
from benchmark.progress import GROUPS, Progress, Settings
from benchmark.samplers import COMPILED, ONE_BY_ONE, SAMPLERS

from sma_bayes.inference.convergence import Convergence, Target, ess_bulk, ess_tail, rank_rhat
from sma_bayes.quantities import Floats

TARGET = Target(rhat=1.01, ess=1000.0)
MEAN_SHIFT = 0.1
"""Greatest difference of means, in standard deviations of the posterior, of 'the same posterior'."""
SD_RATIO = 0.1
"""Greatest relative difference of standard deviations of 'the same posterior'."""
ERRORS = 4.0
"""Standard errors of the draws that are allowed for where they are more than that."""
PATIENCE = 1.2
"""Multiple of the limit of time at which a sampler that has not handed over its draws is broken off."""
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
    """

    session: str
    case: Case
    index: int
    sampler: str
    settings: Settings
    repeat: int
    place: int
    limit_s: float

    def write(self) -> str:
        """The task as JSON."""
        return json.dumps(asdict(self))

    @staticmethod
    def read(text: str) -> Task:
        """A task from its JSON."""
        found = json.loads(text)
        return Task(**{**found, "case": Case(**found["case"]), "settings": Settings(**found["settings"])})

    def problem(self) -> Problem:
        """The posterior to sample."""
        return Problem.of(self.case.records()[self.index], self.case.noise)


@dataclass(frozen=True, slots=True)
class Row:
    """One run of one sampler on one record.

    Attributes
    ----------
    kind : str
        ``warm``: everything imported; ``cold``: a fresh process, from its start to the draws.
    length : str
        Samples of a record that were asked for: a number, or ``demo``.
    points, parameters : int
        Samples of this record, and sampled parameters.
    reached : bool
        Whether the target was met by draws of the right posterior.
    claimed_s : float
        When R-hat and effective sample size were met for the first time, whatever the draws; NaN if never.
    wall_s, cpu_s : float
        To the target, or to the limit where that was not reached. Finding the least-squares start (`warm_s`) is
        not in it, for nobody, but for ``cold``, for everybody.
    discard : float
        Share of the steps dropped as burn-in.
    mean_shift : float
        Greatest difference of a mean from that of a longer run of this package [sd of the posterior].
    sd_low, sd_high : float
        Least and greatest ratio of a standard deviation to that of the longer run.
    """

    session: str
    kind: str
    channels: str
    noise: str
    length: str
    record: str
    points: int
    parameters: int
    sampler: str
    walkers: int
    start: str
    log_prob: str
    repeat: int
    place: int
    limit_s: float
    reached: bool
    claimed_s: float
    wall_s: float
    cpu_s: float
    warm_s: float
    evaluations: int
    steps: int
    discard: float
    rhat: float
    ess_bulk: float
    ess_tail: float
    mean_shift: float
    sd_low: float
    sd_high: float

    @staticmethod
    def parse(text: dict[str, str]) -> Row:
        """A row as it was written to a CSV file."""
        read = {"str": str, "int": int, "float": float, "bool": lambda s: s == "True"}
        return Row(**{f.name: read[str(f.type)](text[f.name]) for f in fields(Row)})


@dataclass(frozen=True, slots=True, eq=False)
class Verdict:
    """What some draws are worth.

    Attributes
    ----------
    discard : float
        Share of the steps dropped as burn-in.
    convergence : Convergence
    shift : ndarray, shape (D,)
        Means less those of the reference [sd of the posterior].
    ratio : ndarray, shape (D,)
        Standard deviations over those of the reference.
    """

    discard: float
    convergence: Convergence
    shift: Floats
    ratio: Floats

    @property
    def same(self) -> bool:
        """Whether the draws are of the right posterior, as far as their number can tell."""
        ess = np.minimum(self.convergence.ess_bulk, self.convergence.ess_tail)
        error = ERRORS / np.sqrt(ess)
        means = np.abs(self.shift) <= np.maximum(MEAN_SHIFT, error)
        widths = np.abs(self.ratio - 1.0) <= np.maximum(SD_RATIO, error / np.sqrt(2.0))
        return bool(np.all(means & widths))

    @property
    def least(self) -> float:
        """Least effective sample size."""
        return float(np.nanmin(np.minimum(self.convergence.ess_bulk, self.convergence.ess_tail)))

    @property
    def reached(self) -> bool:
        """Whether the target is met by draws of the right posterior."""
        return self.convergence.converged and self.same


def judge(progress: Progress, discard: float, reference: tuple[Floats, Floats]) -> Verdict:
    """Judge draws after a share of the steps is dropped."""
    chains = progress.chains[:, int(discard * progress.chains.shape[1]) :]
    flat = chains.reshape(-1, chains.shape[-1])
    mean, sd = reference
    return Verdict(discard, diagnose(chains), (flat.mean(axis=0) - mean) / sd, flat.std(axis=0) / sd)


def diagnose(chains: Floats) -> Convergence:
    """R-hat and effective sample sizes with the walkers of an ensemble joined end to end, in the same way for all.

    `sma_bayes.inference.convergence.assess` adds a second estimate, from the means over walkers, to runs of a hundred
    steps or more. It is on the safe side by a factor of about two for stretch moves, and would be asked of other
    samplers only, since this package's runs are shorter.
    """
    groups, steps, walkers, dimension = chains.shape
    joined = np.swapaxes(chains, 1, 2).reshape(groups, walkers * steps, dimension)
    in_order = chains.reshape(groups, steps * walkers, dimension)
    rhat = np.maximum(rank_rhat(joined), rank_rhat(in_order))
    bulk, tail = ess_bulk(joined), ess_tail(joined)
    reached = np.all(rhat <= TARGET.rhat) and np.all(np.minimum(bulk, tail) >= TARGET.ess)
    return Convergence(rhat, bulk, tail, bool(reached))


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


class TimeUp(Exception):
    """A sampler was still at it when its processor time had run out."""


@contextmanager
def at_most(seconds: float) -> Iterator[None]:
    """Raise `TimeUp` when a block has used so much processor time; compiled code is let come to its end."""

    def ring(number: int, frame: object) -> None:
        raise TimeUp

    before = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """Where the clock stopped."""

    progress: Progress
    verdict: Verdict
    claimed_s: float
    clock: Clock


def to_target(
    steps: Generator[Progress, float, None], reference: tuple[Floats, Floats], limit_s: float
) -> Outcome:
    """Run a sampler until its draws meet the target and are right, or its time is up. Checks are not timed."""
    before = Clock(0, 0.0, 0.0)
    now = before
    claimed = float("nan")
    outcome = growth = None
    while now.cpu_s < limit_s:
        wall, cpu = time.perf_counter(), time.process_time()
        try:
            with at_most(max(PATIENCE * limit_s - now.cpu_s, 0.1)):
                progress = steps.send(growth)
        except (StopIteration, TimeUp):
            now = Clock(
                now.steps, now.wall_s + time.perf_counter() - wall, now.cpu_s + time.process_time() - cpu
            )
            break
        length = progress.chains.shape[1]
        now = Clock(length, now.wall_s + time.perf_counter() - wall, now.cpu_s + time.process_time() - cpu)
        verdict = _verdict(progress, reference)
        if verdict.convergence.converged and np.isnan(claimed):
            claimed = now.wall_s
        if verdict.reached and before.steps:
            progress, verdict, now = _earliest(progress, verdict, before, now, reference)
        outcome = Outcome(progress, verdict, min(claimed, now.wall_s) if verdict.reached else claimed, now)
        if verdict.reached:
            break
        before = now
        growth = _growth(verdict.least, limit_s / max(now.cpu_s, 1e-3))
    if outcome is None:
        none = np.full((GROUPS, 4, 1, reference[0].size), np.nan)
        verdict = Verdict(0.0, Convergence(*(np.full(reference[0].size, np.nan),) * 3, False), *reference)
        return Outcome(Progress(none, 0), verdict, claimed, now)
    return outcome if outcome.verdict.reached else replace(outcome, clock=now)


def _verdict(progress: Progress, reference: tuple[Floats, Floats]) -> Verdict:
    """The best verdict over the shares that may be dropped."""
    verdicts = []
    for discard in progress.discards:
        verdicts.append(judge(progress, discard, reference))
        if verdicts[-1].reached:
            return verdicts[-1]
    return max(verdicts, key=lambda v: (v.convergence.converged, v.least))


def _earliest(
    progress: Progress, verdict: Verdict, before: Clock, now: Clock, reference: tuple[Floats, Floats]
) -> tuple[Progress, Verdict, Clock]:
    """Where the target was reached since the check before, by bisection; steps take equal times."""
    low, high = before.steps, now.steps
    best = progress, verdict, now
    while high - low > max(1, LATE * low):
        middle = (low + high) // 2
        share = (middle - before.steps) / (now.steps - before.steps)
        shorter = progress.cut(middle)
        found = _verdict(shorter, reference)
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
    """What a sampler can compile once for all records, and a look whether its target is the same.

    Raises
    ------
    ValueError
        If it samples another posterior.
    """
    sampler = SAMPLERS[name]
    if hasattr(sampler, "check"):
        sampler.check(problem)
    if name in COMPILED:
        next(sampler.run(problem, settings, 1000))


def measure(task: Task, problem: Problem) -> Row:
    """Time one sampler on one record."""
    own = task.sampler == "sma_bayes"
    if not own:  # what this package does in its own time others are given
        _ = problem.mode, problem.float_posterior
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        steps = SAMPLERS[task.sampler].run(problem, task.settings, task.repeat)
        outcome = to_target(steps, problem.reference, task.limit_s)
    verdict = outcome.verdict
    convergence = verdict.convergence
    return Row(
        session=task.session,
        kind="warm",
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
        reached=verdict.reached,
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
        mean_shift=float(np.max(np.abs(verdict.shift))),
        sd_low=float(verdict.ratio.min()),
        sd_high=float(verdict.ratio.max()),
    )
