"""Watching a spring: from the folder of a fit and files of new cycles to a verdict, and to a folder that remembers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Final

import numpy as np
from pydantic import Field

from sma_bayes.account import Account
from sma_bayes.arrays import Floats
from sma_bayes.errors import MeasurementError, SmaBayesError, many, require_seed
from sma_bayes.progress import Progress, silent
from sma_bayes.records.types import Record
from sma_bayes.report.choice import REPORT, figures_for
from sma_bayes.runs.declared_units import declared_parts, shown_units
from sma_bayes.runs.documents import FILES, WATCH, files_beside
from sma_bayes.runs.fit_document import RecordSummary
from sma_bayes.runs.output_folder import claimed_folder
from sma_bayes.runs.outputs import StoredRun, read_run
from sma_bayes.runs.store import write_csv
from sma_bayes.runs.stored_draws import draws_of
from sma_bayes.studies.identity import all_versions
from sma_bayes.studies.run_context import RunContext
from sma_bayes.studies.study_step import Checks, FromFitTable, StudyStep, Texts
from sma_bayes.studies.watch.evidence import log_evidence
from sma_bayes.studies.watch.reading import (
    FittedSweeps,
    NewFile,
    NewFileReader,
    chosen_condition,
    stored_declaration,
)
from sma_bayes.studies.watch.reference import Reference, reference_of
from sma_bayes.studies.watch.remaining import (
    LEAST_CYCLES,
    NOT_YET,
    WatchLimit,
    limit_of,
    remaining_cycles,
    require_known,
)
from sma_bayes.studies.watch.schema import WatchFindings
from sma_bayes.studies.watch.state import (
    CountedCycle,
    ReadFile,
    StrandNumbers,
    WatchState,
    empty,
    read_state,
    write_state,
)
from sma_bayes.studies.watch.verdict import csv_columns, judged
from sma_bayes.threads import one_thread

ALPHA: Final = 0.01
MOST_CYCLES: Final = 20_000
"""Most cycles of a watch."""


def watch(
    folder: str | Path,
    files: str | Path | Sequence[str | Path] = (),
    out: str | Path | None = None,
    *,
    condition: str | None = None,
    limit: Sequence[str] = (),
    alpha: float = ALPHA,
    campaign: str | Path | None = None,
    seed: int = 0,
    figures: str | bool = REPORT,
    progress: Progress | None = None,
    account: Account | None = None,
) -> dict[str, Any]:
    """Tell whether a spring is still the one that was fitted, from cycles measured since.

    Each sweep is the common curve of the fitted sweeps with four numbers, offset, stroke, shift and width, and what
    these leave. Each number has an e-process against all that is normal: the uncertainty of the fit, scatter from sweep
    to sweep, noise with a memory, errors of the thermometer. One that exceeds their number over `alpha` is an alarm,
    see `sma_bayes.studies.watch.evidence`.

    Parameters
    ----------
    folder : str or Path
        Output folder of `fit`.
    files : str, Path or sequence of these
        Files of new cycles, in the order in which they were measured. What was counted before is known again.
    out : str or Path, optional
        Folder for `watch.json`, what was counted (`state.json`), CSV files, tables, figures and the report. A watch
        that it holds goes on. Nothing is written without it.
    condition : str, optional
        The condition that the new cycles belong to; may be left out where the fit has one.
    limit : sequence of str
        Limits to which the remaining cycles are told: ``"stroke=-20%"``, ``"stiffness@60 degC=500 N/m"``.
    alpha : float
        Probability of an alarm, ever, while nothing changes, at most [1].
    campaign : str or Path, optional
        Campaign file by which new files are read; by default that of the fit.
    seed : int
        Decides the draws of cycles that remain.
    figures, progress, account
        See `fit_campaign`.

    Returns
    -------
    dict
        What `watch.json` holds.

    Raises
    ------
    SmaBayesError
        If an option makes no sense.
    MeasurementError, CampaignError, QuantityError
        If a file can't be used or is not of this campaign; nothing is counted then.
    OutputError, ResumeError
        If `folder` holds no finished fit, or `out` holds something else, such as a watch of another fit.
    """
    paths = [Path(files)] if isinstance(files, str | Path) else [Path(p) for p in files]
    with watching(
        folder, out, condition=condition, limit=limit, alpha=alpha, campaign=campaign, seed=seed,
        figures=figures, progress=progress, account=account,
    ) as opened:  # fmt: skip
        return opened.take(paths)


@contextmanager
def watching(
    folder: str | Path,
    out: str | Path | None = None,
    *,
    condition: str | None = None,
    limit: Sequence[str] = (),
    alpha: float = ALPHA,
    campaign: str | Path | None = None,
    seed: int = 0,
    figures: str | bool = REPORT,
    progress: Progress | None = None,
    account: Account | None = None,
) -> Iterator[Watch]:
    """Open a watch that takes files as they come; see `watch`."""
    require_seed(seed)
    if not 0.0 < alpha < 1.0:
        raise SmaBayesError(f"--alpha {alpha:g}", expected="a probability between 0 and 1")
    work = RunContext(WATCH, None, figures_for(figures), progress or silent, account or Account())
    run = read_run(Path(folder))
    chosen = chosen_condition([r.condition for r in run.summary.records], condition, run.folder)
    limits = [limit_of(text, _temperature_unit(run, chosen)) for text in limit]
    with one_thread():
        work.tell(0, 1, "finding the curve that the fitted sweeps have in common")
        with work.account.timed("reference"):
            reference, reader = _reference(run, chosen, None if campaign is None else Path(campaign), seed)
        for each in limits:
            require_known(each, reference.strands)
        place = None if out is None else Path(out).absolute()
        identity = {
            "schema": "sma-bayes/run/1",
            "kind": WATCH.verb,
            "fit": run.summary.numbers_sha256,
            "condition": chosen,
            "alpha": alpha,
            "seed": seed,
        }
        with nullcontext() if place is None else claimed_folder(place, identity, resume=True):
            series = tuple(f"{s.record.branch.value} {s.channel}" for s in reference.strands)
            state = empty(series) if place is None else read_state(place, series)
            own = None if campaign is None else reader.declared_in.absolute()
            yield Watch(run, chosen, reference, reader, own, limits, alpha, seed, place, work, state)


def _temperature_unit(run: StoredRun, condition: str) -> str:
    return next(r.temperature.unit for r in run.summary.records if r.condition == condition)


def _reference(
    run: StoredRun, condition: str, campaign: Path | None, seed: int
) -> tuple[Reference, NewFileReader]:
    summaries = [r for r in run.summary.records if r.condition == condition]
    records = [draws_of(run.folder, r, run.summary.seed).record for r in summaries]
    reference = reference_of(records, {r.key: r.model for r in summaries}, seed)
    content, name = stored_declaration(run.folder, run.summary.source, campaign)
    fitted = {r.branch.value: FittedSweeps(r) for r in records}
    return reference, NewFileReader(content, name, condition, fitted)


@dataclass(slots=True, eq=False)
class Watch:
    """A watch under way.

    Attributes
    ----------
    run : StoredRun
    condition : str
    reference : Reference
    reader : NewFileReader
    campaign : Path or None
        File by which new files are read, where it is not that of the fit.
    limits : list of WatchLimit
    alpha : float
    seed : int
    out : Path or None
    work : RunContext
    state : WatchState
        What counts so far; the one thing that changes.
    """

    run: StoredRun
    condition: str
    reference: Reference
    reader: NewFileReader
    campaign: Path | None
    limits: list[WatchLimit]
    alpha: float
    seed: int
    out: Path | None
    work: RunContext
    state: WatchState

    def take(self, paths: Sequence[Path]) -> dict[str, Any]:
        """Count the new cycles of some files, write what is known then, and return what `watch.json` holds.

        Raises
        ------
        MeasurementError, CampaignError, QuantityError
            If a file can't be used; none of them is counted then.
        """
        with self.work.account.timed("read"):
            read = [self.reader.read(p) for p in paths]
        for n, file in enumerate(read):
            self.work.tell(n, len(read), f"read {file.path.name}")
            with self.work.account.timed("evidence"):
                self.count(file)
            if self.out is not None:
                write_state(self.out, self.state)
        return self.conclude()

    def count(self, file: NewFile) -> None:
        """Count the cycles of a file that were not counted before."""
        known = self.state.counted()
        fresh = [c for c in file.cycles if c.sha256 not in known]
        total = len(self.state.cycles) + len(fresh)
        if total > MOST_CYCLES:
            raise MeasurementError(
                f"{total} cycles", file=file.path, expected=f"at most {MOST_CYCLES} of a watch",
                remedy="fit the latest cycles, and watch from there",
            )  # fmt: skip
        swept = [tuple(self.reference.measure(c.sweeps)) for c in fresh]
        evidence = self._evidence(swept)
        added = tuple(
            CountedCycle(
                file=file.path.name, cycle=c.cycle, sha256=c.sha256, sweeps=s, log_evidence=tuple(e.tolist())
            )
            for c, s, e in zip(fresh, swept, evidence, strict=True)
        )
        told = ReadFile.about(
            file, name=file.path.name, counted=len(fresh), repeated=len(file.cycles) - len(fresh)
        )
        if self.state.file(file.sha256) is None:
            files = (*self.state.files, told)
        else:
            again = {"repeated": len(file.cycles)}
            files = tuple(
                f.model_copy(update=again) if f.sha256 == file.sha256 else f for f in self.state.files
            )
        self.state = self.state.but(files=files, cycles=(*self.state.cycles, *added))

    def _evidence(self, fresh: Sequence[tuple[StrandNumbers, ...]]) -> Floats:
        """Evidence after each of some new cycles."""
        later = [*(c.sweeps for c in self.state.cycles), *fresh]
        return log_evidence(self.reference.watched(later), len(later) - len(fresh))

    def later(self) -> list[tuple[StrandNumbers, ...]]:
        """Numbers of all watched cycles, by strand."""
        return [c.sweeps for c in self.state.cycles]

    @property
    def alarmed(self) -> bool:
        """Whether the evidence was enough with any cycle so far."""
        return any(
            max(c.log_evidence) >= np.log(self.reference.series / self.alpha) for c in self.state.cycles
        )

    def conclude(self) -> dict[str, Any]:
        """What is known now, written to the folder."""
        with self.work.account.timed("verdict"):
            found = self._found()
        if self.out is None:
            return self.work.with_account(found.as_json())
        with self.work.account.timed("write"):
            for name, columns in csv_columns(found).items():
                write_csv(self.out / name, columns)
        return self.work.end(self.out, {**found.as_json(), FILES: files_beside(self.out)})

    def _found(self) -> WatchFindings:
        later = self.later()
        verdict = judged(self.reference, later, self.state, self.alpha, shown_units(self._own()))
        limits = remaining_cycles(self.reference, later, self.limits, verdict.begins, self.seed)
        summary = self.run.summary
        settled = all(s.converged for s in self.reference.strands)
        converged = bool(summary.converged and settled)
        return WatchFindings.about(
            self,
            schema="sma-bayes/watch/1",
            campaign=summary.campaign,
            fit=str(self.run.folder),
            temperature_unit=_temperature_unit(self.run, self.condition),
            specimen=self.reference.strands[0].record.specimen,
            **declared_parts(self._own()),
            versions=all_versions(),
            converged=converged,
            **dict(verdict.found),
            asked=tuple(dict.fromkeys(limit.asked for limit in self.limits)),
            declared_in="" if self.campaign is None else str(self.campaign),
            limits=tuple(limits),
            files=self.state.files,
            partial=tuple(self._partial()),
            remarks=(*self.reference.remarks, *self._remarks()),
            exit_status=0 if converged and verdict.found.alarm is None else 1,
        )

    def _own(self) -> list[RecordSummary]:
        """Fitted records of the condition."""
        return [r for r in self.run.summary.records if r.condition == self.condition]

    def _partial(self) -> list[str]:
        """Of the latest content of each file."""
        latest = {f.name: f for f in self.state.files}
        return [text for f in latest.values() for text in f.partial]

    def _remarks(self) -> list[str]:
        latest = {f.name: f for f in self.state.files}
        out = [text for f in latest.values() for text in f.remarks]
        repeated = sum(f.repeated for f in self.state.files)
        if repeated:
            out.append(
                f"{many(repeated, 'cycle')} came again in the same or in grown files, and counted once"
            )
        unsettled = [s.record.key for s in self.reference.strands if not s.converged]
        out += [
            f"{key}: the common curve of the fitted sweeps has not settled"
            for key in dict.fromkeys(unsettled)
        ]
        if self.limits and self.reference.fitted + len(self.state.cycles) < LEAST_CYCLES:
            out.append(NOT_YET)
        return out


class WatchTable(FromFitTable):
    """``[watch]``: whether cycles measured since are of the spring that was fitted."""

    paths: ClassVar[tuple[str, ...]] = ("files",)
    files: Texts = Field(min_length=1)
    condition: str | None = None
    limit: Texts = ()
    alpha: float = Field(default=ALPHA, gt=0.0, lt=1.0)


def _questions(o: Mapping[str, Any], record: Record) -> Checks:
    for number, text in enumerate(o["limit"], start=1):
        yield f"limit, entry {number}", partial(limit_of, text, record.units["temperature"])


STEP: Final = StudyStep(WatchTable, WATCH, watch, lambda found: str(found["statement"]), questions=_questions)
