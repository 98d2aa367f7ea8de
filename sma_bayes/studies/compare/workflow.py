"""Comparing models on a campaign, from records to files."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

from sma_bayes.account import Account
from sma_bayes.errors import MeasurementError, many
from sma_bayes.fitting.posterior import build_posterior
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.parameters.priors_file import PriorSet
from sma_bayes.progress import Progress, announce, lines_about, lines_inside, silent
from sma_bayes.records.types import Branch, Campaign, Record
from sma_bayes.report.choice import REPORT, figures_for
from sma_bayes.response import AUTO_MODEL, DEFAULT_MODEL, RESPONSE_MODELS
from sma_bayes.runs.declared_units import declared_parts
from sma_bayes.runs.documents import COMPARISON
from sma_bayes.runs.jobs import by_the_clock, run
from sma_bayes.runs.schema import ModelChoiceDocument
from sma_bayes.runs.store import write_csv, write_text
from sma_bayes.studies.compare.comparison import (
    AUTO,
    Comparison,
    StartedComparison,
    finished_comparison,
    start_comparison,
)
from sma_bayes.studies.compare.contenders import (
    contenders,
    copy_of,
    joined,
    observables,
    of_channel,
    posterior_of,
    unavailable,
)
from sma_bayes.studies.compare.document import (
    curve_columns,
    overall,
    record_document,
    sample_columns,
    stem_of,
)
from sma_bayes.studies.compare.schema import ComparisonFindings, ComparisonOptions
from sma_bayes.studies.identity import of_campaign, run_identity
from sma_bayes.studies.options import FitOptions, Pool, check_model_and_noise, models_of, prior_set
from sma_bayes.studies.run_context import RunContext
from sma_bayes.studies.shared_model import with_shared_model
from sma_bayes.studies.study_step import StepTable, StudyStep

FEWEST_CONDITIONS = 2
"""Conditions that can be left out in turn."""
MAX_STARTED_RECORDS: Final = 100
"""Records that are all started before the first is compared, so that what they take is told beforehand."""


def compare(
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
    """Compare the modified sigmoid with the logistic and polynomial baselines, and with any other response model.

    Parameters
    ----------
    campaign : Campaign
    out : str or Path, optional
        Folder for `comparison.json`, series, tables, figures and the report; nothing is written without it.
    seed : int
        Seed of all random draws.
    noise : str
        Name of a noise model, the same for all models; ``auto``: chosen for each record by evidence, from what the
        model leaves that fits best.
    priors : str, Path or PriorSet, optional
        Of `model` and of the noise; every other model has its own.
    model : str
        Name of a response model that takes part beside those that always do; ``auto``: the one of the ladder that all
        records together support best.
    pool : {'none', 'campaign'}
        With ``campaign`` one curve a branch serves all conditions, conditions are left out in turn, and the
        polynomial may use the frequency of the drive.
    resume : bool
        Where `out` holds this very comparison already, only what is missing of its report is made.
    jobs, figures, progress, account
        See `fit_campaign`; figures of single records are drawn up to 100 of them.

    Returns
    -------
    dict
        What `comparison.json` holds.

    Raises
    ------
    MeasurementError
        If conditions can't be pooled.
    PriorError, UnknownNameError
        If the call can't be used.
    OutputError, ResumeError
        If `out` can't be used.
    """
    options = FitOptions(prior_set(priors, model), seed, noise, pool, model=model)
    records = units_of(campaign, pool)
    check(records, options)
    work = RunContext(COMPARISON, jobs, figures_for(figures), progress or silent, account or Account())
    identity = {**run_identity(campaign, options), "kind": COMPARISON.verb}
    return work.execute(
        out, identity, resume, lambda folder: _compared(campaign, records, folder, options, work)
    )


def units_of(campaign: Campaign, pool: Pool) -> list[Record]:
    """What is compared: each record and channel, or with ``campaign`` all conditions of a branch joined.

    Raises
    ------
    MeasurementError
        If there are not enough conditions to leave out, or they can't be joined.
    """
    if pool == "none":
        return [of_channel(r, c) for r in campaign.records for c in observables(r)]
    out = []
    for branch in Branch:
        records = [r for r in campaign.records if r.branch is branch]
        if len(records) < FEWEST_CONDITIONS:
            continue
        shared = [c for c in observables(records[0]) if all(c in observables(r) for r in records)]
        out += [joined(records, c) for c in shared]
    if not out:
        raise MeasurementError(
            f"{campaign.name!r} has no two conditions of one branch that share a channel",
            expected=f"{FEWEST_CONDITIONS} conditions or more, each of which can be left out",
            remedy="compare without --pool campaign",
        )
    return out


def check(records: Sequence[Record], options: FitOptions) -> None:
    """Refuse, before anything is written or sampled, what no contender could be fitted with."""
    noise = NOISE_MODELS["independent" if options.noise == AUTO else options.noise]
    check_model_and_noise(options.model, options.noise)
    for record in records:
        chosen = options.model == AUTO_MODEL
        if chosen or not RESPONSE_MODELS[options.model].refusal(record.channels):
            for model, priors in models_of([record], options):
                build_posterior([record], NOISE_MODELS["independent"], priors, model=model)
        for contender in contenders(DEFAULT_MODEL if chosen else options.model):
            if not unavailable(contender, record) and not copy_of(contender, record):
                posterior = posterior_of(contender, record, noise, options.priors)
                if record.n <= posterior.space.dimension:
                    raise MeasurementError(
                        f"{record.n} samples of {record.key} can't tell models apart",
                        expected=f"more than the {posterior.space.dimension} parameters of {contender.name}",
                        remedy="record more samples",
                    )


def _start(record: Record, o: FitOptions) -> StartedComparison:
    return start_comparison(record, o.priors, noise=o.noise, seed=o.seed, model=o.model)


def _compare(begun: StartedComparison | Record, options: FitOptions, lines: float | None) -> Comparison:
    begun = _start(begun, options) if isinstance(begun, Record) else begun
    r = begun.setting.record
    tell = None if lines is None else lines_about(f"{r.key}, {r.quantity(r.channels[0])}", lines)
    return finished_comparison(begun, tell)


def _started(
    records: Sequence[Record], options: FitOptions, work: RunContext
) -> Sequence[StartedComparison | Record]:
    """What is compared, with the noise chosen and the time that it takes announced where records are not very many."""
    if len(records) > MAX_STARTED_RECORDS:
        return records
    task = partial(_start, o=options)
    begun: list[StartedComparison] = []
    for one in run(task, records, work.jobs, account=work.account, stage="compare"):
        begun.append(one)
        work.tell(0, len(records), f"noise and starts of {len(begun)} of {len(records)} found")
    each = [b.expected_s for b in begun]
    models = max((len(b.running) for b in begun), default=0)
    what = f"{many(len(records), 'comparison')} of {models} models, each fitted whole and without each part held out"
    announce(work.tell, by_the_clock(each, work.jobs), what)
    return begun


def _compared(
    campaign: Campaign,
    records: Sequence[Record],
    folder: Path | None,
    options: FitOptions,
    work: RunContext,
) -> ComparisonFindings:
    work.tell(0, len(records), "choosing the model" if options.model == AUTO_MODEL else "comparing")
    chosen, choice = with_shared_model([(r,) for r in records], options, work.jobs, work.account)
    comparisons = []
    begun = _started(records, chosen, work)
    task = partial(_compare, options=chosen, lines=lines_inside(work.tell))
    names = [f"{r.key} {r.quantity(r.channels[0])}" for r in records]
    work.tell(0, len(records), f"comparing {names[0]}")
    for compared in run(task, begun, work.jobs, account=work.account, stage="compare"):
        comparisons.append(compared)
        done = len(comparisons)
        told = f"comparing {names[done]}" if done < len(names) else f"compared {names[-1]}"
        work.tell(done, len(records), told)
        if folder is not None:
            with work.account.timed("write"):
                write_csv(folder / "curves" / f"{stem_of(compared)}.csv", curve_columns(compared))
                write_csv(folder / "samples" / f"{stem_of(compared)}.csv", sample_columns(compared))
    found = ComparisonFindings(
        schema="sma-bayes/comparison/1",
        options=ComparisonOptions.about(options, priors=options.priors.title),
        model_choice=None if choice is None else ModelChoiceDocument.about(choice),
        **of_campaign(campaign, options.seed),
        converged=all(c.converged for c in comparisons),
        **declared_parts(campaign.records),
        overall=overall(comparisons),
        records=tuple(record_document(c) for c in comparisons),
    )
    if folder is not None:
        write_text(folder / "priors.toml", options.priors.whole_text)
    return found


class CompareTable(StepTable):
    """``[compare]``."""

    noise: str | None = None


STEP: Final = StudyStep(
    CompareTable,
    COMPARISON,
    compare,
    lambda found: "; ".join(f"{g['quantity']}: {g['verdict']}" for g in found["overall"]),
    folder="comparison",
)
