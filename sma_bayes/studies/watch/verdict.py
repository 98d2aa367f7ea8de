"""What the watched cycles say: whether there is an alarm, since when, of what, and what is normal."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from scipy.stats import t as t_distribution

from sma_bayes.arrays import Floats
from sma_bayes.errors import many
from sma_bayes.fitting.curves import as_interval
from sma_bayes.report.notation import interval_text, unit_label
from sma_bayes.runs.declared_units import Shown
from sma_bayes.runs.shown import shown_part
from sma_bayes.runs.store import or_nan
from sma_bayes.studies.cycles.sweeps import Strand
from sma_bayes.studies.watch.evidence import Watched, least_squares_of, onset
from sma_bayes.studies.watch.naming import Change, NamedCause, causes_of, change_of, interval, named
from sma_bayes.studies.watch.reference import Reference
from sma_bayes.studies.watch.schema import (
    AlarmDocument,
    AmountDocument,
    CauseDocument,
    ChangeDocument,
    OnsetDocument,
    VerdictFindings,
    WatchedCause,
    WatchedCycle,
    WatchedNumber,
    WatchFindings,
)
from sma_bayes.studies.watch.state import NOISE, WATCHED, StrandNumbers, WatchState

FEWEST_SPARE: Final = 2
"""Degrees of freedom from which a scatter is told: two sweeps alone leave it open by a factor of hundreds."""
RELATIVE_TOLERANCE: Final = 1e-6
"""Share of a value below which its scatter is that of rounding: sweeps that are copies of each other."""
NORMAL_LEVEL: Final = 0.975
LOG10: Final = float(np.log(10.0))
LOGARITHMIC_AMOUNTS: Final = ("gain", "stroke", "width")
"""Amounts that are changes of a logarithm."""
NO_CHANGE: Final = ChangeDocument(verdict="none", causes=(), statement="no change that needs a name")


@dataclass(frozen=True, slots=True)
class WatchVerdict:
    """What is said.

    Attributes
    ----------
    found : VerdictFindings
        Its part of `watch.json`.
    begins : int or None
        Watched cycle, from 1, with which a change began, if there is one.
    """

    found: VerdictFindings
    begins: int | None


def judged(
    reference: Reference,
    later: Sequence[Sequence[StrandNumbers]],
    state: WatchState,
    alpha: float,
    units: Shown,
) -> WatchVerdict:
    """Judge all cycles that count.

    Parameters
    ----------
    reference : Reference
    later : sequence of sequence of StrandNumbers
        Watched cycles, by strand.
    state : WatchState
        With the evidence after each.
    alpha : float
    units : mapping of str to ShownUnit
        In which sentences tell how much has changed.
    """
    watched = reference.watched(later)
    series = reference.series
    evidence = np.array([c.log_evidence for c in state.cycles]).reshape(-1, series)
    total = evidence.max(axis=1, initial=-np.inf) - np.log(series)
    needed = float(np.log(1.0 / alpha))
    over = np.flatnonzero(total >= needed)
    at = int(over[0]) if over.size else None
    began = None if at is None else _began(watched, evidence, needed + np.log(series))
    numbers = tuple(_numbers(reference, watched, evidence, began, needed + np.log(series)))
    together = tuple(
        WatchedCause(
            id=cause.id, title=cause.title, of=cause.of, log10_e=tuple((own / LOG10).tolist()),
            alarm=bool(np.any(own >= needed + np.log(series))),
        )
        for cause, own in zip(reference.causes, evidence.T[len(reference.keys) :], strict=True)
    )  # fmt: skip
    greatest = float(total.max(initial=-np.inf))
    change = NO_CHANGE if began is None else _change(reference, began, units)
    alarm = None
    if at is not None and began is not None:
        alarm = AlarmDocument(
            cycle=at + 1,
            file=state.cycles[at].file,
            numbers=tuple(f"{n.branch} {n.channel} {n.number}" for n in numbers if n.alarm),
            causes=tuple(c.id for c in together if c.alarm),
            onset=began.onset,
        )
    found = VerdictFindings(
        verdict="same" if alarm is None else "changed",
        statement=_statement(len(later), alarm, change, alpha, greatest),
        p_value=float(np.exp(-max(greatest, 0.0))),
        fitted=reference.cycle.tolist(),
        law=reference.law,
        cycles=tuple(
            WatchedCycle(cycle=n + 1, file=c.file, cycle_in_file=c.cycle, log10_e=float(e / LOG10))
            for n, (c, e) in enumerate(zip(state.cycles, total, strict=True))
        ),
        numbers=numbers,
        together=together,
        alarm=alarm,
        change=change,
    )
    return WatchVerdict(found, None if began is None else began.onset.median)


@dataclass(frozen=True, slots=True, eq=False)
class _Began:
    """A change, and the cycles that show it."""

    onset: OnsetDocument
    watched: Watched


def _began(watched: Watched, evidence: Floats, needed: float) -> _Began:
    """When the clearest change began; where the evidence has gone since, by the cycle of the most of it."""
    last = len(evidence) - 1
    if evidence[last].max() < needed:
        last = int(evidence.max(axis=1).argmax())
    n = watched.fitted + last + 1
    seen = replace(
        watched,
        value=watched.value[:n],
        weight=watched.weight[:n],
        designs=tuple(d[:n] for d in watched.designs),
    )
    return _Began(onset(seen, int(evidence[last].argmax())), seen)


def _numbers(
    reference: Reference, watched: Watched, evidence: Floats, began: _Began | None, needed: float
) -> Iterator[WatchedNumber]:
    base = watched.fitted + (watched.watched if began is None else began.onset.low - 1)
    low, high = normal_range(watched, base)
    for k, (s, i) in enumerate(reference.keys):
        strand = reference.strands[s]
        yield WatchedNumber(
            branch=strand.record.branch.value,
            channel=strand.channel,
            number=WATCHED[i],
            unit=_unit(strand, i),
            value=_physical(strand, i, watched.value[:, k]).tolist(),
            normal_low=_physical(strand, i, low[:, k]).tolist(),
            normal_high=_physical(strand, i, high[:, k]).tolist(),
            log10_e=(evidence[:, k] / LOG10).tolist(),
            alarm=bool(np.any(evidence[:, k] >= needed)),
        )


def normal_range(watched: Watched, base: int) -> tuple[Floats, Floats]:
    """Within which 95 % of the sweeps are while nothing changes, by the first so many; NaN where that is not known."""
    design = watched.designs[len(watched.designs) // 2]
    none = np.full(watched.value.shape, np.nan)
    least = least_squares_of(watched.value[:base], watched.weight[:base], design[:base])
    if least is None or least.spare < FEWEST_SPARE:
        return none, none
    size = 1.0 / watched.weight + np.sum((design @ least.root) ** 2, axis=1)
    scatter = np.sqrt(least.left / least.spare * size[:, None])
    by = t_distribution.ppf(NORMAL_LEVEL, least.spare) * scatter
    middle = design @ least.beta
    by[by <= RELATIVE_TOLERANCE * np.abs(middle)] = np.nan
    return middle - by, middle + by


def _unit(strand: Strand, number: int) -> str:
    return {**strand.units, "noise": strand.unit}[WATCHED[number]]


def _physical(strand: Strand, number: int, value: Floats) -> Floats:
    """A number in its unit."""
    name = WATCHED[number]
    return strand.in_units("stroke" if name == NOISE else name, value)


def _change(reference: Reference, began: _Began, units: Shown) -> ChangeDocument:
    change = change_of(began.watched, began.onset)
    found = [] if change is None else named(change, causes_of(reference.strands, change))
    if change is None or not found:
        return ChangeDocument(
            verdict="unnamed",
            causes=(),
            statement="unnamed: none of the causes that are known, nor two together, accounts for the change",
        )
    causes = tuple(_cause(n, change) for n in found)
    best, specimen = causes[0], reference.strands[0].record.specimen
    amounts = ", ".join(_amount(shown_part(a, units, specimen=specimen)) for a in best.amounts)
    told = f"{best.title} ({amounts}), {best.share:.0%} of the change"
    if len(causes) > 1:
        others = "; ".join(c.title for c in causes[1:])
        told += f"; these cycles can't tell it from: {others}"
    return ChangeDocument(verdict="named", causes=causes, statement=told)


def _cause(n: NamedCause, change: Change) -> CauseDocument:
    low, high = interval(n, change.spare)
    amounts = [amount for cause in n.causes for amount in cause.amounts]
    kinds = {c.of for c in n.causes}
    return CauseDocument(
        id="+".join(c.id for c in n.causes),
        title=", and ".join(c.title for c in n.causes),
        of=kinds.pop() if len(kinds) == 1 else "either",
        effects=tuple(dict.fromkeys(c.effect for c in n.causes if c.effect)),
        share=n.share,
        p_value=n.p,
        amounts=tuple(
            AmountDocument(**as_interval((a, m, b)), name=name, unit=unit)
            for a, m, b, (name, unit) in zip(low, n.amount, high, amounts, strict=True)
        ),
    )


def _amount(a: AmountDocument) -> str:
    """What has changed, and by how much; a stretch, which is a logarithm in the document, in percent."""
    ends, name = (a.median, a.q05, a.q95), a.name.replace("_", " ")
    if a.name not in LOGARITHMIC_AMOUNTS:
        return f"{name} {interval_text(*ends)} {unit_label(a.unit)}".rstrip()
    return f"{name} {interval_text(*(None if v is None else 100.0 * math.expm1(v) for v in ends))} %"


def _statement(
    watched: int, alarm: AlarmDocument | None, change: ChangeDocument, alpha: float, greatest: float
) -> str:
    if not watched:
        return "no whole cycle has been watched yet"
    if alarm is None:
        return (
            f"still the spring that was fitted, as far as {many(watched, 'watched cycle')} can tell: the evidence of a "
            f"change came to {np.exp(min(greatest, 50.0)):.2g}, and {1.0 / alpha:.4g} is an alarm"
        )
    o = alarm.onset
    since = f"cycle {o.median}" + ("" if o.low == o.high else f" ({o.low} to {o.high})")
    return f"changed: alarm with cycle {alarm.cycle} ({alarm.file}), a {o.shape} since {since}: {change.statement}"


def csv_columns(found: WatchFindings) -> dict[str, dict[str, Any]]:
    """Columns of `cycles.csv` (each number of each sweep) and `e_process.csv`, by file."""
    fitted, cycles = found.fitted, found.cycles
    count = len(fitted)
    rows = [
        (
            "fitted" if j < count else "watched", int(fitted[j]) if j < count else cycles[j - count].cycle,
            "" if j < count else cycles[j - count].file, n.branch, n.channel, n.number, n.unit, value,
            or_nan(n.normal_low[j]), or_nan(n.normal_high[j]), np.nan if j < count else n.log10_e[j - count],
        )
        for n in found.numbers for j, value in enumerate(n.value)
    ]  # fmt: skip
    names = (
        "part", "cycle", "file", "branch", "channel", "number", "unit", "value", "normal_low", "normal_high", "log10_e"
    )  # fmt: skip
    process = {
        "cycle": [c.cycle for c in cycles],
        "file": [c.file for c in cycles],
        "log10_e": [c.log10_e for c in cycles],
        "log10_alarm": [float(np.log10(1.0 / found.alpha))] * len(cycles),
    }
    return {"cycles.csv": dict(zip(names, zip(*rows, strict=True), strict=True)), "e_process.csv": process}
