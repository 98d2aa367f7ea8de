"""A gap study, from a campaign to files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from sma_bayes.account import Account
from sma_bayes.effects import EFFECTS
from sma_bayes.errors import SmaBayesError, many
from sma_bayes.fitting.fit_records import AUTO
from sma_bayes.parameters.priors_file import PriorSet
from sma_bayes.progress import Progress, announce, silent
from sma_bayes.records.types import Campaign
from sma_bayes.report.choice import REPORT, Drawn, figures_for
from sma_bayes.response import DEFAULT_MODEL, RESPONSE_MODELS
from sma_bayes.runs.declared_units import declared_parts, shown_units
from sma_bayes.runs.documents import GAP
from sma_bayes.runs.schema import ModelChoiceDocument
from sma_bayes.runs.store import write_text
from sma_bayes.studies.gap.cautions import cautions
from sma_bayes.studies.gap.check import Comparable, comparable, smoothing_remarks
from sma_bayes.studies.gap.document import gap_of_model, heat_balance
from sma_bayes.studies.gap.expected import expected_s
from sma_bayes.studies.gap.outcome import STAGES, gap_outcome
from sma_bayes.studies.gap.schema import GapFindings
from sma_bayes.studies.gap.shown import part_in_declared_units
from sma_bayes.studies.gap.store import write_study
from sma_bayes.studies.identity import of_campaign, run_identity
from sma_bayes.studies.options import FitOptions, Pool, check_call, groups_of, prior_set
from sma_bayes.studies.run_context import RunContext
from sma_bayes.studies.shared_model import with_shared_model
from sma_bayes.studies.study_step import StepTable, StudyStep
from sma_bayes.threads import one_thread


def study_gap(
    campaign: Campaign,
    out: str | Path | None = None,
    *,
    seed: int = 0,
    noise: str = AUTO,
    priors: str | Path | PriorSet | None = None,
    model: str = DEFAULT_MODEL,
    pool: Pool = "none",
    jobs: int | None = None,
    resume: bool = False,
    figures: str | bool = REPORT,
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
    model : str
        Name of the response model of the baseline; ``auto``: the one of the ladder that all records together support
        best, so that what is missing is not the shape of a curve that can be had.
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
            "noise that is told from residuals would absorb the very disagreement that is looked for",
            remedy="leave --noise out; gap.json states the noise that was found",
        )
    options = FitOptions(prior_set(priors, model), seed, pool=pool, model=model)
    can = comparable(campaign)
    check_call(groups_of(can.campaign, pool), options)
    drawn: Drawn = "none" if figures_for(figures) == "none" else "all"
    work = RunContext(GAP, jobs, drawn, progress or silent, account or Account())
    identity = {**run_identity(campaign, options), "kind": GAP.verb, "effects": sorted(EFFECTS)}
    return work.execute(out, identity, resume, lambda folder: _studied(can, folder, options, work))


def _studied(
    can: Comparable,
    folder: Path | None,
    options: FitOptions,
    work: RunContext,
) -> GapFindings:
    """Study a campaign, and write what was found except `gap.json`, which comes last."""
    campaign = can.campaign
    groups = groups_of(campaign, options.pool)
    what = f"{many(len(campaign.records), 'record')}, looking for {many(len(EFFECTS), 'effect')}"
    announce(work.tell, expected_s(groups, options, work.jobs), what)
    work.tell(0, STAGES, "choosing the model")
    chosen, choice = with_shared_model(groups, options, work.jobs, work.account)
    with one_thread():
        outcome = gap_outcome(
            campaign,
            chosen.priors,
            model=RESPONSE_MODELS[chosen.model],
            pooled=options.pool == "campaign",
            seed=options.seed,
            jobs=work.jobs,
            progress=lambda done, message: work.tell(done, STAGES, message),
            account=work.account,
            checkpoint=folder and folder / "checkpoints" / "gap.h5",
        )
    response = gap_of_model(outcome)
    heated, units = outcome.heating, shown_units(campaign.records)
    smoothed = smoothing_remarks(heated.study.baseline.hypothesis.histories) if heated else []
    found = GapFindings(
        schema="sma-bayes/gap/1",
        **dict(response),
        heating=None if heated is None else heat_balance(heated, units),
        model=chosen.model,
        model_choice=None if choice is None else ModelChoiceDocument(**asdict(choice)),
        pool=options.pool,
        priors=options.priors.title,
        **of_campaign(campaign, options.seed),
        **declared_parts(campaign.records),
        cautions=tuple(cautions(part_in_declared_units(response, units))),
        remarks=(*can.remarks, *smoothed),
    )
    if campaign.data_dir:
        found = found.model_copy(update={"data_dir": campaign.data_dir})
    if folder is not None:
        with work.account.timed("write"):
            write_study(folder, outcome, seed=options.seed)
            write_text(folder / "priors.toml", options.priors.whole_text)
    return found


VERDICTS: Final = {
    "none": "nothing is missing beyond what chance explains",
    "named": "the model misses {}",
    "unnamed": "the model misses something that the catalogue has no name for",
}
"""Verdicts in a few words; the effects that were added take the place in them."""


def _told(found: Mapping[str, Any]) -> str:
    parts = {"": found} | ({"; heating: ": found["heating"]} if found["heating"] else {})
    return "".join(f"{start}{_verdict(part)}" for start, part in parts.items())


def _verdict(found: Mapping[str, Any]) -> str:
    effects = ", ".join(f"{e['id']} ({e['title']})" for e in found["effects"])
    return VERDICTS[found["verdict"]].format(effects)


STEP: Final = StudyStep(StepTable, GAP, study_gap, _told)
