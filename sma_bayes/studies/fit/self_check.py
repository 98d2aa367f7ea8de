"""Posterior simulation-based calibration: whether the intervals of a record would hold the truth, were its model right.

For each replicate a truth ``theta'`` is drawn from the posterior of the record ``y``, and a measurement ``y'`` at the
same temperatures from model, discrepancy and noise at that truth. By Bayes' rule

    p(theta' | y) p(y' | theta') = p(y' | y) p(theta' | y, y'),

so ``theta'`` is a draw of the posterior of both measurements together, too: among draws of that posterior its rank is
uniform, exactly, if the draws of the fit and those of the refit are what they should be. A refit of ``y'`` alone would
not do: its posterior has the prior where the truths have the posterior of ``y``.

Where sweeps differ, the same sweeps are measured again: curve and truth are those of the measured sweeps, as they were
sampled (`sma_bayes.fitting.mean_sweep`), and what a sweep has of its own is the same in both measurements. How the mean
over all sweeps differs from theirs is no part of that.

It judges the computation about this record: likelihood, simulation of measurements, draws. Whether the model describes
the record it can't tell; that is told by predictive checks.

References
----------
T. Säilynoja, M. Schmitt, P.-C. Bürkner, A. Vehtari, "Posterior SBC: simulation-based calibration checking conditional
on data", arXiv:2502.03279 (2025), doi:10.48550/arXiv.2502.03279.
"""

from __future__ import annotations

import csv
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sma_bayes.account import Account
from sma_bayes.arrays import Floats, Ints
from sma_bayes.assess.draws import RecordDraws
from sma_bayes.assess.held_out import own_of
from sma_bayes.assess.rank_uniformity import FALSE_ALARMS, places, rejected, uniformity
from sma_bayes.errors import OutputError, SmaBayesError, many
from sma_bayes.fitting.discrepancy import DiscrepancyBasis
from sma_bayes.fitting.mean_sweep import summing_to_zero
from sma_bayes.fitting.posterior import Posterior, Weights
from sma_bayes.fitting.sweep_functions import SWEEP, sweeps_of
from sma_bayes.limits import REPLICATES
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.progress import Progress, announce
from sma_bayes.records.types import Record
from sma_bayes.runs.fit_document import RankSummary, SelfCheckSummary
from sma_bayes.runs.jobs import by_the_clock, run
from sma_bayes.runs.store import write_csv
from sma_bayes.sampling.importance import WeightedDraws
from sma_bayes.sampling.weighted import resampled
from sma_bayes.studies.fit.common_shape import CommonShape, refitted
from sma_bayes.studies.options import FitOptions
from sma_bayes.studies.sensitivity.quantities import (
    QuantityDraws,
    quantities_of,
    stated_temperatures,
)
from sma_bayes.threads import one_thread

FOLDER: Final = "self_check"
DEFAULT_REPLICATES: Final = 1000
"""Replicates unless another number is asked for, or a record has many readings."""
READINGS_REFITTED: Final = 75_000
"""Readings of all replicates together from which there are fewer of these."""
FEWEST_OF_MANY_READINGS: Final = 250
"""Replicates of a record with however many readings; half a standard deviation is still seen."""
DRAWS: Final = 500
"""Draws of each refit, which tell whether it can be relied on."""
RANKED_DRAWS: Final = 100
"""Of these, drawn by their weights, those among which the place of a truth is told: it is uniform however few there
are, and what a fit reports of each takes as long as the refit."""
EVEN: Final = np.full(RANKED_DRAWS, -np.log(RANKED_DRAWS))
"""Logarithms of their weights."""
REPLICATES_PER_TASK: Final = 25
"""Replicates of one task."""
PILOT_REPLICATES: Final = 8
"""Further replicates, of no other account, whose refits tell the shape that all have in common."""
TIMED_REFITS: Final = 2
"""Refits of these that are made again with that shape, to tell what all will take."""
LEAST_REPLICATES: Final = 20
"""Replicates below which nothing is told."""
MAX_SHARE_LOST: Final = 0.05
"""Share of refits that may miss their target: what is left out might be what goes wrong."""


@dataclass(frozen=True, eq=False)
class ReplicateTask:
    """Some replicates of one record.

    Attributes
    ----------
    posterior : Posterior
        Of the record.
    theta : ndarray, shape (k, P)
        Truths.
    weights : Weights
        Of their discrepancies.
    sweeps : mapping of str to ndarray, shape (k, S, q)
        Channel to weights of what each sweep has of its own, where sweeps differ.
    start : ndarray, shape (D,)
        Where refits begin: the posterior median.
    at : tuple of float
        Temperatures at which a curve is told [unit of temperature].
    stiffness : bool
        Whether the fit gives a stiffness.
    seed : tuple of int
    common : CommonShape or None
        Of the posteriors of refits, once it is known.
    """

    posterior: Posterior
    theta: Floats
    weights: Weights
    start: Floats
    at: tuple[float, ...]
    stiffness: bool
    seed: tuple[int, ...]
    common: CommonShape | None = None
    sweeps: Mapping[str, Floats] = field(default_factory=dict)

    def first(self, count: int) -> ReplicateTask:
        """The first of the replicates."""
        few = slice(0, count)
        return replace(
            self,
            theta=self.theta[few],
            weights=tuple({c: w[few] for c, w in of.items()} for of in self.weights),
            sweeps={c: w[few] for c, w in self.sweeps.items()},
        )


@dataclass(frozen=True, slots=True, eq=False)
class RecordRanks:
    """Places of all truths of one record.

    Attributes
    ----------
    quantities : tuple of QuantityDraws
        What was looked at; draws are of no account.
    u : ndarray, shape (n, Q)
        Of the replicates whose refit reached its target.
    failed : int
        Those whose refit did not.
    """

    quantities: tuple[QuantityDraws, ...]
    u: Floats
    failed: int


def replicates_asked(self_check: bool | int) -> int:
    """How many replicates are asked for: none, `DEFAULT_REPLICATES`, or a number.

    Raises
    ------
    SmaBayesError
        If it is a number out of range.
    """
    if isinstance(self_check, bool):
        return DEFAULT_REPLICATES if self_check else 0
    if self_check and not LEAST_REPLICATES <= self_check <= REPLICATES.value:
        raise SmaBayesError(
            f"self_check={self_check}",
            expected=f"True, False, or a number of replicates from {LEAST_REPLICATES} to {REPLICATES.value:.0f}",
            remedy=f"leave it at True for {DEFAULT_REPLICATES}",
        )
    return self_check


def replicates_of(asked: bool | int, readings: int) -> int:
    """Replicates of a record with so many readings: the number that was asked for, else what takes about a minute.

    Examples
    --------
    >>> [replicates_of(True, n) for n in (28, 150, 10_000)]
    [1000, 500, 250]
    >>> replicates_of(400, 10_000)
    400
    """
    most = replicates_asked(asked)
    if asked is not True:
        return most
    return min(most, max(READINGS_REFITTED // readings, FEWEST_OF_MANY_READINGS))


def check_self_check(options: FitOptions, replicates: int) -> None:
    """Refuse, before anything is sampled, a self-check that tells nothing.

    Raises
    ------
    SmaBayesError
        If conditions share their parameters, or the noise is no density of the data.
    """
    if not replicates:
        return
    if options.pool != "none":
        raise SmaBayesError(
            f"--self-check with --pool {options.pool}",
            expected="parameters of their own for each condition: each record is checked by itself",
            remedy="leave --pool out, or --self-check",
        )
    if options.noise in NOISE_MODELS and not NOISE_MODELS[options.noise].is_density:
        raise SmaBayesError(
            f"--self-check with --noise {options.noise}",
            expected="a noise that is a density of the data, from which measurements can be simulated",
            remedy="leave --noise out, or name another one",
        )


def augmented(posterior: Posterior, observed: dict[str, Floats]) -> Posterior:
    """The posterior of a record and of another measurement (n,) of each channel at the same inputs, both together.

    Where sweeps differ both measurements of a sweep follow each other.
    """
    (record,) = posterior.records
    own = posterior.discrepancy[0].items()
    again = np.tile(np.arange(record.n), 2)
    inputs = {name: x[again] for name, x in record.inputs.items()}
    inputs["segment"][record.n :] += np.ptp(record.inputs["segment"]) + 1.0
    order = np.arange(again.size)
    if any(b.sweep_functions is not None for _, b in own):
        inputs[SWEEP] = sweeps_of(record.inputs)[again].astype(float)
        order = np.argsort(inputs[SWEEP], kind="stable")
    both: Record = replace(
        record,
        inputs={name: x[order] for name, x in inputs.items()},
        observed={c: np.concatenate([record.observed[c], observed[c]])[order] for c in record.channels},
        row=record.row[again][order],
    )
    bases = {
        c: DiscrepancyBasis(b.temperature, b.values, b.rows[:, again][:, order], own_of(b, both))
        for c, b in own
    }
    return posterior.on([both], discrepancy=[bases])


def tasks_of(draws: RecordDraws, stiffness: bool, replicates: int, seed: int) -> list[ReplicateTask]:
    """Replicates of one record, shared out; truths are taken evenly from its draws."""
    at = np.linspace(0, draws.size, replicates, endpoint=False).astype(int)
    return [
        _task(draws, stiffness, at[first : first + REPLICATES_PER_TASK], (seed, 12, first))
        for first in range(0, replicates, REPLICATES_PER_TASK)
    ]


def pilot_task(draws: RecordDraws, stiffness: bool, seed: int) -> ReplicateTask:
    """Replicates whose refits tell what those of all others are like."""
    at = np.linspace(0, draws.size, PILOT_REPLICATES, endpoint=False).astype(int)
    return _task(draws, stiffness, at, (seed, 13))


def _task(draws: RecordDraws, stiffness: bool, some: Ints, seed: tuple[int, ...]) -> ReplicateTask:
    posterior, theta = draws.posterior, draws.before_calibration
    weights: Weights = ({c: w[some] for c, w in draws.weights.items()},) if draws.weights else ()
    sweeps: dict[str, Floats] = {}
    own = (*seed, *draws.key.encode())
    if draws.measured_sweeps is not None:
        posterior, theta = summing_to_zero(posterior), draws.measured_sweeps
        rng = np.random.default_rng(np.random.SeedSequence([*own, 2]))
        weights = posterior.draw_discrepancy(rng, theta[some])
        sweeps = {
            c: posterior.draw_sweeps(rng, theta[some], 0, c, weights) for c in posterior.layout[0].between
        }
    start = np.median(posterior.space.unconstrain(theta), axis=0)
    at = stated_temperatures(draws)
    return ReplicateTask(posterior, theta[some], weights, start, at, stiffness, own, sweeps=sweeps)


def _refits(task: ReplicateTask) -> Iterator[tuple[Posterior, WeightedDraws, np.random.Generator]]:
    """Posterior of each replicate together with the record, draws of it, and a generator for what follows."""
    simulate_seed, *seeds = np.random.SeedSequence(task.seed).spawn(1 + len(task.theta))
    again = task.posterior.replicate(
        np.random.default_rng(simulate_seed), task.theta, weights=task.weights, sweeps=task.sweeps or None
    )
    for i, seed in enumerate(seeds):
        fit_seed, rank_seed = seed.spawn(2)
        both = augmented(task.posterior, {c: y[i] for c, y in again.items()})
        draws = refitted(both, task.start, both.space.prior_sd(), fit_seed, DRAWS, task.common)
        yield both, draws, np.random.default_rng(rank_seed)


def common_shape(task: ReplicateTask) -> CommonShape | None:
    """What the posteriors of refits have in common."""
    with one_thread(), np.errstate(all="ignore"):
        found = [draws for _, draws, _ in _refits(task)]
        return CommonShape.of(found, np.random.default_rng(np.random.SeedSequence([*task.seed, 1])))


@dataclass(frozen=True, slots=True, eq=False)
class FirstRefits:
    """What the first refits of a record tell of all others.

    Attributes
    ----------
    common : CommonShape or None
        See `common_shape`.
    seconds : float
        Processor time of a refit [s].
    """

    common: CommonShape | None
    seconds: float


def first_refits(task: ReplicateTask) -> FirstRefits:
    """The shape that refits have in common, and what a refit with it takes."""
    common = common_shape(task)
    return FirstRefits(common, seconds_of_a_refit(replace(task, common=common)))


def seconds_of_a_refit(task: ReplicateTask) -> float:
    """Processor time of a refit [s], by `TIMED_REFITS` of a task."""
    few = task.first(TIMED_REFITS)
    begun = time.process_time()
    ranked(few)
    return (time.process_time() - begun) / TIMED_REFITS


def ranked(task: ReplicateTask) -> RecordRanks:
    """Simulate, fit again and rank."""
    posterior = task.posterior
    with one_thread(), np.errstate(all="ignore"):
        found, quantities = [], None
        for i, (both, draws, rng) in enumerate(_refits(task)):
            if not draws.converged:
                continue
            z = draws.z[resampled(draws.log_weight, RANKED_DRAWS, rng)]
            theta = both.space.constrain(z)
            missed = both.draw_discrepancy(rng, theta)[0] if both.has_discrepancy else {}
            truth = task.weights[0] if task.weights else {}
            joined = RecordDraws(
                posterior,
                np.concatenate([task.theta[i : i + 1], theta]),
                True,
                {c: np.concatenate([truth[c][i : i + 1], w]) for c, w in missed.items()},
            )
            quantities = quantities_of(joined, task.at, stiffness=task.stiffness)
            found.append(places(np.stack([q.draws for q in quantities], axis=1), EVEN, rng))
    replicates = len(task.theta)
    if quantities is None:
        return RecordRanks((), np.empty((0, 0)), replicates)
    return RecordRanks(quantities, np.stack(found), replicates - len(found))


def summarised(ranks: RecordRanks, replicates: int) -> SelfCheckSummary:
    """What the ranks of one record say."""
    if len(ranks.u) < LEAST_REPLICATES:
        return SelfCheckSummary(
            replicates=replicates, failed=ranks.failed, false_alarm_rate=FALSE_ALARMS, passed=False
        )
    each = [uniformity(ranks.u[:, k]) for k in range(len(ranks.quantities))]
    wrong: NDArray[np.bool_] = rejected(np.array([one.p_values for one in each]))
    return SelfCheckSummary(
        replicates=replicates,
        failed=ranks.failed,
        false_alarm_rate=FALSE_ALARMS,
        passed=not wrong.any() and ranks.failed <= MAX_SHARE_LOST * replicates,
        quantities=tuple(
            RankSummary.about(
                q,
                shift=one.shift,
                spread=one.spread,
                p_location=one.p_values[0],
                p_spread=one.p_values[1],
                p_distribution=one.p_values[2],
                uniform=not bool(wrong[k].any()),
                coverage=one.coverage,
            )
            for k, (q, one) in enumerate(zip(ranks.quantities, each, strict=True))
        ),
    )


def checked(
    records: Sequence[tuple[RecordDraws, bool]],
    asked: bool | int,
    seed: int,
    folder: Path | None = None,
    jobs: int | None = None,
    account: Account | None = None,
    tell: Progress | None = None,
) -> Iterator[SelfCheckSummary]:
    """Check records, in their order; what a folder holds of an earlier call is read, not done again.

    Parameters
    ----------
    records : sequence of tuple of RecordDraws and bool
        Each with whether the fit gives a stiffness of it.
    asked : bool or int
        See `replicates_of`.
    seed : int
    folder : Path, optional
        Of the run: places are written to ``self_check/KEY.csv``, a row a replicate.
    jobs, account
        See `sma_bayes.runs.jobs.run`.
    tell : callable, optional
    """
    counts = [replicates_of(asked, draws.record.n) for draws, _ in records]
    shared = [
        tasks_of(draws, stiffness, n, seed) for (draws, stiffness), n in zip(records, counts, strict=True)
    ]
    paths = [None if folder is None else folder / FOLDER / f"{draws.key}.csv" for draws, _ in records]
    known = [
        None if path is None else _read(path, draws, tasks[0], n)
        for path, (draws, _), tasks, n in zip(paths, records, shared, counts, strict=True)
    ]
    open_ = [n for n, done in enumerate(known) if done is None]
    if tell is not None and open_:
        tell(0, sum(len(shared[n]) for n in open_), "self-check: first refits")
    first = list(
        run(
            first_refits,
            [pilot_task(*records[n], seed) for n in open_],
            jobs,
            account=account,
            stage="self_check",
        )
    )
    todo = [replace(t, common=f.common) for n, f in zip(open_, first, strict=True) for t in shared[n]]
    if tell is not None and open_:
        each = [len(t.theta) * f.seconds for n, f in zip(open_, first, strict=True) for t in shared[n]]
        total = many(sum(counts[n] for n in open_), "refit")
        announce(tell, by_the_clock(each, jobs), f"self-check of {many(len(open_), 'record')}, {total}")
    results = run(ranked, todo, jobs, account=account, stage="self_check")
    count = 0
    for (draws, _), tasks, done, path, n in zip(records, shared, known, paths, counts, strict=True):
        if done is None:
            parts = []
            for _ in tasks:
                parts.append(next(results))
                count += 1
                if tell is not None:
                    tell(count, len(todo), f"checking {draws.key}")
            done = _joined(parts)
            if path is not None:
                _write(path, done)
        yield summarised(done, n)


def _joined(parts: Sequence[RecordRanks]) -> RecordRanks:
    some = [p for p in parts if p.quantities]
    failed = sum(p.failed for p in parts)
    if not some:
        return RecordRanks((), np.empty((0, 0)), failed)
    return RecordRanks(some[0].quantities, np.concatenate([p.u for p in some]), failed)


def _write(path: Path, ranks: RecordRanks) -> None:
    path.parent.mkdir(exist_ok=True)
    lost = np.full((ranks.failed, ranks.u.shape[1]), np.nan)
    u = np.concatenate([ranks.u, lost])
    write_csv(path, {q.name: u[:, k] for k, q in enumerate(ranks.quantities)}, digits=17)


def read_places(folder: Path, key: str) -> tuple[tuple[str, ...], Floats]:
    """Names of the numbers of a record and places (n, Q) of their truths, as a folder holds them.

    Raises
    ------
    OutputError
        If the file is missing or damaged.
    """
    path = folder / FOLDER / f"{key}.csv"
    try:
        names, u = _table(path)
    except OSError as error:
        raise _damaged(path, error) from None
    return names, u[np.isfinite(u).all(axis=1)]


def _read(path: Path, draws: RecordDraws, task: ReplicateTask, replicates: int) -> RecordRanks | None:
    """What an earlier call wrote; None where there is nothing, or of another number of replicates."""
    if not path.is_file():
        return None
    names, u = _table(path)
    few = replace(draws.subset(slice(0, 2)), calibration={})
    quantities = quantities_of(few, task.at, stiffness=task.stiffness)
    if names != tuple(q.name for q in quantities) or len(u) != replicates:
        return None
    told = np.isfinite(u).all(axis=1)
    return RecordRanks(quantities, u[told], int(np.sum(~told)))


def _table(path: Path) -> tuple[tuple[str, ...], Floats]:
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = [*csv.reader(file)] or [[]]
    try:
        u = np.array([[float(cell or "nan") for cell in row] for row in rows], dtype=float)
        return tuple(header), u.reshape(len(rows), len(header))
    except ValueError as error:
        raise _damaged(path, error) from None


def _damaged(path: Path, error: Exception) -> OutputError:
    return OutputError(
        f"can't be read: {error}",
        file=path,
        expected="what --self-check wrote there",
        remedy="remove the file; --resume --self-check then makes it again",
    )
