"""The public functions, in the order in which a study goes."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from sma_bayes import __version__
from sma_bayes.account import Account
from sma_bayes.assess.correlation_average import Averages
from sma_bayes.effects import EFFECTS
from sma_bayes.errors import SmaBayesError, near_matches
from sma_bayes.gap.check import Comparable, comparable, smoothing_remarks
from sma_bayes.inference.jobs import run
from sma_bayes.inference.noise_choice import choose_noise
from sma_bayes.inference.warm_start import warm_start
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.output_folder import claimed_folder
from sma_bayes.parameters.priors_file import PriorSet, read_priors
from sma_bayes.parts import remove_parts
from sma_bayes.posterior import build_posterior, versions
from sma_bayes.records.types import Branch, Campaign, Record
from sma_bayes.report.choice import Drawn, figures_for
from sma_bayes.response.arrangement import Arrangement, BiasSpring
from sma_bayes.results.documents import FIT, GAP, read_mark
from sma_bayes.results.fit import Fit
from sma_bayes.results.fitting import AUTO
from sma_bayes.results.store import plain, write_text
from sma_bayes.tasks import FitOptions, FitTask, Pool, fitted, sample_task
from sma_bayes.under_way import Progress, UnderWay, silent

DEFAULT_PRIORS = "modified_sigmoid"


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
    tasks = [FitTask(g, options, None) for g in groups]
    out: dict[str, Fit] = {}
    for group, found in zip(groups, run(sample_task, tasks, jobs), strict=True):
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
    figures: str | bool = "auto",
    progress: Progress | None = None,
    account: Account | None = None,
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
    figures : str or bool
        ``all``, ``campaign`` (none of single conditions and records), ``none`` (no report either), or ``auto``: see
        `figures_for`.
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
        priors if isinstance(priors, PriorSet) else read_priors(priors),
        seed,
        noise,
        pool,
        extrapolate,
        bias=bias,
    )
    drawn = figures_for(figures, len(campaign.records))
    work = UnderWay(FIT, jobs, drawn, progress or silent, account or Account())
    groups = groups_of(campaign, pool)
    check_call(groups, options)
    with claimed_folder(folder, run_identity(campaign, options), resume):
        records, averages, loops = _fitted(groups, options, folder, work)
    with work.account.timed("write"):
        write_text(folder / "priors.toml", options.priors.text)
    summary = {
        "schema": FIT.schema,
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
        "correlation_average": averages,
        "loops": loops,
        "findings": [asdict(f) for f in campaign.findings],
    }
    summary = work.end(folder, summary)
    remove_parts(folder)
    return summary


def _fitted(
    groups: Sequence[tuple[Record, ...]],
    options: FitOptions,
    folder: Path,
    work: UnderWay,
) -> tuple[list[dict[str, Any]], list[dict[str, Any]], list[dict[str, Any]]]:
    """Records, average correlation factors and loops of the summary; draws are let go as soon as they are averaged."""
    total = sum(len(group) for group in groups)
    work.tell(0, total, "sampling")
    records: list[dict[str, Any]] = []
    loops: list[dict[str, Any]] = []
    averages = {"measured": Averages(), "replicated": Averages()}
    for part in fitted(groups, options, folder, work.jobs, work.account):
        records += part.records
        loops += part.loops
        for scored in part.scored:
            averages[scored.data].add(scored)
        work.account.take(part.account.document())
        lost = f" ({len(work.account.lost)} workers lost)" if work.account.lost else ""
        work.tell(len(records), total, f"sampled {', '.join(s['key'] for s in part.records)}{lost}")
    return records, [{"data": d, **e} for d, found in averages.items() for e in found.entries()], loops


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
    figures: str | bool = "auto",
    progress: Progress | None = None,
    account: Account | None = None,
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
        Go on with this very study: sampling where it stopped, or, where `gap.json` is there already, only what is
        missing of the report. The search is repeated, to the same end; it takes seconds.
    seed, priors, pool, jobs, figures, progress, account
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
    drawn: Drawn = "none" if figures_for(figures, len(campaign.records)) == "none" else "all"
    work = UnderWay(GAP, jobs, drawn, progress or silent, account or Account())
    if out is None:
        return work.with_account(_studied(can, None, options, work))
    folder = Path(out).absolute()
    identity = {**run_identity(campaign, options), "kind": GAP.verb, "effects": sorted(EFFECTS)}
    return work.carry_out(folder, identity, resume, lambda: _studied(can, folder, options, work))


def _studied(
    can: Comparable,
    folder: Path | None,
    options: FitOptions,
    work: UnderWay,
) -> dict[str, Any]:
    """Study a campaign, and write what was found except `gap.json`, which comes last."""
    from sma_bayes.gap.cautions import cautions
    from sma_bayes.gap.outcome import STAGES, gap_outcome, outcome_json
    from sma_bayes.gap.store import write_study

    campaign = can.campaign
    with threadpool_limits(limits=1):
        outcome = gap_outcome(
            campaign,
            options.priors,
            pooled=options.pool == "campaign",
            seed=options.seed,
            jobs=work.jobs,
            progress=lambda done, message: work.tell(done, STAGES, message),
            account=work.account,
            checkpoint=folder and folder / "checkpoints" / "gap.h5",
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
            "remarks": [
                *can.remarks,
                *smoothing_remarks(outcome.study.baseline.hypothesis.histories),
            ],
            "findings": [asdict(f) for f in campaign.findings],
        }
    )
    if folder is not None:
        with work.account.timed("write"):
            write_study(folder, outcome, seed=options.seed)
            write_text(folder / "priors.toml", options.priors.text)
    return found


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
    found = read_mark(folder) or {}
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
