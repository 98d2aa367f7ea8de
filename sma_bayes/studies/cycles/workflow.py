"""Studying cycles, from a campaign to files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from pydantic import Field

from sma_bayes.account import Account
from sma_bayes.arrays import Floats
from sma_bayes.assess.transformation import LEAST_SHARE_OF_DRAWS
from sma_bayes.errors import MeasurementError, SmaBayesError, many
from sma_bayes.fitting.curves import INTERVAL, as_interval, interval, interval_where_defined
from sma_bayes.progress import Progress, announce, silent
from sma_bayes.quantities import unit_text
from sma_bayes.records.types import Campaign, Record
from sma_bayes.report.choice import REPORT, figures_for
from sma_bayes.response import DEFAULT_MODEL
from sma_bayes.runs.declared_units import declared_parts, shown_as, shown_units
from sma_bayes.runs.documents import CYCLES
from sma_bayes.runs.jobs import run
from sma_bayes.runs.schema import IntervalDocument, interval_document
from sma_bayes.runs.store import or_nan, write_csv
from sma_bayes.studies.ask.workflow import asked_temperature
from sma_bayes.studies.cycles.expected import expected_s
from sma_bayes.studies.cycles.laws import LAWS, LEAST_LN_EVIDENCE_GAIN, N0_GRID, NONE
from sma_bayes.studies.cycles.mean_sweep import mean_sweep
from sma_bayes.studies.cycles.schema import (
    ChangeOfNumber,
    CommonCurve,
    ConditionCycles,
    CyclesFindings,
    CyclesOptions,
    Law,
    LawOfTraining,
    QuantityByCycle,
    Stability,
)
from sma_bayes.studies.cycles.study import (
    CycleSeries,
    Pooled,
    changes,
    held_out,
    measured_cycles,
    pool,
    probability_stable,
    quantities,
)
from sma_bayes.studies.cycles.sweeps import NUMBERS, Strand, calibration_remarks, fit_strand, sweeps_of
from sma_bayes.studies.identity import of_campaign, run_identity
from sma_bayes.studies.options import FitOptions, prior_set
from sma_bayes.studies.run_context import RunContext
from sma_bayes.studies.study_step import DrawnTable, StudyStep, Texts, temperatures
from sma_bayes.threads import one_thread

STABLE_SHARE: Final = 0.02
STABLE_PROBABILITY: Final = 0.9
FORECAST_CYCLES: Final = 10
MOST_CYCLES: Final = 500
"""Most cycles of a condition, those that are forecast included: matrices grow with their square."""
FEWEST_CYCLES: Final = 2
CURVE_POINTS: Final = 41


def cycles(
    campaign: Campaign,
    out: str | Path | None = None,
    *,
    at: Sequence[str] = (),
    share: float = STABLE_SHARE,
    probability: float = STABLE_PROBABILITY,
    ahead: int = FORECAST_CYCLES,
    model: str = DEFAULT_MODEL,
    seed: int = 0,
    jobs: int | None = None,
    resume: bool = False,
    figures: str | bool = REPORT,
    progress: Progress | None = None,
    account: Account | None = None,
) -> dict[str, Any]:
    """Tell cycle by cycle what every sweep is, by which law it settles, when it is stable, and what comes.

    Every sweep is the common curve of its branch with four numbers: offset, stroke, shift in temperature, and width
    (the shape-invariant model), told against the mean of the measured sweeps. These are pooled over cycles under a law
    of training, exponential, stretched or logarithmic, with paces about one N0, or under none, with a random effect of
    the sweep and a random walk.

    Parameters
    ----------
    campaign : Campaign
    out : str or Path, optional
        Folder for `cycles.json`, CSV files, tables, figures and the report; nothing is written without it.
    at : sequence of str
        Temperatures, ``"60 degC"``, at which channels and stiffness are told; by default the middle of those that were
        measured.
    share : float
        A curve is stable while it changes by at most this share of its stroke from one cycle to the next [1].
    probability : float
        With which it is to be stable [1].
    ahead : int
        Cycles that are forecast.
    model : str
        Name of the response model of the common curves; ``auto``: for each that with the least BIC of the ladder.
    seed : int
        Seed of all random draws.
    resume : bool
        Where `out` holds this very study already, only what is missing of its report is made.
    jobs, figures, progress, account
        See `fit_campaign`.

    Returns
    -------
    dict
        What `cycles.json` holds.

    Raises
    ------
    MeasurementError
        If no condition has sweeps of two cycles, or one has more than can be pooled.
    SmaBayesError, QuantityError, UnknownNameError
        If an option is out of range.
    OutputError, ResumeError
        If `out` can't be used.
    """
    _check(share, probability, ahead)
    options = FitOptions(prior_set(None, model), seed, model=model)
    groups, left_out = _groups(campaign, ahead)
    unit = campaign.records[0].units["temperature"]
    asked = tuple(asked_temperature(text, unit, unit) for text in at)
    work = RunContext(CYCLES, jobs, figures_for(figures), progress or silent, account or Account())
    stated = CyclesOptions(model=model, at=tuple(at), share=share, probability=probability, ahead=ahead)
    identity = {**run_identity(campaign, options), "kind": CYCLES.verb, **stated.as_json()}
    study = partial(_studied, asked=asked, options=stated, seed=seed)

    def find(folder: Path | None) -> CyclesFindings:
        size = [(len(own), _reach(own, ahead)) for own, _ in groups]
        announce(work.tell, expected_s(size, jobs), f"{many(len(groups), 'condition')}, pooling cycles")
        found = []
        for parts in run(study, groups, jobs, account=work.account, stage="study"):
            found.append(parts.document)
            work.tell(len(found), len(groups), f"pooled {parts.document.condition}")
            if folder is not None:
                with work.account.timed("write"):
                    for name, columns in parts.curves.items():
                        write_csv(folder / "curves" / name, columns)
        if folder is not None:
            write_csv(folder / "quantities.csv", quantity_columns(found))
        return CyclesFindings(
            schema="sma-bayes/cycles/1",
            options=stated,
            temperature_unit=unit,
            specimen=campaign.records[0].specimen,
            **declared_parts(campaign.records),
            **of_campaign(campaign, seed),
            converged=all(c.converged for one in found for c in one.curves),
            conditions=tuple(found),
            left_out=tuple(left_out),
        )

    with one_thread():
        return work.execute(out, identity, resume, find)


def _check(share: float, probability: float, ahead: int) -> None:
    if not 0.0 < share <= 1.0:
        raise SmaBayesError(f"--share {share:g}", expected="a share of the stroke above 0 and at most 1")
    if not 0.0 < probability < 1.0:
        raise SmaBayesError(f"--probability {probability:g}", expected="a number between 0 and 1")
    if not 1 <= ahead <= MOST_CYCLES:
        raise SmaBayesError(f"--ahead {ahead}", expected=f"a number of cycles from 1 to {MOST_CYCLES}")


Sweeps = tuple[Record, str, Floats]
"""Sweeps of a channel: the record with them, the channel, their cycles."""


def _groups(campaign: Campaign, ahead: int) -> tuple[list[tuple[list[Sweeps], list[str]]], list[str]]:
    """Sweeps of each condition with remarks, and conditions that are left out, in words."""
    found: list[tuple[list[Sweeps], list[str]]] = []
    left_out = []
    for name in dict.fromkeys(r.condition.id for r in campaign.records):
        own: list[Sweeps] = []
        told: list[str] = []
        most = 0
        for record in (r for r in campaign.records if r.condition.id == name):
            for channel in record.channels:
                sweeps, cycle, remarks = sweeps_of(record, channel)
                told += [r for r in remarks if r not in told]
                most = max(most, cycle.size)
                if cycle.size >= FEWEST_CYCLES:
                    own.append((sweeps, channel, cycle))
        if not own:
            left_out.append(f"{name}: sweeps of {most} cycle{'' if most == 1 else 's'}")
            continue
        reach = _reach(own, ahead)
        if reach > MOST_CYCLES:
            raise MeasurementError(
                f"{name} goes over {reach:.0f} cycles, those that are forecast included",
                expected=f"at most {MOST_CYCLES}",
                remedy="declare time_from and time_to in [segmentation], or give a smaller --ahead",
            )
        found.append((own, told))
    if not found:
        raise MeasurementError(
            f"no condition has sweeps of two cycles: {'; '.join(left_out)}",
            file=campaign.source or None,
            expected="at least two cycles of one condition, each with a sweep of 8 samples or more",
            remedy="record more cycles; `sma-bayes inspect` tells which sweeps were found",
        )
    return found, left_out


def _reach(own: Sequence[Sweeps], ahead: int) -> float:
    """Cycles that a condition goes over, those that are forecast included."""
    return float(max(c.max() for _, _, c in own) - min(c.min() for _, _, c in own) + 1 + ahead)


@dataclass(frozen=True, slots=True, eq=False)
class _StudiedCondition:
    document: ConditionCycles
    curves: dict[str, dict[str, Any]]


def _studied(
    group: tuple[Sequence[Sweeps], Sequence[str]], asked: tuple[float, ...], options: CyclesOptions, seed: int
) -> _StudiedCondition:
    sweeps, remarks = group
    strands = [fit_strand(r, channel, cycle, options.model, seed) for r, channel, cycle in sweeps]
    pooled = pool(strands, options.ahead, seed)
    ends = np.array([s.ends for s in strands])
    at = asked or (float(np.round(0.5 * (ends[:, 0].max() + ends[:, 1].min()))),)
    condition = strands[0].record.condition.id
    document = ConditionCycles(
        condition=condition,
        cycles=pooled.cycle.astype(int).tolist(),
        measured=measured_cycles(strands).tolist(),
        curves=tuple(_curve(s) for s in strands),
        law=_law(pooled),
        changes=tuple(_changes(pooled)),
        stable=_stable(pooled, options.share, options.probability),
        held_out=tuple(held_out(strands, seed)),
        quantities=tuple(_by_cycle(q) for q in quantities(pooled, at)),
        remarks=(*remarks, *_remarks(strands, at)),
    )
    return _StudiedCondition(
        document, {f"{s.record.key}-{s.channel}.csv": _columns(pooled, i) for i, s in enumerate(strands)}
    )


def _curve(s: Strand) -> CommonCurve:
    mean = mean_sweep(s, s.numbers[None], None, np.arange(s.cycle.size))
    return CommonCurve.about(
        s,
        branch=s.record.branch.value,
        model=s.model.name,
        parameters=dict(zip(s.model.parameter_names, s.theta.tolist(), strict=True)),
        midpoint=float(mean.middle[0]),
        level=float(mean.level[0]),
        span=float(mean.span[0]),
        missed=s.noise / s.range,
        own_shape=s.own_rms / s.range,
        reading_noise=s.reading_noise,
    )


def _law(pooled: Pooled) -> LawOfTraining:
    p = pooled.posterior
    best: Law = NONE
    n0 = None
    if p.testable:
        best = max(LAWS, key=lambda form: p.ln_evidence[form])
        weights = p.pace_weights(best)
        reached = np.cumsum(weights) - 0.5 * weights
        n0 = IntervalDocument(**as_interval(np.interp(list(INTERVAL.values()), reached, N0_GRID)))
    return LawOfTraining.about(
        p,
        ln_evidence={law: float(v) for law, v in p.ln_evidence.items()},
        probability={law: float(v) for law, v in p.probability.items()},
        n0=n0,
        reason=_reason(pooled, best, n0),
    )


def _spoken(law: str) -> str:
    """A law of training in a sentence."""
    return "stretched exponential" if law == "stretched" else law


def _reason(pooled: Pooled, best: Law, n0: IntervalDocument | None) -> str:
    p = pooled.posterior
    if n0 is None:
        return f"not testable: {measured_cycles(pooled.strands).size} cycles; a law needs 3 or more"
    gain = p.ln_evidence[best]
    if p.chosen == NONE:
        return (
            f"no law: the {_spoken(best)} one gains {gain:.1f} in ln evidence over free changes of each sweep, "
            f"and {LEAST_LN_EVIDENCE_GAIN:g} are needed"
        )
    low, middle, high = n0.quantiles
    other = max((form for form in LAWS if form != best), key=lambda form: p.ln_evidence[form])
    lead = f"{gain - p.ln_evidence[other]:.1f} more than the {_spoken(other)} law"
    return (
        f"{_spoken(best)}, N0 = {middle:.2g} cycles ({low:.2g} to {high:.2g}): {gain:.1f} more in ln "
        f"evidence than free changes of each sweep, {lead}"
    )


def _changes(pooled: Pooled) -> Iterator[ChangeOfNumber]:
    last = int(np.searchsorted(pooled.cycle, pooled.last))
    for place, strand in enumerate(pooled.strands):
        for i, number in enumerate(NUMBERS):
            d = pooled.draws[4 * place + i]
            yield ChangeOfNumber(
                branch=strand.record.branch.value,
                channel=strand.channel,
                number=number,
                unit="K" if number == "shift" else "1",
                probability=float(np.mean(d.moving)),
                **interval(d.law[:, last] - d.law[:, 0]),
                scatter=interval_document(d.scatter),
                step=interval_document(d.step),
            )


def _stable(pooled: Pooled, share: float, wanted: float) -> Stability:
    change = changes(pooled)
    p = probability_stable(change, share)
    at, numbers = np.flatnonzero(p >= wanted), pooled.cycle[:-1].astype(int)
    first = int(numbers[at[0]]) if at.size else None
    size, horizon = f"{share:.2g} of the stroke per cycle", f"cycle {pooled.cycle[-1]:.0f}"
    if first is None:
        told = f"not stable up to {horizon}: the probability of changes below {size} stays below {wanted:.0%}"
    else:
        told = (
            f"stable from cycle {first} on with a probability of {p[at[0]]:.0%}: "
            f"no change above {size} up to {horizon}"
        )
        if first > pooled.last:
            told += f", which is a forecast: the last measured cycle is {pooled.last:.0f}"
    if not pooled.posterior.testable:
        told += f"; {measured_cycles(pooled.strands).size} cycles don't tell by what law it goes on"
    return Stability(
        from_cycle=first,
        cycles=numbers.tolist(),
        probability=p.tolist(),
        change=np.median(change, axis=0).tolist(),
        statement=told,
    )


def _by_cycle(q: CycleSeries) -> QuantityByCycle:
    """Quantiles of the draws that have a value; null where too few have one."""
    enough = LEAST_SHARE_OF_DRAWS * len(q.draws)
    found = (draws[np.isfinite(draws)] for draws in q.draws.T)
    each = [interval_where_defined(draws if draws.size >= enough else draws[:0]) for draws in found]
    return QuantityByCycle.about(
        q,
        own=q.own.tolist(),
        own_sd=q.own_sd.tolist(),
        **{name: [one[name] for one in each] for name in INTERVAL},
    )


def _remarks(strands: Sequence[Strand], at: Sequence[float]) -> list[str]:
    out = []
    channels = {s.channel for s in strands}
    if "stiffness" not in channels and not {"force", "displacement"} <= channels:
        held = ", ".join(sorted({c for s in strands for c in s.record.held}))
        why = f"{held} is held constant" if held else "force and displacement were not both measured"
        out.append(f"no stiffness along the path: {why}")
    units = shown_units(s.record for s in strands)
    for t in at:
        for s in strands:
            low, high = s.ends
            if not low <= t <= high:
                u = shown_as(s.record.units["temperature"], units)
                asked, coldest, hottest = (f"{u.value(v):g}" for v in (t, low, high))
                unit = unit_text(u.shown)
                out.append(
                    f"{asked} {unit} is beyond the temperatures of {s.record.key}, {coldest} to {hottest} {unit}: "
                    "what is told there is an extrapolation"
                )
    single = [s for s in strands if s.cycle.size < len(measured_cycles(strands))]
    out += [
        f"{s.record.key}: {s.cycle.size} of {len(measured_cycles(strands))} cycles have a sweep"
        for s in single
    ]
    out += calibration_remarks(s.record for s in strands)
    out += [f"{s.record.key}: curve and numbers have not settled" for s in strands if not s.converged]
    return list(dict.fromkeys(out))


def _columns(pooled: Pooled, place: int) -> dict[str, Any]:
    """Median and 90 % interval of the curve of each cycle."""
    strand = pooled.strands[place]
    t = np.linspace(*strand.ends, CURVE_POINTS)
    bands = [np.quantile(s.curve(t), [0.05, 0.5, 0.95], axis=0) for s in pooled.sweeps(place)]
    low, middle, high = np.concatenate(bands, axis=1)
    return {
        "cycle": np.repeat(pooled.cycle.astype(int), t.size),
        f"temperature_{strand.record.units['temperature']}": np.tile(t, pooled.cycle.size),
        "q05": low, "q50": middle, "q95": high,
    }  # fmt: skip


QUANTITY_KEYS: Final = ("condition", "branch", "channel", "name", "unit", "at")


def quantity_columns(found: Sequence[ConditionCycles]) -> dict[str, Any]:
    """All quantities of all conditions, a row for each cycle."""
    rows = [
        (
            one.condition, q.branch, q.channel, q.name, q.unit, or_nan(q.at), cycle, cycle in one.measured,
            *map(or_nan, values),
        )
        for one in found for q in one.quantities
        for cycle, *values in zip(one.cycles, q.own, q.own_sd, q.q05, q.median, q.q95, strict=True)
    ]  # fmt: skip
    names = (*QUANTITY_KEYS, "cycle", "measured", "own", "own_sd", "q05", "median", "q95")
    return dict(zip(names, zip(*rows, strict=True), strict=True))


class CyclesTable(DrawnTable):
    """``[cycles]``: how sweeps change from cycle to cycle."""

    model: str | None = None
    at: Texts = ()
    share: float = Field(default=STABLE_SHARE, gt=0.0, le=1.0)
    probability: float = Field(default=STABLE_PROBABILITY, gt=0.0, lt=1.0)
    ahead: int = Field(default=FORECAST_CYCLES, ge=0)


STEP: Final = StudyStep(
    CyclesTable,
    CYCLES,
    cycles,
    lambda found: "; ".join(f"{c['condition']}: {c['stable']['statement']}" for c in found["conditions"]),
    questions=lambda o, record: temperatures(
        o, lambda text: asked_temperature(text, *[record.units["temperature"]] * 2)
    ),
)
