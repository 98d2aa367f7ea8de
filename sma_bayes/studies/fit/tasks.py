"""What is done for the records of a fit: sample, assess, write. Each task stands for itself, wherever it is done."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sma_bayes.account import Account
from sma_bayes.assess.bands import band_channels, credible_band, overall_band
from sma_bayes.assess.correlation import correlation_factors
from sma_bayes.assess.correlation_average import Scored
from sma_bayes.assess.loops import QuantityInterval, loop_quantities
from sma_bayes.checksum import file_checksum
from sma_bayes.errors import OutputError, SmaBayesError
from sma_bayes.fitting.fit import Fit
from sma_bayes.fitting.fit_records import fit_records
from sma_bayes.progress import lines_about
from sma_bayes.records.types import Branch, Record
from sma_bayes.response import AUTO_MODEL
from sma_bayes.runs.documents import RUN_MARKER
from sma_bayes.runs.fit_document import RecordSummary
from sma_bayes.runs.jobs import by_the_clock, run
from sma_bayes.runs.outputs import band_path
from sma_bayes.runs.store import write_csv, write_posterior
from sma_bayes.sampling.moves import SAMPLERS
from sma_bayes.studies.fit.chains import chain_path
from sma_bayes.studies.fit.parts import Part, part_path, read_part, write_part
from sma_bayes.studies.fit.summary import record_summary
from sma_bayes.studies.options import DEFAULT_SAMPLER, FitOptions, models_of, plan_for

CONDITION_TASKS_FROM = 20
"""Number of conditions from which on a task is a condition with its branches. With fewer, a branch is a task: that
keeps more processes busy, but sends all draws to the process that joins the branches."""

LONG_RECORD_S = 10.0
"""Expected time from which a record gets a process at once [s]. Of fewer samples many take a tenth of what is expected,
less than two processes take to start: two of 200 took 4.1 s of processor time here, 6.8 s on processes."""
RECORD_S, CURVE_S, SAMPLES_S = 0.1, 1.0, 2e-4
"""Processor time of a record: a constant, that of a curve where several are tried, and what grows with the square of
its samples, since the more there are the richer is the noise that they ask for [s]. Fifteen fits of real and simulated
campaigns, 28 to 400 samples a record, that took more than ten seconds did so within a factor of three."""


@dataclass(frozen=True, eq=False)
class FitTask:
    """Records that share a posterior, and where to write; without a folder nothing is written.

    Where `lines` is a number of seconds, a record that takes longer tells of its steps by log lines that often. Of
    records that are `doubted` (see `doubted_conditions`) less is tried.
    """

    records: tuple[Record, ...]
    options: FitOptions
    folder: Path | None
    lines: float | None = None
    doubted: bool = False

    @property
    def light(self) -> bool:
        """Whether it is not expected to be worth a process of its own."""
        o = self.options
        plain = o.plan.sampler == SAMPLERS[DEFAULT_SAMPLER] and o.model != AUTO_MODEL
        return plain and _alone_s(self.records, o) <= LONG_RECORD_S


@dataclass(frozen=True, eq=False)
class _Assessed:
    fit: Fit
    summaries: list[RecordSummary]
    scored: list[Scored]
    account: Account


def sample_task(task: FitTask) -> Fit:
    """Sample one posterior."""
    o = task.options
    checkpoint = chain_path(task.folder or Path(), task.records)
    return fit_records(
        task.records,
        o.priors,
        ladder=models_of(task.records, o),
        noise=o.noise,
        seed=o.seed,
        plan=plan_for(o, task.records),
        doubted=task.doubted,
        checkpoint=None if task.folder is None else checkpoint,
        progress=None if task.lines is None else lines_about(checkpoint.stem, task.lines),
    )


def tasks_of(
    groups: Iterable[tuple[Record, ...]],
    options: FitOptions,
    folder: Path | None,
    lines: float | None = None,
    doubted: Collection[str] = (),
) -> list[FitTask]:
    """A task for each group of records; one is doubted where all of its conditions are."""
    return [
        FitTask(group, options, folder, lines, all(r.condition.id in doubted for r in group))
        for group in groups
    ]


def expected_s(groups: Sequence[tuple[Record, ...]], options: FitOptions, jobs: int | None) -> float:
    """What fits are expected to take by the clock, within a factor of three [s].

    Parameters
    ----------
    groups : sequence of tuple of Record
        Records that share a posterior each.
    options : FitOptions
        Of several curves each is fitted.
    jobs : int, optional
        See `run`.
    """
    return by_the_clock([_alone_s(group, options) for group in groups], jobs)


def _alone_s(group: Sequence[Record], options: FitOptions) -> float:
    """What one fit is expected to take by itself [s]."""
    curves, samples = len(models_of(group, options)), sum(r.n for r in group)
    constant = CURVE_S if curves > 1 else RECORD_S
    return curves * (constant + SAMPLES_S * samples**2)


def fitted(
    groups: Sequence[tuple[Record, ...]],
    options: FitOptions,
    folder: Path,
    jobs: int | None,
    account: Account,
    lines: float | None = None,
    doubted: Collection[str] = (),
) -> Iterator[Part]:
    """Fit groups of records that share a posterior each, and write what was found.

    Parameters
    ----------
    groups : sequence of tuple of Record
    options : FitOptions
    folder : Path
        That holds the mark of the run, `RUN_MARKER`.
    jobs : int, optional
        See `run`.
    account : Account
        Told of workers that were lost; the stages come with the parts.
    lines : float, optional
        See `FitTask`.
    doubted : collection of str
        Ids of conditions, see `doubted_conditions`.

    Yields
    ------
    Part
        In the order of the groups where each group is one record, else all at once.
    """
    tasks = tasks_of(groups, options, folder, lines, doubted)
    conditions = _by_condition(tasks)
    if options.pool == "none":
        parts = _by_whole_conditions if len(conditions) >= CONDITION_TASKS_FROM else _record_by_record
        yield from parts(conditions, folder, jobs, account)
        return
    assessed = []
    for found in run(_assess_task, tasks, jobs, account=account, light=all(t.light for t in tasks)):
        assessed.append(found.fit)
        yield Part(found.summaries, [], found.scored, found.account)
    yield Part([], _loops(assessed), [])


def _by_condition(tasks: Iterable[FitTask]) -> dict[str, tuple[FitTask, ...]]:
    found: dict[str, tuple[FitTask, ...]] = {}
    for task in tasks:
        name = task.records[0].condition.id
        found[name] = (*found.get(name, ()), task)
    return found


def _record_by_record(
    conditions: dict[str, tuple[FitTask, ...]], folder: Path, jobs: int | None, account: Account
) -> Iterator[Part]:
    """Records one by one, so that few of them keep all processes busy; a condition is kept when all of it is told."""
    finished, todo = _unfinished(conditions, folder)
    light = all(t.light for tasks in conditions.values() for t in tasks)
    found = run(_assess_task, [t for tasks in todo for t in tasks], jobs, account=account, light=light)
    for name, tasks in conditions.items():
        if name in finished:
            yield read_part(folder, name)
            continue
        assessed = []
        for _ in tasks:
            one = next(found)
            assessed.append(one)
            yield Part(one.summaries, [], one.scored, one.account)
        part = _part_of(assessed)
        write_part(folder, name, part)
        yield Part([], part.loops, [])


def _by_whole_conditions(
    conditions: dict[str, tuple[FitTask, ...]], folder: Path, jobs: int | None, account: Account
) -> Iterator[Part]:
    """Conditions one by one; those that an earlier call has finished are read, not done again."""
    finished, todo = _unfinished(conditions, folder)
    light = all(t.light for tasks in conditions.values() for t in tasks)
    found = run(_condition_task, todo, jobs, account=account, light=light)
    for name in conditions:
        yield read_part(folder, name) if name in finished else next(found)


def _unfinished(
    conditions: dict[str, tuple[FitTask, ...]], folder: Path
) -> tuple[set[str], list[tuple[FitTask, ...]]]:
    """Conditions that an earlier call has finished, and the tasks of each other one."""
    finished = {name for name, tasks in conditions.items() if _is_finished(folder, name, tasks)}
    return finished, [tasks for name, tasks in conditions.items() if name not in finished]


def _condition_task(tasks: tuple[FitTask, ...]) -> Part:
    """All branches of one condition."""
    part = _part_of([_assess_task(task) for task in tasks])
    if tasks[0].folder is not None:
        write_part(tasks[0].folder, tasks[0].records[0].condition.id, part)
    return part


def _part_of(assessed: Sequence[_Assessed]) -> Part:
    """What a summary says of all branches of one condition."""
    account = Account()
    for a in assessed:
        account.take(a.account.document())
    with account.timed("diagnose"):
        loops = _loops([a.fit for a in assessed])
    return Part(
        [s for a in assessed for s in a.summaries], loops, [s for a in assessed for s in a.scored], account
    )


def _is_finished(folder: Path, condition: str, tasks: Iterable[FitTask]) -> bool:
    own = all(has_files(folder, record) for task in tasks for record in task.records)
    return own and part_path(folder, condition).is_file()


def has_files(folder: Path, record: Record) -> bool:
    """Whether a folder has the posterior and all bands of a record."""
    bands = (folder / "bands" / f"{record.key}-{c}.csv" for c in band_channels(record))
    return all(path.is_file() for path in (folder / "posterior" / f"{record.key}.nc", *bands))


def _assess_task(task: FitTask) -> _Assessed:
    """Sample, assess and write one posterior."""
    if task.folder is None:
        raise SmaBayesError("no folder to write to")
    if not (task.folder / RUN_MARKER).is_file():
        raise OutputError(
            "is not the folder of the run, as seen by a worker",
            file=task.folder,
            expected="a folder that all workers see under the same path",
            remedy="name a folder on a shared disk as --out",
        )
    found = sample_task(task)
    account = Account()
    account.take(found.account.document())
    summaries: list[RecordSummary] = []
    scored: list[Scored] = []
    for i, record in enumerate(found.records):
        own = Account()
        summary, agreements = _assess_record(found, i, record, task, task.folder, own)
        account.take(own.document())
        summaries.append(
            summary.but(
                stages_s={**summary.stages_s, **own.wall},
                stages_cpu_s={**summary.stages_cpu_s, **own.cpu},
                wall_s=(summary.wall_s or 0.0) + sum(own.wall.values()),
            )
        )
        scored += agreements
    return _Assessed(found, summaries, scored, account)


def _assess_record(
    found: Fit, i: int, record: Record, task: FitTask, folder: Path, account: Account
) -> tuple[RecordSummary, list[Scored]]:
    options = task.options
    with account.timed("diagnose"):
        rng = np.random.default_rng(np.random.SeedSequence([options.seed, 4, *record.key.encode()]))
        replicated = found.posterior.replicate(rng, found.flat, record=i, weights=found.discrepancy)
        measured, again = correlation_factors(found, replicated, i)
        summary = record_summary(found, i, measured, again)
    with account.timed("bands"):
        bands = {c: credible_band(found, c, i, options.extrapolate) for c in band_channels(record)}
        if options.bias is not None:
            overall = overall_band(found, options.bias, i, options.extrapolate)
            bands |= {} if overall is None else {"overall_stiffness": overall}
    with account.timed("write"):
        path = folder / "posterior" / f"{record.key}.nc"
        write_posterior(path, found, i, replicated)
        summary = summary.but(posterior_sha256=file_checksum(path))
        written = {}
        for channel, band in bands.items():
            place = band_path(folder, record.key, channel)
            write_csv(place, band.columns(record.units["temperature"]))
            written[channel] = file_checksum(place)
        summary = summary.but(band_sha256=written)
    return summary, [
        Scored(
            record.key,
            record.branch.value,
            channel,
            record.quantity(channel),
            record.units[channel],
            found.records[0].key,
            found.converged,
            agreement,
            data,
        )
        for data, agreements in (("measured", measured), ("replicated", again))
        for channel, agreement in agreements.items()
    ]


def _loops(fits: Sequence[Fit]) -> list[QuantityInterval]:
    place = {r.key: (f, i) for f in fits for i, r in enumerate(f.records)}
    out = []
    for key, (heating, i) in place.items():
        record = heating.records[i]
        other = f"{record.condition.id}-{Branch.COOLING.value}"
        if record.branch is Branch.HEATING and other in place and key != other:
            cooling, j = place[other]
            out += loop_quantities(heating, cooling, (i, j))
    return out
