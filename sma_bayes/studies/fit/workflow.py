"""Fitting a campaign, in memory or into a folder."""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pydantic import Field, model_validator

from sma_bayes.account import Account
from sma_bayes.assess.correlation_average import Averages
from sma_bayes.assess.draws import record_draws
from sma_bayes.assess.loops import QuantityInterval
from sma_bayes.errors import SmaBayesError, many
from sma_bayes.fitting.fit import Fit
from sma_bayes.fitting.fit_records import AUTO
from sma_bayes.limits import DEGREES
from sma_bayes.parameters.priors_file import PriorSet
from sma_bayes.progress import Progress, announce, lines_inside, silent
from sma_bayes.records.campaign import read_campaign
from sma_bayes.records.declaration import CAMPAIGN_FILE
from sma_bayes.records.plausibility import doubted_conditions
from sma_bayes.records.types import Campaign, Record
from sma_bayes.report.choice import REPORT, figures_for
from sma_bayes.response import DEFAULT_MODEL
from sma_bayes.response.arrangement import ArrangedSpring
from sma_bayes.runs.documents import FIT
from sma_bayes.runs.fit_document import (
    FitFindings,
    FitSummary,
    OptionsSummary,
    RecordSummary,
    read_fit,
)
from sma_bayes.runs.jobs import run
from sma_bayes.runs.output_folder import claimed_folder
from sma_bayes.runs.schema import CorrelationAverage
from sma_bayes.runs.store import write_file, write_text
from sma_bayes.runs.stored_draws import draws_of
from sma_bayes.studies.fit.chains import remove_chains
from sma_bayes.studies.fit.fitted import Fits, by_record, shown_progress
from sma_bayes.studies.fit.parts import remove_parts
from sma_bayes.studies.fit.self_check import check_self_check, checked, replicates_asked
from sma_bayes.studies.fit.tasks import expected_s, fitted, has_files, sample_task, tasks_of
from sma_bayes.studies.identity import of_campaign, run_identity
from sma_bayes.studies.options import (
    DEFAULT_SAMPLER,
    FitOptions,
    Pool,
    bias_spring,
    check_call,
    groups_of,
    models_of,
    plan_with,
    prior_set,
)
from sma_bayes.studies.run_context import RunContext
from sma_bayes.studies.study_step import StepTable, StudyStep

if TYPE_CHECKING:
    from sma_bayes.records.memory import Measurements

LOG: Final = logging.getLogger("sma_bayes")


def fit(
    data: str | Path | Campaign | Measurements,
    *,
    seed: int = 0,
    noise: str = AUTO,
    priors: str | Path | PriorSet | None = None,
    model: str = DEFAULT_MODEL,
    pool: Pool = "none",
    sampler: str = DEFAULT_SAMPLER,
    jobs: int | None = None,
    columns: Mapping[str, Mapping[str, Any]] | None = None,
    conditions: Mapping[str, Mapping[str, float]] | None = None,
    self_check: bool | int = False,
    progress: bool | Progress = False,
) -> Fits:
    """Fit every record of a file, a campaign, a data frame or arrays, in memory.

    Parameters
    ----------
    data : str, Path, Campaign, frame, or mapping of str to frame
        A data file, or a folder or campaign file, see `read_campaign`, or what that gives; or a data frame or a mapping
        of column names to arrays, or several by the ids of their conditions, see `campaign_of`.
    seed : int
        Seed of all random draws.
    noise : str
        Name of a noise model, or ``auto``: chosen from the residuals of the warm start.
    priors : str, Path or PriorSet, optional
        Name of a shipped set or of a model, or path of a priors file; those of the model by default.
    model : str
        Name of a response model.
    pool : {'none', 'campaign'}
        With ``campaign`` one set of A and B a branch serves all conditions.
    sampler : str
        ``independence``, or to cross-check it ``de`` (differential evolution) or ``stretch``, which take hundreds of
        times as long.
    jobs : int, optional
        Processes; by default one for each core.
    columns, conditions : mapping, optional
        Of data in memory: what ``[columns]`` and ``[[condition]]`` of a campaign file say, see `campaign_of`.
    self_check : bool or int
        Whether to simulate measurements from each posterior, fit them again, and look whether intervals hold the truths
        (posterior simulation-based calibration, see `sma_bayes.studies.fit.self_check`); or how many.
    progress : bool or callable
        True for a bar in a notebook or terminal; or what is called with the number of posteriors that are done, of all,
        and a message, ``progress(done, total, message)``. The logger ``sma_bayes`` is told the same.

    Returns
    -------
    Fits
        A dictionary of `RecordFit` by the key of the record, ``<condition>-<branch>``. Pooled records share draws.
    """
    campaign = _campaign(data, columns, conditions)
    options = FitOptions(prior_set(priors, model), seed, noise, pool, plan=plan_with(sampler), model=model)
    groups = groups_of(campaign, pool)
    replicates = replicates_asked(self_check)
    check_self_check(options, replicates)
    check_call(groups, options)
    tasks = tasks_of(groups, options, None, doubted=doubted_conditions(campaign.findings))
    fits: list[Fit] = []
    with shown_progress(progress, len(tasks)) as tell:
        for found in run(sample_task, tasks, jobs):
            fits.append(found)
            state = "" if found.converged else " (NOT CONVERGED)"
            message = f"sampled {', '.join(r.key for r in found.records)}{state}"
            tell(len(fits), len(tasks), message)
            LOG.info("%d of %d: %s", len(fits), len(tasks), message)
    found_fits = by_record(fits)
    if not replicates:
        return found_fits
    records = [
        (record_draws(f, f.index), bool(f.summarised.quantities_of_branch)) for f in found_fits.values()
    ]
    ranks = checked(records, self_check, seed, jobs=jobs)
    return Fits({
        key: replace(f, self_check=one) for (key, f), one in zip(found_fits.items(), ranks, strict=True)
    })  # fmt: skip


def _campaign(
    data: str | Path | Campaign | Measurements,
    columns: Mapping[str, Mapping[str, Any]] | None,
    conditions: Mapping[str, Mapping[str, float]] | None,
) -> Campaign:
    """The campaign that was given, read from files, or made of what is in memory; see `fit`."""
    if not isinstance(data, str | Path | Campaign):
        from sma_bayes.records.memory import campaign_of

        return campaign_of(data, columns=columns, conditions=conditions)
    if columns is not None or conditions is not None:
        raise SmaBayesError(
            "columns or conditions beside a campaign",
            expected="them with data in memory only; a campaign has its own",
        )
    return data if isinstance(data, Campaign) else read_campaign(data)


def fit_campaign(
    campaign: Campaign,
    out: str | Path,
    *,
    seed: int = 0,
    noise: str = AUTO,
    priors: str | Path | PriorSet | None = None,
    model: str = DEFAULT_MODEL,
    pool: Pool = "none",
    sampler: str = DEFAULT_SAMPLER,
    jobs: int | None = None,
    extrapolate: float = 0.0,
    bias: ArrangedSpring | None = None,
    resume: bool = False,
    figures: str | bool = REPORT,
    self_check: bool | int = False,
    progress: Progress | None = None,
    account: Account | None = None,
) -> dict[str, Any]:
    """Fit every record of a campaign and write posteriors, bands, tables, figures and the report.

    Parameters
    ----------
    campaign, seed, noise, priors, model, pool, sampler, jobs
        See `fit`.
    out : str or Path
        Folder for the results. It must be new or empty, unless `resume` is set and it holds the same run.
    extrapolate : float
        How far bands go beyond the observed temperatures [unit of temperature]; what lies there is marked.
    bias : ArrangedSpring, optional
        Bias spring; the stiffness of both springs together gets bands of its own, Eq. (8).
    resume : bool
        Go on with a run that was interrupted. The result is the same to the bit.
    figures : str or bool
        ``report`` (those that the report shows), ``all`` or ``none`` (no report either), see `figures_for`.
    self_check : bool or int
        Whether to simulate measurements from each posterior, fit them again, and look whether intervals hold the truths
        (posterior simulation-based calibration, see `sma_bayes.studies.fit.self_check`); or how many.
        A finished run gets it, too, with `resume`.
    progress : callable, optional
    account : Account, optional
        Account to go on with, such as one in which the reading was timed.

    Returns
    -------
    dict
        What `summary.json` holds.

    Raises
    ------
    OutputError
        If `out` can't be written or holds something else.
    ResumeError
        If `out` holds a run with other data, priors, options or versions.
    """
    folder = Path(out).absolute()  # workers of a cluster stand elsewhere
    options = FitOptions(
        prior_set(priors, model),
        seed,
        noise,
        pool,
        extrapolate,
        plan=plan_with(sampler),
        bias=bias,
        model=model,
    )
    work = RunContext(FIT, jobs, figures_for(figures), progress or silent, account or Account())
    groups = groups_of(campaign, pool)
    replicates = replicates_asked(self_check)
    check_self_check(options, replicates)
    check_call(groups, options)
    with claimed_folder(folder, run_identity(campaign, options), resume):
        earlier = _finished(folder, campaign)
        if earlier is None:
            records, averages, loops = _fitted(
                groups, options, folder, work, doubted_conditions(campaign.findings)
            )
        else:
            records, averages, loops = earlier.records, earlier.correlation_average, earlier.loops
        if replicates:
            records = _checked(records, self_check, seed, folder, work)
    if earlier is not None and records == earlier.records:
        stated = work.earlier(folder)
        _tidy(folder, groups, records)
        return stated
    with work.account.timed("write"):
        write_text(folder / "priors.toml", options.priors.whole_text)
        if campaign.declaration:
            write_file(folder / CAMPAIGN_FILE, lambda place: place.write_bytes(campaign.declaration))
    summary = FitFindings(
        schema="sma-bayes/fit/1",
        **of_campaign(campaign, seed),
        options=OptionsSummary.about(
            options, sampler=sampler, priors=options.priors.title, bias_spring=options.bias
        ),
        converged=all(r.converged for r in records),
        adequate=all(r.adequate for r in records),
        records=records,
        correlation_average=averages,
        loops=loops,
    )
    if campaign.data_dir:
        summary = summary.but(data_dir=campaign.data_dir)
    stated = work.end(folder, summary.as_json())
    _tidy(folder, groups, records)
    return stated


def _finished(folder: Path, campaign: Campaign) -> FitSummary | None:
    """What an earlier call has found, where that and all files of its records are there."""
    there = (folder / FIT.file).is_file() and all(has_files(folder, r) for r in campaign.records)
    return read_fit(folder) if there else None


def _tidy(folder: Path, groups: Sequence[tuple[Record, ...]], records: Sequence[RecordSummary]) -> None:
    """Remove what the summary holds as well, and chains that are soon made again."""
    remove_parts(folder)
    remove_chains(folder, groups, {r.key: r.log_likelihood_evaluations for r in records})


def _checked(
    records: Sequence[RecordSummary], asked: bool | int, seed: int, folder: Path, work: RunContext
) -> tuple[RecordSummary, ...]:
    """Entries of records with what their self-check says; its ranks are written to the folder."""
    draws = [(draws_of(folder, r, seed), bool(r.quantities_of_branch)) for r in records]
    found = checked(draws, asked, seed, folder, work.jobs, work.account, work.tell)
    return tuple(r.but(self_check=one) for r, one in zip(records, found, strict=True))


def _to_do(groups: Sequence[tuple[Record, ...]], options: FitOptions) -> str:
    """What is told before records are fitted: of several curves each is fitted, which takes several times as long."""
    curves = len(models_of(groups[0], options)) if groups else 1
    return "sampling" if curves == 1 else f"choosing among {curves} curves a record, and sampling"


def _fitted(
    groups: Sequence[tuple[Record, ...]],
    options: FitOptions,
    folder: Path,
    work: RunContext,
    doubted: Collection[str],
) -> tuple[tuple[RecordSummary, ...], tuple[CorrelationAverage, ...], tuple[QuantityInterval, ...]]:
    """Records, average correlation factors and loops of the summary; draws are let go as soon as they are averaged."""
    total = sum(len(group) for group in groups)
    to_do = _to_do(groups, options)
    announce(work.tell, expected_s(groups, options, work.jobs), f"{many(total, 'record')}, {to_do}")
    work.tell(0, total, to_do)
    records: list[RecordSummary] = []
    loops: list[QuantityInterval] = []
    averages = {"measured": Averages(), "replicated": Averages()}
    for part in fitted(groups, options, folder, work.jobs, work.account, lines_inside(work.tell), doubted):
        records += part.records
        loops += part.loops
        for scored in part.scored:
            averages[scored.data].add(scored)
        work.account.take(part.account.document())
        if not part.records:
            continue
        lost = f" ({len(work.account.lost)} workers lost)" if work.account.lost else ""
        work.tell(len(records), total, f"sampled {', '.join(r.key for r in part.records)}{lost}")
    averaged = tuple(
        CorrelationAverage(data=data, **entry)
        for data, found in averages.items()
        for entry in found.entries()
    )
    return tuple(records), averaged, tuple(loops)


class FitTable(StepTable):
    """``[fit]``; a bias spring where `arrangement` names one [N/m]."""

    noise: str | None = None
    sampler: str = DEFAULT_SAMPLER
    extrapolate: float = Field(default=0.0, ge=0.0, le=DEGREES.value)
    arrangement: str | None = None
    self_check: bool = False
    bias: float | None = Field(default=None, gt=0.0)
    bias_sd: float | None = Field(default=None, ge=0.0)

    @model_validator(mode="after")
    def _consistent(self) -> FitTable:
        if self.arrangement is None and (self.bias is not None or self.bias_sd is not None):
            raise ValueError("an arrangement beside bias and bias_sd")
        return self


def _fit_declared(
    campaign: Campaign,
    *,
    arrangement: str | None = None,
    bias: float | None = None,
    bias_sd: float | None = None,
    seed: int,
    jobs: int | None,
    resume: bool,
    **options: Any,
) -> dict[str, Any]:
    spring = bias_spring(arrangement, bias, bias_sd)
    return fit_campaign(campaign, bias=spring, seed=seed, jobs=jobs, resume=resume, **options)


def _told(found: Mapping[str, Any]) -> str:
    good, adequate = (sum(r[word] for r in found["records"]) for word in ("converged", "adequate"))
    return f"{good} of {len(found['records'])} records converged, {adequate} adequate"


STEP: Final = StudyStep(
    FitTable,
    FIT,
    _fit_declared,
    _told,
    lambda o: [
        ("sampler", partial(plan_with, o["sampler"])),
        ("arrangement", partial(bias_spring, o.get("arrangement"), o.get("bias"), o.get("bias_sd"))),
    ],
)
