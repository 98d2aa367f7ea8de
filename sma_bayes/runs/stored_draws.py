"""The posteriors of a finished fit, read back for the study of its conditions."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from sma_bayes.assess.draws import RecordDraws
from sma_bayes.errors import OutputError
from sma_bayes.fitting.discrepancy import between_sweeps_fact, size_fact
from sma_bayes.fitting.fit import calibration_errors, calibrations_of
from sma_bayes.fitting.posterior import ParameterIndex, Posterior
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.noise.heteroscedastic import temperature_sd_fact
from sma_bayes.parameters.distributions import FAMILIES
from sma_bayes.parameters.space import Parameter, ParameterSpace
from sma_bayes.quantities import SPECIMEN_QUANTITY
from sma_bayes.records.types import Branch, Calibration, Condition, HeldChannel, Record
from sma_bayes.response import RESPONSE_MODELS
from sma_bayes.runs.documents import FINISH_HINT
from sma_bayes.runs.fit_document import ParameterSummary, RecordSummary, refuse_shared_parameters
from sma_bayes.runs.outputs import StoredRecord, posterior_of, posterior_path, read_run


def stored_draws(folder: str | Path) -> tuple[RecordDraws, ...]:
    """Draws of all records of a fit, with the densities that they were drawn from.

    Parameters
    ----------
    folder : str or Path
        Output folder of a finished `fit` or `demo`.

    Raises
    ------
    OutputError
        If it holds no finished fit, or one in which conditions share their parameters.
    """
    run = read_run(Path(folder))
    pooled = run.summary.options.pool != "none"
    refuse_shared_parameters(pooled, run.folder, "from which their differences are learnt")
    return tuple(draws_of(run.folder, r, run.summary.seed) for r in run.summary.records)


def draws_of(folder: Path, summary: RecordSummary, seed: int) -> RecordDraws:
    """Draws of one record of a fit.

    Parameters
    ----------
    folder : Path
        Of the fit.
    summary : RecordSummary
        The record's entry in ``summary.json``.
    seed : int
        Of the fit.

    Raises
    ------
    OutputError
        If its posterior is damaged or does not belong to the summary.
    """
    path = posterior_path(folder, summary.key)
    stored = posterior_of(folder, summary.key, summary.posterior_sha256)
    try:
        posterior = _posterior(summary, stored)
        theta = np.stack([stored.draws[n].reshape(-1) for n in posterior.space.names], axis=-1)
    except (KeyError, ValueError, TypeError) as error:
        raise OutputError(
            f"does not agree with summary.json: {error}",
            file=path,
            expected="the posterior that this fit wrote",
            remedy=FINISH_HINT,
        ) from None
    record = posterior.records[0]
    errors = calibration_errors(calibrations_of(record), seed, record.key, len(theta))
    weights = {c: w for c, (_, _, w) in stored.discrepancy.items()}
    draws = RecordDraws(posterior, theta, summary.converged, weights, errors)
    if not stored.measured_sweeps:
        return draws
    measured = draws.before_calibration.copy()
    for name, values in stored.measured_sweeps.items():
        measured[:, posterior.space.names.index(name)] = values.reshape(-1)
    return replace(draws, measured_sweeps=measured)


def _posterior(summary: RecordSummary, stored: StoredRecord) -> Posterior:
    record = _record(summary, stored)
    model = RESPONSE_MODELS[stored.model].made_for([record])
    noise = NOISE_MODELS[stored.noise]
    names = list(model.parameter_names)
    bases = stored.bases()
    noises, sizes, between = {}, {}, {}
    for channel in record.channels:
        facts = noise.parameters(channel, record.units[channel], record.units.get("time", "s"))
        noises[channel] = len(names) + np.arange(len(facts))
        names += [f.name for f in facts]
        if channel in bases:
            sizes[channel] = len(names)
            names.append(size_fact(channel, record.units[channel]).name)
            if bases[channel].sweep_functions is not None:
                between[channel] = len(names)
                names.append(between_sweeps_fact(channel, record.units[channel]).name)
    felt = None
    if noise.feels_temperature:
        felt = len(names)
        names.append(temperature_sd_fact(record.units["temperature"]).name)
    space = ParameterSpace(tuple(_parameter(n, summary.parameters[n]) for n in names))
    place = ParameterIndex(np.arange(len(model.parameter_names)), noises, sizes, felt, between)
    return Posterior((record,), model, noise, space, (place,), (bases,))


def _record(summary: RecordSummary, stored: StoredRecord) -> Record:
    temperature, quantities = summary.temperature, summary.quantities
    return Record(
        condition=Condition(summary.condition, **summary.settings),
        branch=Branch(summary.branch),
        inputs=stored.inputs,
        observed={c: stored.observed[c] for c in summary.channels},
        row=stored.row,
        units={
            "temperature": temperature.unit,
            **{c: quantities[c].unit for c in summary.channels},
            **{c: h.unit for c, h in summary.held.items()},
        },
        specimen=bool({q.name for q in quantities.values()} & set(SPECIMEN_QUANTITY.values())),
        temperature_sd=temperature.sd or 0.0,
        calibration={c: Calibration(**k.as_json()) for c, k in summary.calibration.items()},
        held={c: HeldChannel(h.mean, h.sd) for c, h in summary.held.items()},
        rows_averaged=summary.rows_averaged,
    )


def _parameter(name: str, stated: ParameterSummary) -> Parameter:
    kind = FAMILIES[str(stated.prior["family"])]
    prior = kind(**{f.name: stated.prior[f.name] for f in fields(kind) if f.name in stated.prior})
    fixed = stated.median if stated.fixed else None
    return Parameter(name, stated.unit, stated.meaning, prior, str(stated.prior["source"]), fixed)
