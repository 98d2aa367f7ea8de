"""Simulating a current, from the folder of a fit to files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Final, Literal, get_args

import numpy as np
from pydantic import Field, model_validator

from sma_bayes.account import Account
from sma_bayes.arrays import Floats
from sma_bayes.assess.draws import RecordDraws
from sma_bayes.assess.inverse import Passage
from sma_bayes.errors import MeasurementError, SmaBayesError, UnknownNameError, require_known, require_seed
from sma_bayes.fitting.curves import interval, quantiles
from sma_bayes.parameters.priors_file import PriorSet, parse_priors
from sma_bayes.progress import Progress, silent
from sma_bayes.quantities import convert, unit_text
from sma_bayes.records.declaration import CHANNEL_OF
from sma_bayes.records.types import Branch, Campaign
from sma_bayes.report.choice import REPORT, figures_for
from sma_bayes.runs.declared_units import declared_parts, shown_units
from sma_bayes.runs.documents import SIMULATION
from sma_bayes.runs.fit_document import RecordSummary
from sma_bayes.runs.outputs import StoredRun, read_run
from sma_bayes.runs.store import write_csv
from sma_bayes.runs.stored_draws import draws_of
from sma_bayes.studies.ask.workflow import PROBABILITY, TOLERANCE, asked_temperature, wanted_value
from sma_bayes.studies.gap.heating import heat_parameter, heat_parameters
from sma_bayes.studies.identity import fit_identity, of_fit
from sma_bayes.studies.options import Pool
from sma_bayes.studies.run_context import RunContext
from sma_bayes.studies.simulate.balance import FittedBalance, HeatBalance, fitted_balance
from sma_bayes.studies.simulate.course import SimulatedCourse, Start, follow, require_length, temperatures
from sma_bayes.studies.simulate.profile import Columns, CurrentProfile, read_profile
from sma_bayes.studies.simulate.reach import reached, steady
from sma_bayes.studies.simulate.schema import (
    BestCurrent,
    CurrentPassage,
    CurrentStretch,
    OtherRule,
    ReachDocument,
    ReachOfCondition,
    SimulatedRun,
    SimulationFindings,
    StatedBalance,
    StatedProfile,
    ValueAtEnd,
)
from sma_bayes.studies.simulate.spring import RULES, BothDraws, Rule, Spring, rule_named
from sma_bayes.studies.simulate.starts import UNIT, starts_of
from sma_bayes.studies.study_step import Checks, FromFitTable, StudyStep, Texts

DRAWS: Final = 400
BAND: Final = {"q05": 0.05, "q50": 0.5, "q95": 0.95}
EXTRAPOLATED_SHARE: Final = 0.05
"""Share of the draws beyond what was measured from which on a course counts as extrapolated."""
EXTRAPOLATION_TOLERANCE: Final = 0.02
"""How far beyond what was measured, as a share of its range, does not count: readings have their noise."""
OTHER_DRAWS: Final = 50
"""Draws by which the other rule for minor loops is told."""


def simulate(
    folder: str | Path,
    current: str | Path | Columns | None = None,
    out: str | Path | None = None,
    *,
    reach: str | None = None,
    condition: str | None = None,
    start: str | Sequence[str] | None = None,
    ambient: str | None = None,
    rule: Rule = "proportional",
    pool: Pool = "campaign",
    tolerance: str = TOLERANCE,
    probability: float = PROBABILITY,
    draws: int = DRAWS,
    seed: int = 0,
    resume: bool = False,
    figures: str | bool = REPORT,
    progress: Progress | None = None,
    account: Account | None = None,
) -> dict[str, Any]:
    """Follow temperature, force, displacement and stiffness under a heating current, with bands.

    The heat balance is fitted to the measured temperatures of the campaign that the fit was made from, by the study of
    temperatures of `study_gap`; its draws go with draws of the curves of both branches, what these miss included.

    Parameters
    ----------
    folder : str or Path
        Output folder of `fit`.
    current : str, Path or mapping of str to array, optional
        Profile of the current: a file with columns such as ``time_s``, ``current_A`` and, if there is one,
        ``ambient_temperature_C``, or these columns. Each value holds until the next row; the last row is the end.
    out : str or Path, optional
        Folder for `simulate.json`, bands, tables, figures and the report; nothing is written without it.
    reach : str, optional
        A value to be reached by a steady current, heated from cold: ``"stiffness=500 N/m"``.
    condition : str, optional
        Only this condition; by default each that has current, time and both branches.
    start : str or sequence of str, optional
        ``cold``, ``hot``, ``heating:60 degC`` or ``cooling:60 degC``; by default both of the first two, as it is not
        known from where the alloy came to the temperature of the room.
    ambient : str, optional
        Temperature of the surroundings, ``"23 degC"``, where the profile has none; by default as it was recorded or,
        where it was not, fitted.
    rule : str
        Of minor loops: ``proportional`` or ``play``, see `sma_bayes.studies.simulate.spring`.
    pool : str
        ``campaign``: one gain and one loss for all conditions, and bands of another run that allow for what differs
        between runs; ``none``: own ones of each condition, for a repetition of it.
    tolerance : str
        How far off the value of `reach` may be: ``"5 %"`` or ``"4 N/m"``.
    probability : float
        With which it is to be met [1].
    draws : int
        How many.
    seed : int
    resume : bool
        Where `out` holds this very simulation already, only what is missing of its report is made.
    figures, progress, account
        See `fit_campaign`.

    Returns
    -------
    dict
        What `simulate.json` holds.

    Raises
    ------
    SmaBayesError
        If neither a current nor a value is given, or an option makes no sense.
    MeasurementError
        If the profile can't be used, or no condition of the campaign has current, time and both branches.
    OutputError, ResumeError
        If `folder` holds no finished fit, or `out` can't be used.
    """
    require_seed(seed)
    _require_options(current, reach, rule, pool, probability, draws)
    spent = account or Account()
    profile = None if current is None else read_profile(current)
    starts = starts_of(start)
    room = None if ambient is None else asked_temperature(ambient, UNIT, UNIT)
    with spent.timed("read"):
        run = read_run(Path(folder))
        read = _reader(run)
        able, why = _able(run, condition, read)
        wanted = None if reach is None else _Wanted.of(reach, tolerance, probability, able)
        left_out = [f"{name} was left out: {reason}." for name, reason in why.items() if condition is None]
        springs = [BothDraws(*map(read, pair)) for pair in able]
    followed = [s.condition for s in springs if condition in (None, s.condition)]
    asked = _SimulationQuestion(
        run, able, springs, followed, profile, starts, room, rule, pool, wanted, draws, seed, left_out
    )
    work = RunContext(SIMULATION, None, figures_for(figures), progress or silent, spent)
    return work.execute(out, asked.identity(), resume, lambda place: _simulated(asked, place, work))


def _require_options(
    current: object, reach: str | None, rule: str, pool: str, probability: float, draws: int
) -> None:
    if current is None and reach is None:
        raise SmaBayesError(
            "neither a current nor a value to be reached",
            expected="--current profile.csv, --reach 'stiffness=500 N/m', or both",
        )
    rule_named(rule)
    if pool not in get_args(Pool):
        raise UnknownNameError(f"unknown pool {pool!r}", expected="'none' or 'campaign'")
    if not 0.0 < probability <= 1.0:
        raise SmaBayesError(f"probability {probability}", expected="more than 0 and at most 1")
    if not 20 <= draws <= 10_000:
        raise SmaBayesError(f"--draws {draws}", expected="20 to 10,000")


Pair = tuple[RecordSummary, RecordSummary]


def _reader(run: StoredRun) -> Callable[[RecordSummary], RecordDraws]:
    """Draws of a record of the fit, read once."""
    found: dict[str, RecordDraws] = {}

    def read(summary: RecordSummary) -> RecordDraws:
        if summary.key not in found:
            found[summary.key] = draws_of(run.folder, summary, run.summary.seed)
        return found[summary.key]

    return read


def _able(
    run: StoredRun, condition: str | None, read: Callable[[RecordSummary], RecordDraws]
) -> tuple[list[Pair], dict[str, str]]:
    """Heating and cooling of each condition that a heat balance can be learnt from, and why others are none.

    Raises
    ------
    UnknownNameError
        If there is no such condition.
    MeasurementError
        If it is none of them, or none is.
    """
    by_id: dict[str, dict[str, RecordSummary]] = {}
    for r in run.summary.records:
        by_id.setdefault(r.condition, {})[r.branch] = r
    require_known(condition, by_id, f"unknown condition {condition!r}", file=run.folder)
    reasons = {name: _lacking(branches, read) for name, branches in by_id.items()}
    why = {name: reason for name, reason in reasons.items() if reason}
    able = [(b["heating"], b["cooling"]) for name, b in by_id.items() if name not in why]
    refused = condition if condition in why else None if able else next(iter(why))
    if refused is not None:
        raise MeasurementError(
            f"condition {refused!r}: {why[refused]}"
            + ("" if able or len(why) == 1 else "; no other condition will do, either"),
            file=run.folder,
            expected="a fit of measurements with current, time and temperature in °C on heating and cooling, from "
            "which a heat balance can be learnt, and force or displacement",
            remedy="declare the columns `current` and `time` of the campaign and fit again; a temperature can be asked "
            "about without them: `sma-bayes ask`",
        )
    return able, why


def _lacking(branches: Mapping[str, RecordSummary], read: Callable[[RecordSummary], RecordDraws]) -> str:
    """Why a condition can't be simulated; empty where it can."""
    missing = [b.value for b in Branch if b.value not in branches]
    if missing:
        return f"it has no {missing[0]} branch"
    records = [branches[b.value] for b in Branch]
    if any(r.temperature.unit != UNIT for r in records):
        return "its temperatures are in a unit that is not known"
    if not any(c in set(records[0].channels) & set(records[1].channels) for c in ("force", "displacement")):
        return "neither force nor displacement was measured on both branches, so nothing tells what has transformed"
    for quantity in ("current", "time"):
        if any(quantity not in read(r).record.inputs for r in records):
            return f"no {quantity} was recorded"
    return ""


@dataclass(frozen=True, slots=True)
class _Wanted:
    """A value that a steady current is to reach."""

    asked: str
    channel: str
    value: str
    tolerance: str
    probability: float

    @staticmethod
    def of(asked: str, tolerance: str, probability: float, able: Sequence[Pair]) -> _Wanted:
        """Read ``stiffness=500 N/m``, and refuse what no condition has."""
        name, equals, value = (part.strip() for part in asked.partition("="))
        channel = CHANNEL_OF.get(name, name)
        there = {c: q.name for pair in able for c, q in pair[0].quantities.items()}
        if not equals or channel not in there:
            raise SmaBayesError(
                f"--reach {asked!r}",
                expected=f"one of {', '.join(there.values())} and its value, such as "
                f"'{next(reversed(there.values()))}=500 N/m'",
            )
        first = next(pair[0] for pair in able if channel in pair[0].quantities)
        wanted_value(value, tolerance, first.quantities[channel].unit, name)
        return _Wanted(asked, channel, value, tolerance, probability)


@dataclass(frozen=True, slots=True, eq=False)
class _SimulationQuestion:
    """What is asked of which fit."""

    run: StoredRun
    able: Sequence[Pair]
    springs: Sequence[BothDraws]
    followed: Sequence[str]
    profile: CurrentProfile | None
    starts: tuple[Start, ...]
    room: float | None
    rule: Rule
    pool: Pool
    wanted: _Wanted | None
    draws: int
    seed: int
    left_out: Sequence[str]

    def identity(self) -> dict[str, Any]:
        """What decides the numbers: what `run.json` holds, and what must agree for a run to be resumed."""
        w = self.wanted
        asked = {
            "conditions": list(self.followed),
            "profile": None if self.profile is None else self.profile.sha256,
            "starts": [[s.name, s.temperature] for s in self.starts],
            "ambient": self.room,
            "rule": self.rule,
            "pool": self.pool,
            "reach": None if w is None else [w.asked, w.tolerance, w.probability],
            "draws": self.draws,
            "seed": self.seed,
        }
        return fit_identity(SIMULATION.verb, self.run.summary, asked)

    def campaign(self) -> Campaign:
        """What was measured, as far as it is needed."""
        records = tuple(d.record for s in self.springs for d in (s.heating, s.cooling))
        summary = self.run.summary
        return Campaign(summary.campaign, summary.source, summary.data_sha256 or "", records)

    def priors(self) -> PriorSet:
        """Of the fit."""
        return parse_priors(self.run.priors, str(self.run.folder / "priors.toml"))


def _simulated(q: _SimulationQuestion, folder: Path | None, work: RunContext) -> SimulationFindings:
    stages = 1 + len(q.followed)
    work.tell(0, stages, "fitting the heat balance")
    with work.account.timed("heat balance"):
        balances = fitted_balance(
            q.campaign(),
            q.springs,
            q.priors(),
            pooled=q.pool == "campaign",
            draws=q.draws,
            seed=q.seed,
            tell=lambda message: work.tell(0, stages, message),
        )
    runs, reaches, cautions = [], [], [*q.left_out, *_doubts(q, balances)]
    followed = [(s, p) for s, p in zip(q.springs, q.able, strict=True) if s.condition in q.followed]
    for n, (whole, pair) in enumerate(followed):
        work.tell(n + 1, stages, f"simulating {whole.condition}")
        seed = np.random.SeedSequence([q.seed, 29, *whole.condition.encode()])
        rng, (same,) = (
            np.random.default_rng(seed),
            seed.spawn(1),
        )  # starts differ by their course, not by chance
        own, balance = whole.drawn(q.draws, rng), balances.of(whole.condition, rng)
        if q.room is not None:
            balance = replace(balance, room=np.full(balance.size, q.room))
        with work.account.timed("simulate"):
            if q.profile is not None:
                beside = own.with_unseen_misfit(rng)
                runs += [
                    _run(q, beside, balance, pair, s, folder, np.random.default_rng(same)) for s in q.starts
                ]
            if q.wanted is not None and q.wanted.channel in own.channels:
                reaches.append(_reach(q.wanted, own, balance, balances, pair, rng))
    cautions += _said_of(runs)
    records = [r for pair in q.able for r in pair]
    w = q.wanted
    return SimulationFindings.about(
        q,
        schema="sma-bayes/simulation/1",
        **of_fit(q.run.summary, q.run.folder, q.seed),
        converged=all(r.converged for r in records),
        adequate=all(r.adequate for r in records),
        **declared_parts(records),
        balance=_stated_balance(q, balances),
        profile=_stated_profile(q, balances),
        runs=tuple(runs),
        reach=None if w is None else ReachDocument.about(w, conditions=tuple(reaches)),
        cautions=tuple(cautions),
    )


def _stated_balance(q: _SimulationQuestion, balances: FittedBalance) -> StatedBalance:
    study = balances.study
    space = study.final.hypothesis.space
    parameters = heat_parameters(study, balances.draws, q.seed)
    for at in study.final.hypothesis.effect_positions.values():
        for i in at:
            p = space.parameters[i]
            parameters[p.name] = heat_parameter(p.unit, p.meaning, balances.draws[:, i])
    return StatedBalance.about(
        study,
        parameters=parameters,
        effects=tuple(e.id for e in study.effects),
        pool=q.pool,
        sd={c: balances.sd(c) for c in q.followed},
        greatest_current=balances.greatest_current,
    )


def _stated_profile(q: _SimulationQuestion, balances: FittedBalance) -> StatedProfile | None:
    p = q.profile
    if p is None:
        return None
    recorded = all("ambient_temperature" in h.inputs for h in balances.histories)
    ambient = "as it was recorded in the campaign" if recorded else "fitted to the campaign"
    if q.room is not None:
        ambient = f"{q.room:g} °C, as given"
    if p.ambient is not None:
        ambient = "a column of the profile"
    return StatedProfile(
        file=p.name,
        rows=p.time.size,
        duration_s=p.duration,
        greatest_current=float(np.max(np.abs(p.current))),
        ambient=ambient,
        sha256=p.sha256,
    )


def _doubts(q: _SimulationQuestion, balances: FittedBalance) -> list[str]:
    """What to doubt before anything is simulated."""
    out = list(balances.remarks)
    if balances.study.verdict == "unnamed":
        out.append(
            "The measured temperatures disagree with the heat balance by more than chance, and no effect that is known "
            "explains it: bands allow for a misfit as large as the measured one, and hold for currents like the "
            "measured ones."
        )
    unsure = [r for pair in q.able for r in pair if not r.converged]
    if unsure:
        out.append(f"NOT CONVERGED: {', '.join(r.key for r in unsure)}; these numbers must not be relied on.")
    poor = [r for pair in q.able for r in pair if not r.adequate]
    if poor:
        out.append(f"Curve and noise do not describe the data of {', '.join(r.key for r in poor)}.")
    p = q.profile
    if p is not None and np.max(np.abs(p.current)) > balances.greatest_current * (1.0 + 1e-9):
        out.append(
            f"The current goes up to {np.max(np.abs(p.current)):.3g} A; {balances.greatest_current:.3g} A is the "
            "greatest that was measured."
        )
    if p is not None and p.ignored:
        out.append(f"Columns of the profile that were not used: {', '.join(p.ignored)}.")
    return out


def _said_of(runs: Sequence[SimulatedRun]) -> list[str]:
    """What to doubt of the courses; what is so from every start is said once."""
    starts: dict[tuple[str, str], list[str]] = {}
    for r in runs:
        for text in _said_of_one(r):
            starts.setdefault((r.condition, text), []).append(r.start)
    return [
        f"{condition}, {' and '.join(from_)} start: {text}" for (condition, text), from_ in starts.items()
    ]


def _said_of_one(r: SimulatedRun) -> Iterator[str]:
    if r.extrapolated_from is not None:
        low, high = map(r.shown_temperature, r.measured)
        yield (
            f"beyond the temperatures that were measured, {low:.3g} to {high:.3g} "
            f"{unit_text(r.temperature_unit)}, first at {r.extrapolated_from:.3g} s and in up to {r.extrapolated:.0%} "
            "of the draws; curves are extrapolated there."
        )
    if r.other_rule is not None:
        apart = ", ".join(
            f"{r.names[c]} {convert(v, r.units[c], r.declared_units[c]):.2g} "
            f"{unit_text(r.declared_units[c]) or '1'}"
            for c, v in r.other_rule.difference.items()
        )
        yield (
            f"minor loops follow a rule that the campaign does not test; the rule {r.other_rule.rule!r} "
            f"gives up to {apart} apart."
        )


def _run(
    q: _SimulationQuestion,
    own: BothDraws,
    balance: HeatBalance,
    pair: Pair,
    start: Start,
    folder: Path | None,
    rng: np.random.Generator,
) -> SimulatedRun:
    """Simulate one condition from one start, and write its bands."""
    profile = q.profile
    assert profile is not None
    require_length(profile, balance)
    low, high = temperatures(profile, balance, start)
    spring = Spring.over(own, low, high, q.rule)
    course = follow(spring, balance, profile, start)
    bands, units, names = _bands(spring, balance, course, pair, rng)
    coldest, hottest = own.measured
    room = EXTRAPOLATION_TOLERANCE * (hottest - coldest)
    outside = np.mean((course.temperature < coldest - room) | (course.temperature > hottest + room), axis=0)
    file = f"bands/{own.condition}-{start.name}.csv"
    if folder is not None:
        write_csv(folder / file, _columns(course, bands, units, outside))
    often = np.flatnonzero(outside > EXTRAPOLATED_SHARE)
    peak = int(np.argmax(bands["temperature"]["q50"]))
    inside = float(np.mean(course.inside))
    path = pair[0].path
    return SimulatedRun(
        condition=own.condition,
        start=start.name,
        start_temperature=start.temperature,
        file=file,
        units=units,
        declared_units=_declared(q, units, names),
        names=names,
        measured=(coldest, hottest),
        hottest=_value_at(bands["temperature"], peak, names["temperature"], units["temperature"]),
        end={c: _value_at(b, -1, names[c], units[c]) for c, b in bands.items()},
        extrapolated=float(outside.max()),
        extrapolated_from=float(course.time[often[0]]) if often.size else None,
        turns=float(np.mean(course.turns)),
        inside=inside,
        other_rule=_other_rule(spring, balance, profile, start, course)
        if inside > EXTRAPOLATED_SHARE
        else None,
        caution=path.message if "stiffness" in names and path.kind != "path_slope" else None,
    )


def _declared(q: _SimulationQuestion, units: Mapping[str, str], names: Mapping[str, str]) -> dict[str, str]:
    """Unit in which people see each channel: as first declared."""
    shown = shown_units(r for pair in q.able for r in pair)
    return {c: shown[names[c]].shown if names[c] in shown else unit for c, unit in units.items()}


Bands = dict[str, dict[str, Floats]]


def _bands(
    spring: Spring, balance: HeatBalance, course: SimulatedCourse, pair: Pair, rng: np.random.Generator
) -> tuple[Bands, dict[str, str], dict[str, str]]:
    """Bands of temperature and channels in time, their units, and what they are called."""
    off = balance.sd * rng.standard_normal((spring.size, 1))
    another = course.temperature + off
    bands: Bands = {"temperature": _quantiles(course.temperature, another)}
    units, names = {"temperature": UNIT}, {"temperature": "temperature"}
    for channel in spring.draws.channels:
        curve = spring.channel(channel, course.temperature, course.state)
        if spring.draws.derived(channel):
            new = spring.channel(channel, another, course.state)
        else:
            new = spring.reading(channel, another, course.state, rng)
        bands[channel] = _quantiles(curve, new)
        quantity = pair[0].quantities[channel]
        units[channel], names[channel] = quantity.unit, quantity.name
    return bands, units, names


def _quantiles(curve: Floats, new: Floats) -> dict[str, Floats]:
    levels = list(BAND.values())
    of_curve, of_new = quantiles(curve, levels, axis=0), quantiles(new, levels, axis=0)
    return {
        **dict(zip(BAND, of_curve, strict=True)),
        **{f"pred_{name}": values for name, values in zip(BAND, of_new, strict=True) if name != "q50"},
    }


def _columns(
    course: SimulatedCourse, bands: Bands, units: Mapping[str, str], outside: Floats
) -> dict[str, Any]:
    columns: dict[str, Any] = {"time_s": course.time, "current_A": course.current}
    for channel, band in bands.items():
        columns |= {f"{channel}_{name} [{units[channel]}]": values for name, values in band.items()}
    heating = np.mean(course.state.heating, axis=0)
    return {**columns, "on_heating_branch": heating, "share_extrapolated": outside}


def _value_at(band: Mapping[str, Floats], i: int, name: str, unit: str) -> ValueAtEnd:
    numbers = {key.replace("q50", "median"): float(values[i]) for key, values in band.items()}
    return ValueAtEnd(name=name, unit=unit, **numbers)


def _other_rule(
    spring: Spring, balance: HeatBalance, profile: CurrentProfile, start: Start, course: SimulatedCourse
) -> OtherRule:
    """What the other rule for minor loops would give, by some of the draws."""
    some = slice(0, min(OTHER_DRAWS, spring.size))
    rule: Rule = next(r for r in RULES if r != spring.rule)
    part = spring.part(some, rule)
    other = follow(part, balance.part(some), profile, start)
    mine = spring.part(some, spring.rule)
    state = course.state.part(some)
    channels = [c for c in spring.draws.channels if not spring.draws.derived(c)]
    return OtherRule(
        rule=rule,
        difference={
            c: float(np.max(np.abs(
                np.median(part.channel(c, other.temperature, other.state), axis=0)
                - np.median(mine.channel(c, course.temperature[some], state), axis=0)
            )))
            for c in channels
        },
    )  # fmt: skip


def _reach(
    wanted: _Wanted,
    own: BothDraws,
    balance: HeatBalance,
    balances: FittedBalance,
    pair: Pair,
    rng: np.random.Generator,
) -> ReachOfCondition:
    quantity = pair[0].quantities[wanted.channel]
    unit, target, bounds = wanted_value(wanted.value, wanted.tolerance, quantity.unit, quantity.name)
    states = steady(own.heating, balance)
    found = reached(states, balance.sd, wanted.channel, (quantity.unit, unit), target, bounds, rng)
    best, top = found.met.best
    path = pair[0].path
    return ReachOfCondition(
        condition=own.condition,
        quantity=quantity.name,
        unit=unit,
        target=target,
        bounds=bounds,
        reachable=found.reachable,
        passages=tuple(_passage(p, balances.greatest_current) for p in found.passages),
        intervals=tuple(
            CurrentStretch(low=s.low, high=s.high) for s in found.met.at_least(wanted.probability)
        ),
        best=BestCurrent(current=best, probability=top) if top > 0.0 else None,
        searched=found.greatest,
        caution=path.message if wanted.channel == "stiffness" and path.kind != "path_slope" else None,
    )


def _passage(p: Passage, greatest_measured: float) -> CurrentPassage:
    current = interval(p.draws[np.isfinite(p.draws)])
    return CurrentPassage.about(
        p, **current, beyond_measured=current["q95"] > greatest_measured * (1.0 + 1e-9)
    )


class SimulateTable(FromFitTable):
    """``[simulate]``: a heating current, or one that reaches a value. `pool` is that of the heat balance."""

    paths: ClassVar[tuple[str, ...]] = ("current",)
    current: str | None = None
    reach: str | None = None
    condition: str | None = None
    start: Texts = ()
    ambient: str | None = None
    rule: Rule = "proportional"
    pool: Literal["none", "campaign"] = "campaign"
    tolerance: str = TOLERANCE
    probability: float = Field(default=PROBABILITY, gt=0.0, le=1.0)
    draws: int = Field(default=DRAWS, ge=20, le=10_000)

    @model_validator(mode="after")
    def _asked(self) -> SimulateTable:
        if self.current is None and self.reach is None:
            raise ValueError("current, reach, or both")
        return self


def _told(found: Mapping[str, Any]) -> str:
    reached = (found["reach"] or {"conditions": ()})["conditions"]
    places = {r["condition"] for r in (*found["runs"], *reached)}
    return f"{len(found['runs'])} courses of {len(places)} conditions"


def _checks(o: Mapping[str, Any]) -> Checks:
    if "current" in o:
        yield "current", partial(read_profile, o["current"])
    yield "start", partial(starts_of, o["start"])
    yield "ambient", partial(asked_temperature, o.get("ambient", "20 degC"), UNIT, UNIT)


STEP: Final = StudyStep(SimulateTable, SIMULATION, simulate, _told, _checks)
