"""What the numbers of a finished fit rest on, from its folder to files."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from operator import call
from pathlib import Path
from typing import Any, ClassVar, Final

from sma_bayes.account import Account
from sma_bayes.errors import QuantityError, require_seed
from sma_bayes.progress import Progress, silent
from sma_bayes.report.choice import REPORT, figures_for
from sma_bayes.runs.declared_units import declared_parts, shown_units
from sma_bayes.runs.documents import SENSITIVITY
from sma_bayes.runs.fit_document import RecordSummary, refuse_shared_parameters
from sma_bayes.runs.jobs import run as run_tasks
from sma_bayes.runs.outputs import read_run
from sma_bayes.runs.store import write_csv
from sma_bayes.runs.stored_draws import draws_of
from sma_bayes.sampling.pareto import MAX_RELIABLE_K
from sma_bayes.sampling.power_scaling import THRESHOLD
from sma_bayes.studies.ask.workflow import FitSource, asked_temperature
from sma_bayes.studies.identity import fit_identity, of_fit
from sma_bayes.studies.run_context import RunContext
from sma_bayes.studies.sensitivity.quantities import stated_temperatures
from sma_bayes.studies.sensitivity.schema import RecordSensitivity, SensitivityFindings, Thresholds
from sma_bayes.studies.sensitivity.shown import record_shown
from sma_bayes.studies.sensitivity.study import CONFLICT_SHIFT, studied
from sma_bayes.studies.sensitivity.words import conclusion
from sma_bayes.studies.study_step import FromFitTable, StudyStep, Texts, temperatures


def sensitivity(
    folder: str | Path,
    out: str | Path | None = None,
    *,
    at: str | Sequence[str] = (),
    seed: int = 0,
    jobs: int | None = None,
    resume: bool = False,
    figures: str | bool = REPORT,
    progress: Progress | None = None,
    account: Account | None = None,
) -> dict[str, Any]:
    """Tell what the numbers of a fit rest on: prior, likelihood, single sweeps and readings.

    Parameters
    ----------
    folder : str or Path
        Output folder of a finished `fit` or `demo`.
    out : str or Path, optional
        Folder for `sensitivity.json`, `readings/`, tables, figures and the report; nothing is written without it.
    at : str or sequence of str
        Temperatures with their unit, ``"60 degC"``, at which stiffness is told; by default three within the measured
        range of each record.
    seed : int
        Decides fits made anew and weights of the bootstrap; the draws are those of the fit.
    resume : bool
        Where `out` holds this very study already, only what is missing of its report is made.
    jobs, figures, progress, account
        See `fit_campaign`.

    Returns
    -------
    dict
        What `sensitivity.json` holds.

    Raises
    ------
    OutputError, ResumeError
        If `folder` holds no finished fit, or one whose conditions share parameters, or `out` can't be used.
    QuantityError
        If a temperature has no unit, a wrong one, or was not measured by any record.

    Notes
    -----
    Sensitivities are those of Kallioinen et al. (2024), as arviz-stats computes them from the draws; priors are
    densities of the sampled coordinates: of the logarithm of a parameter that has a sign, of the probit of one that has
    bounds.
    """
    require_seed(seed)
    work = RunContext(SENSITIVITY, jobs, figures_for(figures), progress or silent, account or Account())
    with work.account.timed("read"):
        run = read_run(Path(folder))
    source = FitSource(run.folder, run.summary, partial(draws_of, run.folder, seed=run.summary.seed))
    asked = (at,) if isinstance(at, str) else tuple(at)
    check(source, asked)
    identity = fit_identity(SENSITIVITY.verb, run.summary, {"at": list(asked), "seed": seed})
    return work.execute(out, identity, resume, lambda place: find(source, asked, seed, place, work))


def sensitivity_of(
    source: FitSource, at: str | Sequence[str] = (), seed: int = 0, jobs: int | None = None
) -> dict[str, Any]:
    """Tell what the numbers of a fit rest on, wherever it is; see `sensitivity`."""
    require_seed(seed)
    asked = (at,) if isinstance(at, str) else tuple(at)
    check(source, asked)
    return find(source, asked, seed, None, RunContext(SENSITIVITY, jobs, "none")).as_json()


def check(source: FitSource, at: Sequence[str]) -> None:
    """Refuse what can't be studied.

    Raises
    ------
    OutputError
        If conditions share their parameters.
    QuantityError
        If a temperature can't be read, or no record has measured it.
    """
    records = source.summary.records
    shared = any(r.shares_parameters_with for r in records)
    refuse_shared_parameters(shared, source.folder, "which a sweep or a reading of it can move")
    for text in at:
        if not any(_measured(r, text) for r in records):
            ranges = ", ".join(
                f"{r.temperature.lowest:.4g} to {r.temperature.highest:.4g} {r.temperature.unit} ({r.key})"
                for r in records[:3]
            )
            raise QuantityError(
                f"temperature {text!r} was measured by no record",
                file=source.folder,
                expected=f"a temperature that was measured: {ranges}{', ...' if len(records) > 3 else ''}",
            )


def _measured(r: RecordSummary, text: str) -> bool:
    return (
        r.temperature.lowest
        <= asked_temperature(text, r.temperature.unit, r.temperature.unit)
        <= r.temperature.highest
    )


def find(
    source: FitSource, at: Sequence[str], seed: int, folder: Path | None, work: RunContext
) -> SensitivityFindings:
    """Study all records; write the influence of their readings to a folder, if there is one."""
    summary = source.summary
    tasks = []
    for r in summary.records:
        draws, unit = source.draws(r), r.temperature.unit
        asked = tuple(asked_temperature(text, unit, unit) for text in at if _measured(r, text))
        told = asked if at else stated_temperatures(draws)
        tasks.append(partial(studied, draws, told, bool(r.quantities_of_branch), seed))
    found: list[RecordSensitivity] = []
    units = shown_units(summary.records)
    work.tell(0, len(tasks), "studying")
    for one in run_tasks(call, tasks, work.jobs, account=work.account, stage="sensitivity"):
        found.append(one.found)
        work.tell(len(found), len(tasks), f"studied {one.found.key}")
        if folder is not None:
            write_csv(folder / "readings" / f"{one.found.key}.csv", one.readings)
    return SensitivityFindings(
        schema="sma-bayes/sensitivity/1",
        at=tuple(at),
        **of_fit(summary, source.folder, seed),
        converged=all(r.converged for r in found),
        thresholds=Thresholds(sensitivity=THRESHOLD, without_prior=CONFLICT_SHIFT, pareto_k=MAX_RELIABLE_K),
        records=tuple(found),
        **declared_parts(summary.records),
        conclusion=conclusion([record_shown(r, units) for r in found]),
    )


class SensitivityTable(FromFitTable):
    """``[sensitivity]``: what the numbers of the fit rest on."""

    separate: ClassVar[bool] = True
    at: Texts = ()


STEP: Final = StudyStep(
    SensitivityTable,
    SENSITIVITY,
    sensitivity,
    lambda found: str(found["conclusion"]),
    questions=lambda o, record: temperatures(
        o, lambda text: asked_temperature(text, *[record.units["temperature"]] * 2)
    ),
)
