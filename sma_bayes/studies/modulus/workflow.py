"""Studying moduli, from exports to files."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Final

import numpy as np
from pydantic import Field

from sma_bayes import __version__
from sma_bayes.account import Account
from sma_bayes.assess.adequacy import SENTENCES
from sma_bayes.errors import require_known, require_seed
from sma_bayes.fitting.curves import as_interval
from sma_bayes.fitting.posterior import versions
from sma_bayes.progress import Progress, silent
from sma_bayes.quantities import unit_text
from sma_bayes.records.dmta import DeclaredDamping, DmtaCampaign, DmtaOptions, DmtaSweep, read_dmta
from sma_bayes.report.choice import REPORT, figures_for
from sma_bayes.report.notation import compact, write_interval
from sma_bayes.response import AUTO_MODEL, LOSS_LADDER, STORAGE_LADDER, ResponseModel
from sma_bayes.runs.declared_units import ShownUnit, declared_parts
from sma_bayes.runs.documents import MODULUS
from sma_bayes.runs.jobs import run
from sma_bayes.runs.schema import DeclaredUnits, FindingDocument, IntervalDocument
from sma_bayes.runs.store import write_csv, write_json
from sma_bayes.studies.ask.workflow import asked_temperature
from sma_bayes.studies.identity import all_versions
from sma_bayes.studies.modulus.schema import (
    FrequencyShift,
    Modulus,
    ModulusByFrequency,
    ModulusFindings,
    ModulusOptions,
    ModulusSweep,
    ShiftPoint,
)
from sma_bayes.studies.modulus.shift import (
    LEVELS,
    SCATTER_OF_MODULUS,
    arrhenius,
    fit_line,
)
from sma_bayes.studies.modulus.shown import degrees_of
from sma_bayes.studies.modulus.sweep import LOSS, STORAGE, SweepFound, study_sweep
from sma_bayes.studies.run_context import RunContext
from sma_bayes.studies.study_step import DrawnTable, StudyStep, Texts

SHIFTED: Final = ("midpoint", "loss_peak", "tan_delta_peak")
"""Temperatures whose shift with frequency is told."""
INSIDE: Final = 0.05
"""How far within the common range of all sweeps moduli are told by default, as a share of it."""
PARTS: Final = "parts"
_DECADE: Final = float(np.log(10.0))


def modulus(
    paths: str | Path | Sequence[str | Path],
    out: str | Path | None = None,
    *,
    at: Sequence[str] = (),
    model: str = AUTO_MODEL,
    loss_model: str = AUTO_MODEL,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    frequency: str = "",
    encoding: str | None = None,
    seed: int = 0,
    jobs: int | None = None,
    resume: bool = False,
    figures: str | bool = REPORT,
    progress: Progress | None = None,
    account: Account | None = None,
) -> dict[str, Any]:
    """Fit storage and loss modulus against temperature, frequency by frequency, and tell how they shift.

    The storage modulus of each branch and frequency is a bounded transition between two phases: logistic, with slopes,
    skewed, in two stages or with a minimum in the transformation, whichever is best supported. The loss modulus is a
    peak above a step. From both posteriors follow tan delta, temperatures of the transition and their shift with
    frequency.

    Parameters
    ----------
    paths : str, Path or sequence of these
        Exports of dynamic mechanical analysis of one material: delimited text or XLSX.
    out : str or Path, optional
        Folder for `modulus.json`, `bands/`, tables, figures and the report; nothing is written without it.
    at : sequence of str
        Temperatures, ``"60 degC"``, at which moduli are told; by default three over what all sweeps have in common.
    model, loss_model : str
        Response models of storage and loss modulus, or ``auto``: the best supported of their ladders.
    columns, units : mapping of str to str, optional
        Name of the column of a quantity, and unit of a quantity where the files do not state it. Quantities are
        ``temperature``, ``storage_modulus``, ``loss_modulus``, ``tan_delta``, ``frequency`` and ``time``.
    frequency : str
        Frequency with its unit, ``"1 Hz"``, of files that have no column of it.
    encoding : str, optional
        Of text.
    seed : int
        Seed of all random draws.
    resume : bool
        Go on with the run that `out` holds; sweeps that it has finished are not fitted again.
    jobs, figures, progress, account
        See `fit_campaign`.

    Returns
    -------
    dict
        What `modulus.json` holds.

    Raises
    ------
    MeasurementError
        If a file can't be used, see `sma_bayes.records.dmta.read_dmta`.
    QuantityError, UnknownNameError
        If a temperature, a unit or a model can't be used.
    OutputError, ResumeError
        If `out` can't be used.
    """
    require_seed(seed)
    account = account or Account()
    models: dict[Modulus, str] = {
        STORAGE: _model(model, STORAGE_LADDER),
        LOSS: _model(loss_model, LOSS_LADDER),
    }
    asked = tuple(asked_temperature(text, "degC", "degC") for text in at)
    said = DmtaOptions(columns or {}, units or {}, frequency, encoding)
    with account.timed("read"):
        campaign = read_dmta([paths] if isinstance(paths, str | Path) else paths, said)
    told = asked or _usual(campaign.sweeps)
    options = ModulusOptions(
        model=model,
        loss_model=loss_model,
        at=told,
        columns=dict(said.columns),
        units=dict(said.units),
        frequency=frequency,
    )
    identity = {
        "schema": "sma-bayes/run/1", "kind": MODULUS.verb, "data": campaign.sha256,
        "records": [s.id for s in campaign.sweeps], "seed": seed, **options.as_json(), "version": __version__,
        "versions": versions(),
    }  # fmt: skip
    work = RunContext(MODULUS, jobs, figures_for(figures), progress or silent, account)
    study = partial(study_sweep, models=models, at=told, seed=seed)

    units_declared = declared_parts([s.storage for s in campaign.sweeps])
    declared = DeclaredUnits(**units_declared)
    degrees = degrees_of(declared, difference=True)

    def find(folder: Path | None) -> ModulusFindings:
        sweeps = _sweeps(campaign.sweeps, study, folder, work)
        shifts = shifts_of(sweeps, degrees)
        damping = tuple({(s.test, s.frequency): s.damping for s in campaign.sweeps if s.damping}.values())
        return ModulusFindings.about(
            campaign,
            schema="sma-bayes/modulus/1",
            seed=seed,
            options=options,
            temperature_unit="degC",
            modulus_unit="Pa",
            **units_declared,
            versions=all_versions(),
            data_sha256=campaign.sha256,
            converged=all(c.converged for s in sweeps for c in s.curves),
            sweeps=sweeps,
            damping=damping,
            shifts=shifts,
            by_frequency=tuple(_by_frequency(sweeps, told)),
            remarks=tuple(_remarks(campaign, sweeps, told, damping, degrees_of(declared))),
            findings=tuple(map(FindingDocument.about, campaign.findings)),
        )

    found = work.execute(out, identity, resume, find)
    if out is not None:
        parts = Path(out) / PARTS
        for path in parts.glob("*.json"):
            path.unlink(missing_ok=True)
        with suppress(OSError):  # somebody else's file in it does no harm
            parts.rmdir()
    return found


def _model(name: str, ladder: Sequence[type[ResponseModel]]) -> str:
    known = [AUTO_MODEL, *(m.name for m in ladder)]
    require_known(
        name,
        known,
        f"the model {name!r} is not a bounded curve of this modulus",
        remedy=f"choose one of {', '.join(known)}",
    )
    return name


def _usual(sweeps: Sequence[DmtaSweep]) -> tuple[float, ...]:
    """Three temperatures that all sweeps went through; those of the first where they have none in common."""
    low = max(float(s.storage.temperature.min()) for s in sweeps)
    high = min(float(s.storage.temperature.max()) for s in sweeps)
    if not low < high:
        low, high = float(sweeps[0].storage.temperature.min()), float(sweeps[0].storage.temperature.max())
    ends = low + INSIDE * (high - low), high - INSIDE * (high - low)
    return tuple(float(round(t, 1)) for t in (ends[0], 0.5 * (ends[0] + ends[1]), ends[1]))


# sweeps


def _sweeps(
    sweeps: Sequence[DmtaSweep],
    study: Callable[[DmtaSweep], SweepFound],
    folder: Path | None,
    work: RunContext,
) -> tuple[ModulusSweep, ...]:
    """The part of each sweep; those that an interrupted run has finished are read."""
    done = {} if folder is None else {s.id: part for s in sweeps if (part := _read_part(folder, s.id))}
    left = [s for s in sweeps if s.id not in done]
    for found in run(study, left, work.jobs, account=work.account, stage="fit"):
        name = found.document.id
        done[name] = found.document
        if folder is not None:
            with work.account.timed("write"):
                write_csv(folder / "samples" / f"{name}.csv", found.samples)
                write_csv(folder / "bands" / f"{name}.csv", found.bands)
                write_json(folder / PARTS / f"{name}.json", found.document.as_json())
        work.tell(len(done), len(sweeps), f"fitted {name}")
    return tuple(done[s.id] for s in sweeps)


def _read_part(folder: Path, name: str) -> ModulusSweep | None:
    path = folder / PARTS / f"{name}.json"
    beside = (folder / kind / f"{name}.csv" for kind in ("bands", "samples"))
    if not all(p.is_file() for p in (path, *beside)):
        return None
    try:
        return ModulusSweep.model_validate(json.loads(path.read_text(encoding="utf-8")))
    except ValueError:  # whoever changed it: the sweep is fitted again
        return None


# what sweeps tell together


def _interval(values: Sequence[float]) -> IntervalDocument:
    return IntervalDocument(**as_interval(values))


def shifts_of(sweeps: Sequence[ModulusSweep], degrees: ShownUnit) -> tuple[FrequencyShift, ...]:
    """Shift with frequency of each temperature of a branch, where at least one sweep states a frequency.

    Parameters
    ----------
    sweeps : sequence of ModulusSweep
    degrees : ShownUnit
        How the statements show differences of temperature.
    """
    out = []
    for branch in dict.fromkeys(s.branch for s in sweeps):
        for name in SHIFTED:
            points = [
                ShiftPoint(sweep=s.id, frequency=frequency, temperature=t.mean, sd=t.sd)
                for frequency, s in _by_rising_frequency(sweeps, branch)
                for t in s.temperatures
                if t.name == name and t.identified and t.mean is not None and t.sd is not None
            ]
            if points:
                out.append(_shift(branch, name, points, degrees))
    return tuple(out)


def _by_rising_frequency(sweeps: Sequence[ModulusSweep], branch: str) -> list[tuple[float, ModulusSweep]]:
    """Sweeps of a branch that state a frequency, with it."""
    own = ((s.frequency, s) for s in sweeps if s.branch == branch and s.frequency is not None)
    return sorted(own, key=lambda pair: pair[0])


def _shift(branch: str, name: str, points: Sequence[ShiftPoint], degrees: ShownUnit) -> FrequencyShift:
    frequency, temperature, sd = (
        np.array(values) for values in zip(*((p.frequency, p.temperature, p.sd) for p in points), strict=True)
    )
    title = name.replace("_", " ")
    untold = FrequencyShift(
        branch=branch,
        temperature=name,
        points=tuple(points),
        shift=None,
        probability_rises=None,
        scatter=None,
        activation_energy=None,
        least_energy=None,
        identified=False,
        statement=f"{title}: one frequency, no shift can be told",
    )
    if np.unique(frequency).size < 2:
        return untold
    found = arrhenius(frequency, temperature, sd)
    low, middle, high = (degrees.factor * q for q in found.shift)
    told, least, most = (
        f"{'+' if q > 0.0 else ''}{text}"
        for q, text in zip((middle, low, high), write_interval(middle, low, high).plain, strict=True)
    )
    shift = f"{told} {unit_text(degrees.shown)} per decade of frequency ({least} to {most})"
    if found.energy is None:
        told = (
            f"{title}: shift of {shift}; the interval holds zero, at which the apparent activation energy is infinite: "
            f"it is not identified, above {compact(found.least / 1e3)} kJ/mol if positive (95 %)"
        )
    else:
        low, middle, high = (e / 1e3 for e in found.energy)
        told = "{}: shift of {}; apparent activation energy {} kJ/mol ({} to {})".format(
            title, shift, *write_interval(middle, low, high).plain
        )
        if middle < 0.0:
            told += ": the temperature falls with frequency, as no thermally activated process does"
    return untold.but(
        shift=_interval(found.shift),
        probability_rises=found.probability_rises,
        scatter=_interval(found.scatter),
        activation_energy=None if found.energy is None else _interval(found.energy),
        least_energy=found.least,
        identified=found.energy is not None,
        statement=told.replace("+-", "-"),
    )


def _by_frequency(sweeps: Sequence[ModulusSweep], at: Sequence[float]) -> Iterator[ModulusByFrequency]:
    for branch in dict.fromkeys(s.branch for s in sweeps):
        own = _by_rising_frequency(sweeps, branch)
        if len({frequency for frequency, _ in own}) < 2:
            continue
        for t in at:
            values = [next(v for v in s.values if v.channel == STORAGE and v.at == t) for _, s in own]
            if any(v.log_mean is None for v in values):
                continue
            x = np.log([frequency for frequency, _ in own])
            y, sd = np.array([(v.log_mean, v.log_sd) for v in values], dtype=float).T
            line = fit_line(x, y, sd, SCATTER_OF_MODULUS)
            yield ModulusByFrequency(
                branch=branch,
                at=t,
                sweeps=tuple(s.id for _, s in own),
                factor=_interval([float(np.exp(_DECADE * q)) for q in line.slope_quantiles(LEVELS)]),
                probability_rises=line.probability_above(0.0),
            )


def _remarks(
    campaign: DmtaCampaign,
    sweeps: Sequence[ModulusSweep],
    at: Sequence[float],
    damping: Sequence[DeclaredDamping],
    degrees: ShownUnit,
) -> Iterator[str]:
    for d in damping:
        if d.disagree:
            where = d.test if d.frequency is None else f"{d.test} at {d.frequency:g} Hz"
            yield (
                f"{where}: declared tan delta and E''/E' disagree in {d.disagree} of {d.compared} rows, most in "
                f"row {d.row}, by {d.greatest:.1%} of the greatest; the moduli are taken"
            )
    if any(s.loss_from_tan_delta for s in campaign.sweeps):
        yield "no loss modulus is declared: it is tan delta times the storage modulus"
    if any(s.frequency is None for s in sweeps):
        yield "a frequency is not stated: no shift follows from such sweeps; --frequency states it"
    for s in sweeps:
        yield from [
            f"{s.id}: {degrees.value(t):.6g} {unit_text(degrees.shown)} is beyond the measured temperatures, what is "
            "told there is an extrapolation"
            for t in at if not s.temperature_from <= t <= s.temperature_to
        ]  # fmt: skip
        for c in s.curves:
            which = f"{s.id}, {c.channel.replace('_', ' ')}"
            if c.computed:
                yield f"{which}: {SENTENCES['exact'].format(what='it')}"
            elif not c.converged:
                yield f"{which}: not converged"


class ModulusTable(DrawnTable):
    """``[modulus]``: exports of dynamic mechanical analysis of the material; the campaign has no part in it."""

    paths: ClassVar[tuple[str, ...]] = ("files",)
    files: Texts = Field(min_length=1)
    at: Texts = ()
    model: str = AUTO_MODEL
    loss_model: str = AUTO_MODEL
    columns: dict[str, str] = Field(default_factory=dict)
    units: dict[str, str] = Field(default_factory=dict)
    frequency: str = ""
    encoding: str | None = None


STEP: Final = StudyStep(ModulusTable, MODULUS, modulus, lambda found: f"{len(found['sweeps'])} sweeps")
