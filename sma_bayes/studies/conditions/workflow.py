"""Studying the conditions of a finished fit, from its folder to files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Final

from pydantic import Field

from sma_bayes.account import Account
from sma_bayes.assess.draws import RecordDraws, record_draws
from sma_bayes.errors import OutputError, SmaBayesError, require_seed
from sma_bayes.fitting.model_choice import ModelChoice
from sma_bayes.limits import SCATTER as SCATTER_LIMIT
from sma_bayes.parameters.priors_file import parse_priors
from sma_bayes.progress import Progress, silent
from sma_bayes.records.types import Condition
from sma_bayes.report.choice import REPORT, figures_for
from sma_bayes.response import AUTO_MODEL
from sma_bayes.runs.declared_units import declared_parts
from sma_bayes.runs.documents import CONDITIONS
from sma_bayes.runs.jobs import run as run_tasks
from sma_bayes.runs.outputs import StoredRun, read_run
from sma_bayes.runs.schema import ModelChoiceDocument
from sma_bayes.runs.store import write_csv
from sma_bayes.runs.stored_draws import stored_draws
from sma_bayes.studies.condition_text import condition_at, text_of
from sma_bayes.studies.conditions.document import (
    curve_columns,
    held_out_columns,
    sample_columns,
    stem,
    study_parts,
)
from sma_bayes.studies.conditions.population import PRIOR_MEDIAN_SCATTER
from sma_bayes.studies.conditions.schema import ConditionsDocument, ConditionsFindings, ConditionsOptions
from sma_bayes.studies.conditions.study import ConditionStudy, bands_of, study
from sma_bayes.studies.fit.tasks import FitTask, sample_task
from sma_bayes.studies.identity import fit_identity, of_fit
from sma_bayes.studies.options import FitOptions, check_model_and_noise, model_named
from sma_bayes.studies.run_context import RunContext
from sma_bayes.studies.shared_model import with_shared_model
from sma_bayes.studies.study_step import FromFitTable, StudyStep, Texts, temperatures


def study_conditions(
    folder: str | Path,
    out: str | Path | None = None,
    *,
    at: Sequence[Condition | str] = (),
    leave_out: Sequence[str] = (),
    seed: int = 0,
    scatter: float = PRIOR_MEDIAN_SCATTER,
    model: str | None = None,
    jobs: int | None = None,
    resume: bool = False,
    figures: str | bool = REPORT,
    progress: Progress | None = None,
    account: Account | None = None,
) -> dict[str, Any]:
    """Tell what operating conditions do, and predict conditions that were not measured.

    Parameters
    ----------
    folder : str or Path
        Output folder of a finished `fit`.
    out : str or Path, optional
        Folder for `conditions.json`, bands, series, tables, figures and the report; nothing is written without it.
    at : sequence of Condition or str
        Conditions to predict; as text ``current_A=2.2,load_g=150``, with the names of campaign.toml.
    leave_out : sequence of str
        Conditions to leave out in turn and to predict from the others; ``each`` for all.
    seed : int
        Seed of all random draws.
    scatter : float
        Median of the prior of the scatter between conditions, as a share of what a curve has by itself: see
        `sma_bayes.studies.conditions.population`.
    model : str, optional
        Name of the response model that the fit must have been made with; by default whichever it was, and what is
        learnt over conditions joins those of the same. With ``auto`` all have the one of the ladder that they support
        best together; those that were fitted with another are fitted again.
    resume : bool
        Where `out` holds this very study already, only what is missing of its report is made.
    jobs, figures, progress, account
        See `fit_campaign`.

    Returns
    -------
    dict
        What `conditions.json` holds.

    Raises
    ------
    OutputError, ResumeError
        If `folder` holds no finished fit of separate conditions, or `out` can't be used.
    MeasurementError
        If no two conditions can be compared, or they say nothing about one that was asked.
    UnknownNameError, SmaBayesError
        If a setting or condition is not known.
    """
    require_seed(seed)
    if not 0.0 < scatter <= SCATTER_LIMIT.value:
        raise SmaBayesError(
            f"--scatter {scatter:g}",
            expected=f"a positive number, a share of the curve, at most {SCATTER_LIMIT.value:g}",
        )
    source, spent = Path(folder), account or Account()
    wanted = None if model is None else model_named(model)
    with spent.timed("read"):
        run, records = read_run(source), stored_draws(source)
    found = sorted({r.posterior.model.name for r in records})
    if wanted == AUTO_MODEL:
        check_model_and_noise(AUTO_MODEL, run.summary.options.noise)
    elif wanted is not None and found != [wanted]:
        raise OutputError(
            f"holds a fit of {' and '.join(repr(name) for name in found)}",
            file=source,
            expected=f"a fit of the model {wanted!r}",
            remedy=f"leave --model out, fit anew with --model {wanted}, or give --model {AUTO_MODEL}",
        )
    specimen = records[0].record.specimen
    asked = tuple(condition_at(a, specimen=specimen) if isinstance(a, str) else a for a in at)
    chooses = wanted == AUTO_MODEL
    question = {
        "at": [repr(c) for c in asked],
        "leave_out": list(leave_out),
        "seed": seed,
        "scatter": scatter,
        "model": AUTO_MODEL if chooses else None,
    }
    work = RunContext(CONDITIONS, jobs, figures_for(figures), progress or silent, spent)

    def find(place: Path | None) -> ConditionsFindings:
        alike, choice, refitted = _of_one_model(run, records, work) if chooses else (records, None, [])
        found = study(
            alike, asked, leave_out, seed=seed, scatter=scatter, jobs=work.jobs, tell=work.tell,
            account=work.account,
        )  # fmt: skip
        if place is not None:
            with work.account.timed("write"):
                _write(place, found, seed)
        return ConditionsFindings(
            schema="sma-bayes/conditions/1",
            options=ConditionsOptions(
                scatter=scatter,
                at=tuple(text_of(c, specimen=specimen) for c in asked),
                leave_out=tuple(leave_out),
                model=AUTO_MODEL if chooses else None,
            ),
            model_choice=None if choice is None else ModelChoiceDocument.about(choice),
            refitted=tuple(refitted),
            **of_fit(run.summary, run.folder, seed),
            specimen=specimen,
            **declared_parts(run.summary.records),
            **study_parts(found, specimen=specimen),
        )

    return work.execute(out, fit_identity(CONDITIONS.verb, run.summary, question), resume, find)


def _of_one_model(
    run: StoredRun, records: Sequence[RecordDraws], work: RunContext
) -> tuple[tuple[RecordDraws, ...], ModelChoice, list[str]]:
    """Draws under the model that all records together support best, why, and the keys of those fitted again."""
    summary = run.summary
    work.tell(0, len(records), "choosing the model")
    priors = parse_priors(run.priors, str(run.folder / "priors.toml"))
    options = FitOptions(priors, summary.seed, summary.options.noise, model=AUTO_MODEL)
    groups = [(r.record,) for r in records]
    options, choice = with_shared_model(groups, options, work.jobs, work.account)
    assert choice is not None  # the model was to be chosen
    others = [r for r in records if r.posterior.model.name != choice.name]
    tasks = [FitTask((r.record,), options, None) for r in others]
    again: dict[str, RecordDraws] = {}
    for fit in run_tasks(sample_task, tasks, work.jobs, account=work.account, stage="sample"):
        again[fit.records[0].key] = record_draws(fit)
        work.tell(len(again), len(others), f"fitted {fit.records[0].key} again")
    return tuple(again.get(r.key, r) for r in records), choice, list(again)


def _write(folder: Path, found: ConditionStudy, seed: int) -> None:
    """Write curves, bands and series."""
    for population in found.populations:
        for record in population.records:
            for channel in record.quantities:
                name = stem(record.condition, record.branch.value, channel)
                write_csv(folder / "curves" / f"{name}.csv", curve_columns(record, channel))
    for prediction in found.predictions:
        branch = prediction.reference.branch.value
        for channel, band in bands_of(prediction, seed).items():
            name = stem(prediction.condition, branch, channel)
            columns = band.columns(prediction.reference.record.units["temperature"])
            write_csv(folder / "bands" / f"{name}.csv", columns)
    for held in found.held_out:
        name = stem(held.record.condition, held.record.branch.value, held.channel)
        write_csv(folder / "held_out" / f"{name}.csv", held_out_columns(held))
        samples = sample_columns(held)
        if samples:
            write_csv(folder / "held_out" / f"{name}-samples.csv", samples)


class ConditionsTable(FromFitTable):
    """``[conditions]``: `at` and `leave_out` as the command line takes them.

    Where the fit takes the best supported model of each record, the study takes that of all records together.
    """

    separate: ClassVar[bool] = True
    model: str | None = None
    at: Texts = ()
    leave_out: Texts = ()
    scatter: float = Field(default=PRIOR_MEDIAN_SCATTER, gt=0.0, le=SCATTER_LIMIT.value)


def _told(stated: Mapping[str, Any]) -> str:
    found = ConditionsDocument.model_validate(stated)
    told = [found.sure_directions]
    if found.predictions:
        told.append(f"{len(found.predictions)} predicted")
    if found.held_out:
        told.append(f"{len(found.held_out)} left out")
    return ", ".join(told)


STEP: Final = StudyStep(
    ConditionsTable,
    CONDITIONS,
    study_conditions,
    _told,
    lambda o: temperatures(o, lambda text: condition_at(text, specimen="stress_MPa" in text)),
)
