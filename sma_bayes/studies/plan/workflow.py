"""What to measure next, from the folder of a finished run to files."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Final, Literal, get_args

import numpy as np
from pydantic import Field

from sma_bayes.account import Account
from sma_bayes.assess.draws import RecordDraws
from sma_bayes.errors import (
    MeasurementError,
    OutputError,
    SmaBayesError,
    StudyError,
    UnknownNameError,
    first_of,
    require_known,
    require_seed,
)
from sma_bayes.fitting.curves import interval
from sma_bayes.progress import Progress, silent
from sma_bayes.quantities import unit_text
from sma_bayes.records.types import Branch, Record
from sma_bayes.report.choice import REPORT, figures_for
from sma_bayes.runs.declared_units import Shown, ShownUnit, declared_parts, shown_units
from sma_bayes.runs.documents import FIT, GAP, PLAN
from sma_bayes.runs.fit_document import RecordSummary, refuse_shared_parameters
from sma_bayes.runs.outputs import StoredRun, read_run
from sma_bayes.runs.shown import of_parameters
from sma_bayes.runs.stored_draws import draws_of
from sma_bayes.studies.identity import fit_identity, of_fit, study_identity
from sma_bayes.studies.plan.asked import PARAMETERS, TELL_APART, Asked, able, parse_asked
from sma_bayes.studies.plan.candidates import (
    CYCLES,
    CandidateExperiment,
    Setting,
    candidate_tables,
    declared,
    default_grid,
    hours_of,
    marked,
    rate_of,
    require_rate,
    settings_of,
)
from sma_bayes.studies.plan.design import Expectations, best_design, even_design, nats_of
from sma_bayes.studies.plan.information import ExpectedGain, Knowledge, PlanTarget
from sma_bayes.studies.plan.listing import planned, with_advice
from sma_bayes.studies.plan.options import MAX_RIG_HOURS, Options, Scatter
from sma_bayes.studies.plan.rivals import read_gap
from sma_bayes.studies.plan.scatter import scatter_of
from sma_bayes.studies.plan.schema import (
    DesignOutcome,
    DesignStep,
    ExpectedQuantity,
    KnownQuantity,
    PlanFindings,
    PlannedCandidate,
    PlannedDesign,
    ScatterOfSweeps,
)
from sma_bayes.studies.plan.telling_apart import planned_apart
from sma_bayes.studies.run_context import RunContext
from sma_bayes.studies.sensitivity.quantities import QuantityDraws, quantities_of
from sma_bayes.studies.study_step import Checks, DrawnTable, StudyStep

FEWER_SHARE: Final = 0.25
"""Share of the cycles of a long design of which it is told what they would bring."""


def plan(
    folder: str | Path,
    asked: str,
    out: str | Path | None = None,
    *,
    hours: float | None = None,
    candidates: str | Path | None = None,
    condition: str | None = None,
    branch: str | None = None,
    rate: str | None = None,
    setup: str = "0 min",
    scatter: Scatter = "none",
    data: str | Path | None = None,
    seed: int = 0,
    jobs: int | None = None,
    resume: bool = False,
    figures: str | bool = REPORT,
    progress: Progress | None = None,
    account: Account | None = None,
) -> dict[str, Any]:
    """Tell what to measure next: candidate experiments by what they are expected to tell per hour on the rig.

    Parameters
    ----------
    folder : str or Path
        Output folder of a finished `fit` or `demo`; of `gap` where explanations are to be told apart.
    asked : str
        ``"stiffness@60degC"`` (or force, displacement; modulus, stress, strain), ``"parameters"`` or ``"tell-apart"``.
    out : str or Path, optional
        Folder for `plan.json`, `candidates.csv`, tables, figures and the report; nothing is written without it.
    hours : float, optional
        Time that there is on the rig [h]; with it a design that fills it is made.
    candidates : str or Path, optional
        TOML file of candidates; by default a grid within what the campaign measured.
    condition, branch : str, optional
        Only this condition, only ``heating`` or ``cooling``; all by default.
    rate : str, optional
        Rate of temperature, ``"2 K/min"``, of candidates that state none; as measured by default. Needed where no time
        was recorded.
    setup : str
        Time before the first cycle of each experiment, ``"20 min"``.
    scatter : str
        What is assumed of the scatter from sweep to sweep where there is one sweep only: ``none``, or ``usual``, as one
        specimen in one rig usually repeats.
    data : str or Path, optional
        Folder of the data files, where it is not the campaign file's own; only to tell explanations apart, for which
        the measurements are read again.
    seed : int
        Decides about which draws curves are linearised; the draws are those of the fit.
    jobs : int, optional
        Processes that draw figures; by default one for each core.
    resume : bool
        Where `out` holds this very plan already, only what is missing of its report is made.
    figures, progress, account
        See `fit_campaign`.

    Returns
    -------
    dict
        What `plan.json` holds.

    Raises
    ------
    SmaBayesError
        If it is not clear what is asked for, or an option makes no sense.
    QuantityError
        If the temperature was measured by no record, or a rate or time has no unit.
    MeasurementError
        If no record tells the quantity, or nothing tells how fast the rig is.
    StudyError
        If the file of candidates can't be used.
    OutputError, ResumeError
        If `folder` holds no finished run of the kind that is needed, or `out` can't be used.

    Notes
    -----
    See `sma_bayes.studies.plan.information` for quantities, `sma_bayes.studies.plan.apart` for rivals.
    """
    require_seed(seed)
    question = parse_asked(asked)
    setup_hours = hours_of(setup, "setup")
    _require_options(hours, scatter, branch)
    work = RunContext(PLAN, jobs, figures_for(figures), progress or silent, account or Account())
    place = Path(folder)
    options = Options(hours, candidates, rate, setup_hours, scatter, seed, condition, branch)
    stated = {"asked": question.text, **options.identity()}
    if question.name == TELL_APART:
        with work.account.timed("read"):
            gap, campaign = read_gap(place, None if data is None else Path(data))
        identity = study_identity(PLAN.verb, gap.numbers_sha256, stated)
        return work.execute(
            out, identity, resume, lambda into: planned_apart(gap, campaign, place, options, into, work)
        )
    with work.account.timed("read"):
        _require_fit(place)
        run = read_run(place)
        asks = _FitQuestion.of(run, question, condition, branch)
    identity = fit_identity(PLAN.verb, run.summary, stated)
    return work.execute(out, identity, resume, lambda into: _planned(asks, options, into, work))


def _require_options(hours: float | None, scatter: str, branch: str | None) -> None:
    if hours is not None and not 0.0 < hours <= MAX_RIG_HOURS:
        raise SmaBayesError(f"--hours {hours}", expected=f"more than 0 and at most {MAX_RIG_HOURS:g} h")
    if scatter not in get_args(Scatter):
        raise UnknownNameError(f"unknown scatter {scatter!r}", expected="'none' or 'usual'")
    require_known(branch, [b.value for b in Branch], f"unknown branch {branch!r}")


def _require_fit(folder: Path) -> None:
    """Refuse a gap study, with what to run instead."""
    if GAP.is_in(folder) and not FIT.is_in(folder):
        raise OutputError(
            "holds a gap study, which has no draws of the curves by themselves",
            file=folder,
            expected=f"a folder that fit has written; of this one --for {TELL_APART} can be asked",
            remedy="run fit on the same campaign and plan from its folder",
        )


@dataclass(frozen=True, eq=False)
class _FitQuestion:
    """A question to a fit.

    Attributes
    ----------
    run : StoredRun
    asked : Asked
    chosen : tuple of RecordSummary
        Records that are asked about.
    draws : tuple of RecordDraws
        Of all records.
    """

    run: StoredRun
    asked: Asked
    chosen: tuple[RecordSummary, ...]
    draws: tuple[RecordDraws, ...]

    @staticmethod
    def of(run: StoredRun, asked: Asked, condition: str | None, branch: str | None) -> _FitQuestion:
        """Records that have what is asked for."""
        records = run.summary.records
        shared = any(r.shares_parameters_with for r in records)
        refuse_shared_parameters(shared, run.folder, "which an experiment at its settings tells of")
        draws = tuple(draws_of(run.folder, r, run.summary.seed) for r in records)
        there = settings_of(d.record for d in draws)
        require_known(condition, there, f"unknown condition {condition!r}", file=run.folder)
        wanted = [r for r in records if condition in (None, r.condition) and branch in (None, r.branch)]
        if not wanted:
            raise MeasurementError(
                f"no record of condition {condition!r} and branch {branch!r}",
                file=run.folder,
                expected=", ".join(r.key for r in records[:6]),
            )
        return _FitQuestion(run, asked, tuple(able(asked, wanted, run.folder)), draws)

    def summary(self, key: str) -> RecordSummary:
        """Entry of a record."""
        return next(r for r in self.chosen if r.key == key)

    @property
    def conditions(self) -> list[str]:
        """Conditions that are asked about."""
        return list(dict.fromkeys(r.condition for r in self.chosen))

    def targets(self, options: Options) -> tuple[PlanTarget, ...]:
        """What is asked of each record."""
        keys = {r.key for r in self.chosen}
        return tuple(
            self._target(Knowledge.of(d, scatter_of(d, options.scatter), options.seed))
            for d in self.draws
            if d.key in keys
        )

    def _target(self, knowledge: Knowledge) -> PlanTarget:
        draws = knowledge.draws
        if self.asked.name == PARAMETERS:
            names = knowledge.posterior.names[: knowledge.count]
            own = {q.name: q for q in quantities_of(draws, (), stiffness=False)}
            return PlanTarget(knowledge, tuple(own[n] for n in names), knowledge.unit_gradients())
        at = self.asked.at(self.summary(draws.key))
        values = draws.curve(self.asked.channel, np.array([at]))[:, 0]
        name = f"{self.asked.name} at {at:g} {unit_text(draws.units['temperature'])}"
        channel = self.asked.channel
        quantity = QuantityDraws(name, "curve", channel, draws.units[channel], name, values, at)
        return PlanTarget(knowledge, (quantity,), knowledge.gradient(channel, at))


def _planned(q: _FitQuestion, o: Options, folder: Path | None, work: RunContext) -> PlanFindings:
    summary = q.run.summary
    work.tell(0, 3, "linearising curves")
    with work.account.timed("linearise"):
        targets = q.targets(o)
    settings = settings_of(d.record for d in q.draws)
    unit = q.draws[0].record.units["temperature"]
    rate = None if o.rate is None else rate_of(o.rate, unit)
    tried = _candidates(q, o, settings, rate)
    expectations = Expectations(targets)
    work.tell(1, 3, f"judging {len(tried)} candidates")
    with work.account.timed("judge"):
        judged = [(c, expectations.of(c)) for c in tried]
        judged.sort(key=lambda x: (-nats_of(x[1]) / x[0].hours, x[0].hours))
    work.tell(2, 3, "putting a design together")
    with work.account.timed("design"):
        parts = [] if o.hours is None else best_design(expectations, tried, o.hours)
        design = _design(expectations, parts, tried, settings, q.conditions, o, rate) if parts else None
    shown = shown_units(summary.records)
    found = PlanFindings(
        schema="sma-bayes/plan/1",
        asked=q.asked.text,
        kind="parameters" if q.asked.name == PARAMETERS else "quantity",
        **of_fit(summary, q.run.folder, o.seed),
        converged=all(r.converged for r in q.chosen),
        temperature_unit=unit,
        available=o.hours,
        assumed_scatter=o.scatter,
        threshold=None,
        quantities=tuple(k for t in targets for k in _known(t, q, shown)),
        scatter=tuple(s for t in targets for s in _scatter(t)),
        rivals=(),
        candidates=tuple(
            _candidate(n, c, gains, expectations, o.hours) for n, (c, gains) in enumerate(judged, 1)
        ),
        design=design,
        advice="",
        remarks=(*_remarks(q, o, targets, tried), *_remarks_on_cycles(expectations, parts)),
        **declared_parts(summary.records),
    )
    return with_advice(found, folder)


def _candidates(
    q: _FitQuestion, o: Options, settings: Mapping[str, Setting], rate: float | None
) -> list[CandidateExperiment]:
    """Candidates, declared or made.

    Raises
    ------
    MeasurementError
        If nothing tells how fast the temperature changes.
    StudyError
        If a declared one measures other curves than the fit has.
    """
    asked = q.conditions
    at = None if q.asked.name == PARAMETERS else q.asked.at(q.chosen[0])
    if o.candidates is not None:
        found = declared(Path(o.candidates), settings, asked, o.setup, rate)
    else:
        found = default_grid([settings[c] for c in asked], at, o.setup, rate)
        if o.hours is not None:
            found = _filled(found, o.hours)
    require_rate(found, q.run.folder)
    for c in found:
        load = settings[c.condition].load
        if c.load is not None and (load is None or abs(c.load - load) > 1e-6 * max(abs(load), 1e-12)):
            raise StudyError(
                f"a candidate with a load of {c.load:g} at condition {c.condition!r}, which has "
                f"{'none that is known' if load is None else f'{load:g}'}",
                file=o.candidates,
                column="load",
                expected="the load of the condition: under another load the spring has another curve",
                remedy=f"name the condition that has this load, or ask a gap study with --for {TELL_APART}",
            )
    return marked(found, settings)


def _filled(found: Sequence[CandidateExperiment], hours: float) -> list[CandidateExperiment]:
    """With candidates that fill the hours."""
    out = dict.fromkeys(found)
    for c in {c.settings: c for c in found}.values():
        cycles = math.floor((hours - c.setup) / c.cycle_hours * (1.0 + 1e-9))
        if cycles >= 1:
            out[replace(c, cycles=cycles)] = None
    return list(out)


def _known(target: PlanTarget, q: _FitQuestion, shown: Shown) -> Iterator[KnownQuantity]:
    draws = target.knowledge.draws
    summary = q.summary(draws.key)
    factors = of_parameters(summary, shown)
    for quantity, sd in zip(target.quantities, target.sd.tolist(), strict=True):
        measured = summary.quantities.get(quantity.channel)
        own = None if measured is None else shown.get(measured.name)
        u = factors.get(quantity.name) or ShownUnit(quantity.unit, quantity.unit, 1.0)
        if own is not None and own.stored == quantity.unit:
            u = own
        yield KnownQuantity.about(
            quantity,
            key=draws.key,
            **interval(quantity.draws),
            sd=sd,
            shown_unit=u.shown,
            shown_factor=u.factor,
            shown_zero=u.zero,
            at=quantity.temperature,
        )


def _scatter(target: PlanTarget) -> list[ScatterOfSweeps]:
    key = target.knowledge.draws.key
    return [
        ScatterOfSweeps(key=key, channel=channel, sweeps=s.sweeps, **s.told())
        for channel, s in target.knowledge.scatter.items()
    ]


def _expected(
    targets: Sequence[PlanTarget], gains: Mapping[str, ExpectedGain]
) -> tuple[ExpectedQuantity, ...]:
    return tuple(
        ExpectedQuantity(
            key=t.knowledge.draws.key, name=quantity.name, sd=sd * math.sqrt(left), shrinkage=1.0 - left
        )
        for t in targets
        if (gain := gains.get(t.knowledge.draws.key)) is not None
        for quantity, sd, left in zip(t.quantities, t.sd.tolist(), gain.left.tolist(), strict=True)
    )


def _candidate(
    rank: int,
    c: CandidateExperiment,
    gains: Mapping[str, ExpectedGain],
    expectations: Expectations,
    hours: float | None,
) -> PlannedCandidate:
    return planned(
        rank,
        c,
        hours,
        branches=[t.knowledge.draws.branch.value for t in expectations.followed(c)],
        nats=nats_of(gains),
        expected=_expected(expectations.targets, gains),
    )


def _design(
    expectations: Expectations,
    parts: Sequence[tuple[CandidateExperiment, int]],
    tried: Sequence[CandidateExperiment],
    settings: Mapping[str, Setting],
    conditions: Sequence[str],
    o: Options,
    rate: float | None,
) -> PlannedDesign:
    assert o.hours is not None
    gains = expectations.of_design(parts)
    even = even_design([settings[c] for c in conditions], tried, o.hours, o.setup, rate)
    gains_of_even = expectations.of_design(even)
    steps = tuple(DesignStep.about(c, cycles=n, hours=c.setup + n * c.cycle_hours) for c, n in parts)
    return PlannedDesign(
        hours=sum(s.hours for s in steps),
        nats=nats_of(gains),
        expected=_expected(expectations.targets, gains),
        steps=steps,
        even=DesignOutcome(
            hours=o.hours,
            nats=nats_of(gains_of_even),
            expected=_expected(expectations.targets, gains_of_even),
        ),
        even_cycles=min((n for _, n in even), default=0.0),
    )


def remarks_on_discrepancies(draws: Iterable[RecordDraws]) -> list[str]:
    """What new sweeps tell that the plan does not allow for: the size of a discrepancy beside noise with a memory."""
    beside = dict.fromkeys(d.key for d in draws if d.weights and d.posterior.noise.autocorrelated)
    if not beside:
        return []
    return [
        f"a discrepancy stands beside the curve of {', '.join(beside)}, under noise with a memory: new sweeps also "
        "tell how large it is, which the plan holds as it is. Less may be left than is said: where such a plan said "
        "0.68 of the variance, 0.50 was found"
    ]


def remarks_on_scatter(draws: Iterable[RecordDraws]) -> list[str]:
    """How far a plan can be off for records whose sweeps differ: few sweeps tell roughly by how much."""
    apart = dict.fromkeys(d.key for d in draws if d.posterior.layout[0].between)
    if not apart:
        return []
    return [
        f"sweeps of {', '.join(apart)} differ by more than noise, and a few sweeps tell only roughly by how much: of "
        "20 such plans, of four to eight sweeps and four more, half left 0.9 to 1.3 times the standard deviation that "
        "was said"
    ]


def _remarks_on_cycles(
    expectations: Expectations, parts: Sequence[tuple[CandidateExperiment, int]]
) -> Iterator[str]:
    """That a spring may change over many more cycles than were measured, and what fewer would bring."""
    planned_cycles: Counter[str] = Counter()
    for c, n in parts:
        planned_cycles[c.condition] += n
    many_more = []
    for condition, n in planned_cycles.items():
        records = [
            t.knowledge.draws.record
            for t in expectations.targets
            if t.knowledge.draws.condition.id == condition
        ]
        measured = max(np.unique(r.inputs["segment"]).size for r in records)
        if n > max(CYCLES) and n > measured:
            many_more.append(f"{n} cycles of condition {condition}, after {measured} that were measured")
    if many_more:
        fewer = [(c, max(round(FEWER_SHARE * n), 1)) for c, n in parts]
        yield (
            f"{'; '.join(many_more)}: the plan takes a spring for unchanged, and over so many it may train or tire. "
            f"{sum(n for _, n in fewer)} of them would bring {nats_of(expectations.of_design(fewer)):.2g} of "
            f"{nats_of(expectations.of_design(parts)):.2g} nats: measure these first, and look with `cycles` or "
            "`watch` whether the spring is still the same"
        )


def _remarks(
    q: _FitQuestion, o: Options, targets: Sequence[PlanTarget], tried: Sequence[CandidateExperiment]
) -> Iterator[str]:
    alone = [
        t.knowledge.draws.key for t in targets if all(not s.sweeps for s in t.knowledge.scatter.values())
    ]
    if alone:
        yield (
            f"one sweep only of {first_of(alone, 4)}: it does not tell by how much sweeps differ. "
            + (
                "Sweeps are assumed to repeat but for noise, so that the expected gain may be too large; "
                "--scatter usual assumes the usual scatter of one specimen in one rig"
                if o.scatter == "none"
                else "The usual scatter of one specimen in one rig is assumed"
            )
        )
    yield from remarks_on_discrepancies(t.knowledge.draws for t in targets)
    yield from remarks_on_scatter(t.knowledge.draws for t in targets)
    if len(alone) < len(targets):
        yield (
            "scatter from sweep to sweep is as large as the sweeps of each record show it; two or three tell it only "
            "roughly, and where later ones differ more, more is left than is said"
        )
    yield (
        "a new set-up may differ from the old by more than sweeps differ from each other; "
        "only a repetition at the same settings tells by how much"
    )
    if len({c.rate for c in tried}) > 1:
        yield ("the curves of a fit do not depend on the rate: whether a faster sweep still follows them, a gap "
                     "study of different rates tells")  # fmt: skip
    if not any("time" in d.record.inputs for d in q.draws):
        yield "no time was recorded: times on the rig follow from the rate that was given"
    if any(c.beyond for c in tried):
        yield (
            "candidates that go beyond what the campaign measured are marked: there the curve is extrapolated"
        )
    if any(t.knowledge.draws.calibration for t in targets):
        yield "further sweeps do not narrow what is uncertain in a calibration"
    if any(not r.adequate for r in q.chosen):
        yield ("curve and noise do not describe all records (see the report of the fit): what is expected holds "
                     "as far as they do")  # fmt: skip


class PlanTable(DrawnTable):
    """``[plan]``: the next measurement, as `plan` is asked for it.

    It starts from ``[fit]``, or from ``[gap]`` where explanations are to be told apart.
    """

    paths: ClassVar[tuple[str, ...]] = ("candidates",)
    separate: ClassVar[bool] = True
    asked: str = Field(alias="for")
    hours: float | None = Field(default=None, gt=0.0, le=MAX_RIG_HOURS)
    candidates: str | None = None
    condition: str | None = None
    branch: Literal["heating", "cooling"] | None = None
    rate: str | None = None
    setup: str = "0 min"
    scatter: Scatter = "none"

    @property
    def reads(self) -> str:
        """The step whose results it reads."""
        return "gap" if self.asked.strip() == TELL_APART else "fit"


def _checks(o: Mapping[str, Any]) -> Checks:
    yield "for", partial(parse_asked, o["asked"])
    yield "setup", partial(hours_of, o["setup"], "setup")
    if "candidates" in o:
        yield "candidates", partial(candidate_tables, Path(o["candidates"]))


def _questions(o: Mapping[str, Any], record: Record) -> Checks:
    if "rate" in o:
        yield "rate", partial(rate_of, o["rate"], record.units["temperature"])


STEP: Final = StudyStep(
    PlanTable,
    PLAN,
    plan,
    lambda found: str(found["advice"]),
    _checks,
    _questions,
)
