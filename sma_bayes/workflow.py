"""The public functions, in the order in which a study goes."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import numpy as np
from threadpoolctl import threadpool_limits

from sma_bayes import __version__
from sma_bayes.assess.bands import Band, band_channels, credible_band, overall_band
from sma_bayes.assess.correlation import Agreement, correlation_factors
from sma_bayes.assess.correlation_average import Scored, averages
from sma_bayes.assess.loops import loop_quantities
from sma_bayes.assess.summary import record_summary
from sma_bayes.effects import EFFECTS
from sma_bayes.errors import OutputError, ResumeError, SmaBayesError, near_matches
from sma_bayes.gap.check import Comparable, comparable
from sma_bayes.inference.ensembles import Plan
from sma_bayes.inference.jobs import run
from sma_bayes.inference.noise_choice import choose_noise
from sma_bayes.inference.warm_start import warm_start
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.parameters.priors_file import PriorSet, read_priors
from sma_bayes.posterior import build_posterior, versions
from sma_bayes.records.types import Branch, Campaign, Record
from sma_bayes.response.arrangement import Arrangement, BiasSpring
from sma_bayes.results.fit import Fit
from sma_bayes.results.fitting import AUTO, fit_records
from sma_bayes.results.store import (
    plain,
    sweep_unfinished,
    write_csv,
    write_json,
    write_posterior,
    write_text,
)

DEFAULT_PRIORS = "modified_sigmoid"

MARK = "run.json"
"""File that tells to which run a folder belongs."""

Pool = Literal["none", "campaign"]
Progress = Callable[[int, int, str], None]
"""Told how many tasks are done, how many there are, and what is going on."""


@dataclass(frozen=True, slots=True)
class FitOptions:
    """What decides the numbers of a run.

    Attributes
    ----------
    seed : int
    noise : str
        Name of a noise model, or ``auto``.
    priors : PriorSet
    pool : str
        ``none``: each condition and branch has its own A and B; ``campaign``: one set a branch for all.
    extrapolate : float
        How far bands go beyond the observed temperatures [unit of temperature].
    plan : Plan
    bias : BiasSpring, optional
        Bias spring whose arrangement with the alloy spring gets bands of its own, Eq. (8).
    """

    priors: PriorSet
    seed: int = 0
    noise: str = AUTO
    pool: Pool = "none"
    extrapolate: float = 0.0
    plan: Plan = field(default_factory=Plan)
    bias: BiasSpring | None = None


def fit(
    campaign: Campaign,
    *,
    seed: int = 0,
    noise: str = AUTO,
    priors: str | Path | PriorSet = DEFAULT_PRIORS,
    pool: Pool = "none",
    jobs: int | None = None,
) -> dict[str, Fit]:
    """Fit every record of a campaign, in memory.

    Parameters
    ----------
    campaign : Campaign
        As `read_campaign` gives it.
    seed : int
        Decides every draw.
    noise : str
        Name of a noise model, or ``auto``: chosen from the residuals of the warm start.
    priors : str, Path or PriorSet
        Name of a shipped set or path of a priors file.
    pool : {'none', 'campaign'}
        With ``campaign`` one set of A and B a branch serves all conditions.
    jobs : int, optional
        Processes; by default one for each core.

    Returns
    -------
    dict of str to Fit
        By the key of the record, ``<condition>-<branch>``. Pooled records share one `Fit`.
    """
    options = FitOptions(priors if isinstance(priors, PriorSet) else read_priors(priors), seed, noise, pool)
    groups = groups_of(campaign, pool)
    tasks = [_Task(g, options, None) for g in groups]
    out: dict[str, Fit] = {}
    for group, found in zip(groups, run(_sample_task, tasks, jobs), strict=True):
        out |= {record.key: found for record in group}
    return out


def fit_campaign(
    campaign: Campaign,
    out: str | Path,
    *,
    seed: int = 0,
    noise: str = AUTO,
    priors: str | Path | PriorSet = DEFAULT_PRIORS,
    pool: Pool = "none",
    jobs: int | None = None,
    extrapolate: float = 0.0,
    bias: BiasSpring | None = None,
    resume: bool = False,
    figures: bool = True,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Fit every record of a campaign and write posteriors, bands, tables, figures and the report.

    Parameters
    ----------
    campaign, seed, noise, priors, pool, jobs
        See `fit`.
    out : str or Path
        Folder for the results. It must be new or empty, unless `resume` is set and it holds the same run.
    extrapolate : float
        How far bands go beyond the observed temperatures [unit of temperature]; what lies there is marked.
    bias : BiasSpring, optional
        Bias spring; the stiffness of both springs together gets bands of its own, Eq. (8).
    resume : bool
        Go on with a run that was interrupted. The result is the same to the bit.
    figures : bool
        Whether figures and the report are made.
    progress : callable, optional

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
    clock = time.perf_counter()
    folder = Path(out)
    options = FitOptions(
        priors if isinstance(priors, PriorSet) else read_priors(priors),
        seed,
        noise,
        pool,
        extrapolate,
        bias=bias,
    )
    groups = groups_of(campaign, pool)
    check_call(groups, options)
    with claimed_folder(folder, run_identity(campaign, options), resume):
        tell = progress or (lambda done, total, message: None)
        outcomes = _outcomes([_Task(g, options, folder) for g in groups], jobs, tell)
    records = [s for o in outcomes for s in o.summaries]
    summary = {
        "schema": "sma-bayes/fit/1",
        "campaign": campaign.name,
        "source": campaign.source,
        **({"data_dir": campaign.data_dir} if campaign.data_dir else {}),
        "seed": seed,
        "options": {
            "noise": noise,
            "pool": pool,
            "extrapolate": extrapolate,
            "priors": options.priors.title,
            "bias_spring": None if bias is None else asdict(bias),
        },
        "versions": all_versions(),
        "data_sha256": campaign.sha256,
        "converged": all(r["converged"] for r in records),
        "records": records,
        "correlation_average": _correlation_averages(outcomes),
        "loops": _loops([o.fit for o in outcomes]),
        "findings": [asdict(f) for f in campaign.findings],
    }
    write_text(folder / "priors.toml", options.priors.text)
    stages = {"sample": time.perf_counter() - clock}
    write_json(folder / "summary.json", {**summary, "stages_s": stages, "wall_s": stages["sample"]})
    if figures:
        from sma_bayes.report.build import build_report

        before = time.perf_counter()
        build_report(folder, jobs=jobs, progress=tell)
        stages["report"] = time.perf_counter() - before
    summary = {**summary, "stages_s": stages, "wall_s": time.perf_counter() - clock}
    write_json(folder / "summary.json", summary)
    return summary


def _outcomes(tasks: Sequence[_Task], jobs: int | None, tell: Progress) -> list[_Outcome]:
    tell(0, len(tasks), "sampling")
    outcomes: list[_Outcome] = []
    for outcome in run(_whole_task, tasks, jobs):
        outcomes.append(outcome)
        tell(len(outcomes), len(tasks), f"sampled {', '.join(s['key'] for s in outcome.summaries)}")
    return outcomes


def check_call(groups: Sequence[Sequence[Record]], options: FitOptions) -> None:
    """Refuse, before anything is written or sampled, what no record could be fitted with.

    Parameters
    ----------
    groups : sequence of sequence of Record
        Records that share a posterior.
    options : FitOptions

    Raises
    ------
    UnknownNameError
        If no noise model has that name.
    PriorError
        If a prior is missing, has no parameter, or is wrong, or records can't share parameters.
    SmaBayesError
        If bands are to go on for ever.
    """
    if not np.isfinite(options.extrapolate):
        raise SmaBayesError(f"--extrapolate {options.extrapolate}", expected="a finite number of degrees")
    noise = NOISE_MODELS["independent" if options.noise == AUTO else options.noise]
    for group in groups:
        one = [dict.fromkeys(record.channels, 1.0) for record in group]  # stands for residual and memory
        build_posterior(group, NOISE_MODELS["independent"], options.priors)
        build_posterior(group, noise, options.priors, residual=one, memory=one)


def groups_of(campaign: Campaign, pool: Pool) -> list[tuple[Record, ...]]:
    """Records that share a posterior: one each, or all of a branch."""
    if pool == "none":
        return [(r,) for r in campaign.records]
    branches = (tuple(r for r in campaign.records if r.branch is b) for b in Branch)
    return [g for g in branches if g]


@contextmanager
def claimed_folder(folder: Path, identity: dict[str, Any], resume: bool) -> Iterator[None]:
    """Work in a folder that is ours, and leave none behind if nothing came of it; see `claim_folder`."""
    made = claim_folder(folder, identity, resume)
    try:
        yield
    except BaseException:
        give_back(folder, made)
        raise


def give_back(folder: Path, made: Sequence[Path]) -> None:
    """Undo a claim, unless files besides its mark have been written.

    Parameters
    ----------
    folder : Path
    made : sequence of Path
        Folders that the claim made, the innermost first.
    """
    inside = sorted(folder.rglob("*"), reverse=True)
    if any(p.is_file() and p != folder / MARK for p in inside):
        return
    with suppress(OSError):  # what can't be removed does no harm; the reason why we are here is what counts
        (folder / MARK).unlink(missing_ok=True)
        for place in (*(p for p in inside if p.is_dir()), *made):
            place.rmdir()


def claim_folder(folder: Path, identity: dict[str, Any], resume: bool) -> tuple[Path, ...]:
    """Make a folder ours, or check that it already is.

    Returns
    -------
    tuple of Path
        Folders that were made for it, the innermost first.

    Raises
    ------
    OutputError
        If it can't be made, is not empty, or holds another run and `resume` was not asked for.
    ResumeError
        If it holds a run of other data, priors, options or versions.
    """
    try:
        if (folder / MARK).is_file():
            _check_mark(folder, identity, resume)
            sweep_unfinished(folder)
            return ()
        if folder.exists() and not folder.is_dir():
            raise OutputError("is a file", file=folder, expected="a folder", remedy="choose another --out")
        if folder.exists() and any(folder.iterdir()):
            raise OutputError(
                "is not empty and holds no run of sma_bayes",
                file=folder,
                expected="a new or empty folder",
                remedy="choose another --out",
            )
        made = tuple(p for p in (folder, *folder.parents) if not p.exists())
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"can't be used: {error.strerror or error}", file=folder, expected="a folder that can be written",
            remedy="choose another --out",
        ) from None  # fmt: skip
    try:
        write_json(folder / MARK, identity)
    except OutputError:
        give_back(folder, made)
        raise
    return made


def _check_mark(folder: Path, identity: dict[str, Any], resume: bool) -> None:
    try:
        found = json.loads((folder / MARK).read_text(encoding="utf-8"))
    except ValueError:
        found = None
    if not isinstance(found, dict):
        raise OutputError(
            "does not say which run the folder holds",
            file=folder / MARK,
            expected="what `fit` wrote there",
            remedy="choose another --out",
        )
    different = [k for k in {**identity, **found} if k != "schema" and found.get(k) != identity.get(k)]
    if not resume:
        raise OutputError(
            "holds another run" if different else "holds this run already",
            file=folder,
            expected="a new or empty folder",
            remedy="choose another --out" + ("" if different else ", or add --resume to go on with that run"),
        )
    if different:
        raise ResumeError(
            f"holds a run that differs in {', '.join(different)}",
            file=folder,
            expected="the same data, priors, options and versions",
            remedy="resume with what the run was started with, or choose another --out",
        )


def study_gap(
    campaign: Campaign,
    out: str | Path | None = None,
    *,
    seed: int = 0,
    noise: str = AUTO,
    priors: str | Path | PriorSet = DEFAULT_PRIORS,
    pool: Pool = "none",
    jobs: int | None = None,
    resume: bool = False,
    figures: bool = True,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Find where model and measurement disagree, name what is missing, add it, and show the gap shrink.

    Parameters
    ----------
    campaign : Campaign
    out : str or Path, optional
        Folder for `gap.json`, the posterior, series, tables, figures and the report; nothing is written without it.
    noise : str
        Only ``auto``: the study estimates the noise of each channel by itself.
    resume : bool
        Where `out` holds this very study already, only what is missing of its report is made.
    seed, priors, pool, jobs, figures, progress
        See `fit_campaign`. With ``pool="campaign"`` one set of A and B a branch serves all conditions: what differs
        between conditions (stress, rate, lag) then shows instead of being swallowed.

    Returns
    -------
    dict
        What `gap.json` holds.

    Raises
    ------
    SmaBayesError
        If another noise is asked for.
    MeasurementError
        If the histories can't be compared.
    OutputError, ResumeError
        If `out` can't be used.
    """
    if noise != AUTO:
        raise SmaBayesError(
            f"--noise {noise}",
            expected=f"{AUTO!r}: a gap study estimates AR(1) noise of each channel beside smooth functions, since "
            "noise that is told from residuals would swallow the very disagreement that is looked for",
            remedy="leave --noise out; gap.json states the noise that was found",
        )
    options = FitOptions(priors if isinstance(priors, PriorSet) else read_priors(priors), seed, pool=pool)
    can = comparable(campaign)
    check_call(groups_of(can.campaign, pool), options)
    tell = progress or (lambda done, total, message: None)
    if out is None:
        return _studied(can, None, options, jobs, tell)
    folder = Path(out)
    identity = {**run_identity(campaign, options), "kind": "gap", "effects": sorted(EFFECTS)}
    with claimed_folder(folder, identity, resume):
        finished = _finished_study(folder)
        found = finished or _studied(can, folder, options, jobs, tell)
    if figures:
        report_once(folder, bool(finished), jobs, tell)
    return found


def report_once(folder: Path, finished: bool, jobs: int | None, tell: Progress) -> None:
    """Make the report of a folder, unless its run had been finished before and has one."""
    if finished and (folder / "report.html").is_file():
        return
    from sma_bayes.report.build import build_report

    build_report(folder, jobs=jobs, progress=tell)


def _studied(
    can: Comparable,
    folder: Path | None,
    options: FitOptions,
    jobs: int | None,
    tell: Progress,
) -> dict[str, Any]:
    """Study a campaign, and write what was found; `gap.json` last, so that where it is nothing is missing."""
    from sma_bayes.gap.cautions import cautions
    from sma_bayes.gap.outcome import STAGES, gap_outcome, outcome_json
    from sma_bayes.gap.store import write_study

    clock = time.perf_counter()
    campaign = can.campaign
    with threadpool_limits(limits=1):
        outcome = gap_outcome(
            campaign,
            options.priors,
            pooled=options.pool == "campaign",
            seed=options.seed,
            jobs=jobs,
            progress=lambda done, message: tell(done, STAGES, message),
        )
    stated = outcome_json(outcome)
    found: dict[str, Any] = plain(
        {
            **stated,
            "campaign": campaign.name,
            "source": campaign.source,
            "seed": options.seed,
            "pool": options.pool,
            "priors": options.priors.title,
            "versions": all_versions(),
            "data_sha256": campaign.sha256,
            "cautions": cautions(stated),
            "remarks": list(can.remarks),
            "findings": [asdict(f) for f in campaign.findings],
            "wall_s": time.perf_counter() - clock,
        }
    )
    if folder is not None:
        write_study(folder, outcome, seed=options.seed)
        write_text(folder / "priors.toml", options.priors.text)
        write_json(folder / "gap.json", found)
    return found


def _finished_study(folder: Path) -> dict[str, Any] | None:
    """What `gap.json` of a folder holds, if the study came to its end."""
    try:
        found = json.loads((folder / "gap.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) else None


def all_versions() -> dict[str, str]:
    """Versions of Python, of this package and of what it computes and draws with."""
    more = ("arviz", "corner", "h5netcdf", "matplotlib", "pandas", "pint", "xarray")
    return {**versions(), **{name: version(name) for name in more}}


def run_identity(campaign: Campaign, options: FitOptions) -> dict[str, Any]:
    """What decides the numbers of a run: what `run.json` holds, and what must agree for it to be resumed."""
    return {
        "schema": "sma-bayes/run/1",
        "data": campaign.sha256,
        "records": [record.key for record in campaign.records],
        "priors": hashlib.sha256(options.priors.text.encode()).hexdigest(),
        "seed": options.seed,
        "noise": options.noise,
        "pool": options.pool,
        "extrapolate": options.extrapolate,
        "bias_spring": None if options.bias is None else asdict(options.bias),
        "version": __version__,
        "versions": versions(),
    }


@dataclass(frozen=True, eq=False)
class _Task:
    records: tuple[Record, ...]
    options: FitOptions
    folder: Path | None


@dataclass(frozen=True, eq=False)
class _Outcome:
    fit: Fit
    summaries: list[dict[str, Any]]
    agreements: list[Mapping[str, Mapping[str, Agreement]]]
    """Of each record: ``measured`` and ``replicated``, then by channel."""


def _sample_task(task: _Task) -> Fit:
    o = task.options
    checkpoint = None
    if task.folder is not None:
        name = task.records[0].key if len(task.records) == 1 else f"all-{task.records[0].branch.value}"
        checkpoint = task.folder / "checkpoints" / f"{name}.h5"
    return fit_records(task.records, o.priors, noise=o.noise, seed=o.seed, plan=o.plan, checkpoint=checkpoint)


def _whole_task(task: _Task) -> _Outcome:
    """Sample, assess and write one posterior."""
    found = _sample_task(task)
    if task.folder is None:
        raise SmaBayesError("no folder to write to")
    summaries: list[dict[str, Any]] = []
    agreements: list[Mapping[str, Mapping[str, Agreement]]] = []
    for i, record in enumerate(found.records):
        clock = time.perf_counter()
        rng = np.random.default_rng(np.random.SeedSequence([task.options.seed, 4, *record.key.encode()]))
        replicated = found.posterior.replicate(rng, found.flat, record=i)
        measured, again = correlation_factors(found, replicated, i)
        summary = record_summary(found, i, measured, again)
        write_posterior(task.folder / "posterior" / f"{record.key}.nc", found, i, replicated)
        for channel in band_channels(record):
            band = credible_band(found, channel, i, task.options.extrapolate)
            write_band(task.folder / "bands" / f"{record.key}-{channel}.csv", band, record)
        overall = (
            None
            if task.options.bias is None
            else overall_band(found, task.options.bias, i, task.options.extrapolate)
        )
        if overall is not None:
            write_band(task.folder / "bands" / f"{record.key}-overall_stiffness.csv", overall, record)
        summary["stages_s"]["assess"] = time.perf_counter() - clock
        summary["wall_s"] += summary["stages_s"]["assess"]
        summaries.append(summary)
        agreements.append({"measured": measured, "replicated": again})
    return _Outcome(found, summaries, agreements)


def write_band(path: Path, band: Band, record: Record) -> None:
    """Write a band as CSV: temperature, quantiles of the curve and of a new measurement, simultaneous bands."""
    unit = record.units["temperature"]
    columns: dict[str, Any] = {f"temperature_{unit}": band.temperature}
    columns |= band.curve
    columns |= band.predictive
    columns |= band.simultaneous
    columns["extrapolated"] = band.extrapolated
    write_csv(path, columns)


def _correlation_averages(outcomes: Sequence[_Outcome]) -> list[dict[str, Any]]:
    """Averages of the correlation factors over all records, for measured and for replicated data."""
    out = []
    for data in ("measured", "replicated"):
        scored = [
            Scored(
                record.key,
                record.branch.value,
                channel,
                record.quantity(channel),
                record.units[channel],
                outcome.fit.records[0].key,
                outcome.fit.converged,
                found,
            )
            for outcome in outcomes
            for record, agreements in zip(outcome.fit.records, outcome.agreements, strict=True)
            for channel, found in agreements[data].items()
        ]
        out += [{"data": data, **entry} for entry in averages(scored)]
    return out


def _loops(fits: Sequence[Fit]) -> list[dict[str, Any]]:
    place = {r.key: (f, i) for f in fits for i, r in enumerate(f.records)}
    out = []
    for key, (heating, i) in place.items():
        record = heating.records[i]
        other = f"{record.condition.id}-{Branch.COOLING.value}"
        if record.branch is Branch.HEATING and other in place and key != other:
            cooling, j = place[other]
            out += [asdict(q) for q in loop_quantities(heating, cooling, (i, j))]
    return out


def pool_named(name: str) -> Pool:
    """Check the name of a way to pool.

    Raises
    ------
    SmaBayesError
        If it is none of them.
    """
    if name == "none":
        return "none"
    if name == "campaign":
        return "campaign"
    raise SmaBayesError(f"--pool {name!r}", expected="'none' or 'campaign'")


def is_run_of(folder: Path, campaign: Campaign) -> bool:
    """Whether a folder holds a run of this campaign by this version."""
    try:
        found = json.loads((folder / MARK).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    if not isinstance(found, dict):
        return False
    return bool(found.get("data") == campaign.sha256 and found.get("versions") == versions())


def inspect_campaign(campaign: Campaign) -> dict[str, Any]:
    """Describe what was read, and the noise about a least-squares fit, without sampling.

    Returns
    -------
    dict
        What `sma-bayes inspect --json` prints (`sma-bayes/inspect/1`).
    """
    document: dict[str, Any] = plain({
        "schema": "sma-bayes/inspect/1",
        "campaign": campaign.name,
        "source": campaign.source,
        "data_sha256": campaign.sha256,
        "records": [_described(r) for r in campaign.records],
        "findings": [asdict(f) for f in campaign.findings],
    })  # fmt: skip
    return document


def _described(record: Record) -> dict[str, Any]:
    priors = read_priors(DEFAULT_PRIORS)
    posterior = build_posterior([record], NOISE_MODELS["independent"], priors)
    start = warm_start(posterior, np.random.default_rng(0))
    choice = choose_noise(posterior, start, priors)
    return {
        "key": record.key,
        "condition": record.condition.id,
        "branch": record.branch.value,
        "source": record.source,
        "n": record.n,
        "rows": [int(record.row.min()), int(record.row.max())],
        "rows_averaged": record.rows_averaged,
        "segments": int(np.unique(record.inputs["segment"]).size),
        "temperature": {
            "unit": record.units["temperature"],
            "lowest": float(record.temperature.min()),
            "highest": float(record.temperature.max()),
        },
        "channels": {
            c: {"name": record.quantity(c), "unit": record.units[c], "noise_sd": start.fit[0][c].rmse}
            for c in record.channels
        },
        "held": {
            c: {"name": record.quantity(c), "unit": record.units.get(c, ""), "mean": h.mean, "sd": h.sd}
            for c, h in record.held.items()
        },
        "noise": {"name": choice.name, "reason": choice.reason, "lag1": dict(choice.lag1)},
        "fit": {c: asdict(g) for c, g in start.fit[0].items()},
    }


def bias_spring(arrangement: str | None, stiffness: float, sd: float) -> BiasSpring | None:
    """Bias spring by the name of its arrangement; None for none.

    Raises
    ------
    SmaBayesError
        If there is no such arrangement.
    """
    if arrangement is None:
        return None
    known = [a.value for a in Arrangement]
    if arrangement not in known:
        raise SmaBayesError(f"--arrangement {arrangement!r}", expected=near_matches(arrangement, known))
    return BiasSpring(Arrangement(arrangement), stiffness, sd)
