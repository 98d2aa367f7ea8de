"""How many cycles remain until a quantity reaches a limit, by the laws of training and the walk of `cycles`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sma_bayes.document_part import IntervalDocument
from sma_bayes.errors import SmaBayesError
from sma_bayes.fitting.curves import INTERVAL, as_interval
from sma_bayes.quantities import ARBITRARY, convert, number_and_unit
from sma_bayes.records.declaration import CHANNEL_OF
from sma_bayes.studies.ask.workflow import asked_temperature
from sma_bayes.studies.cycles.study import CycleSeries, Pooled, pool, quantities, stiffness_unit
from sma_bayes.studies.cycles.sweeps import NUMBERS, Strand
from sma_bayes.studies.watch.reference import Reference
from sma_bayes.studies.watch.schema import LimitDocument
from sma_bayes.studies.watch.state import StrandNumbers

FORECAST_CYCLES: Final = 200
"""Cycles over which limits are looked for."""
HISTORY: Final = 200
"""Latest cycles, at most, from which the course is told."""
DRAWS: Final = 1000
LEAST_CYCLES: Final = 3
"""Cycles, fitted or watched, from which a course is told."""
NOT_YET: Final = "remaining cycles are told from three cycles on"
"""What is said of limits before there are so many."""
AT_TEMPERATURE: Final = ("stiffness", "force", "displacement", "modulus", "stress", "strain")
EXAMPLE: Final = "such as 'stroke=-20%', 'shift=5 K', 'stiffness@60 degC=500 N/m'"


@dataclass(frozen=True, slots=True)
class WatchLimit:
    """A value that is not to be reached.

    Attributes
    ----------
    asked : str
    name : str
        One of the four numbers, or a channel or the stiffness at a temperature.
    at : float or None
        [unit of temperature]
    share : float or None
        Change over what it was when it was fitted.
    value : float or None
        The limit itself in `unit`.
    unit : str
    """

    asked: str
    name: str
    at: float | None
    share: float | None
    value: float | None
    unit: str


def limit_of(text: str, temperature_unit: str) -> WatchLimit:
    """Read ``stroke=-20%`` or ``stiffness@60 degC=500 N/m``.

    Raises
    ------
    SmaBayesError, QuantityError
        If it says something else.
    """
    quantity, equals, value = (part.strip() for part in text.partition("="))
    name, at_sign, where = (part.strip() for part in quantity.partition("@"))
    known = name in NUMBERS if not at_sign else name in AT_TEMPERATURE
    if not equals or not known or not value:
        raise SmaBayesError(f"--limit {text!r}", expected=EXAMPLE)
    at = asked_temperature(where, temperature_unit, temperature_unit) if at_sign else None
    name = CHANNEL_OF.get(name, name)
    if value.endswith("%"):
        share, rest = number_and_unit(value[:-1], what="limit")
        if rest or share == 0.0 or name == "shift":
            expected = "a temperature difference, such as 'shift=5 K'" if name == "shift" else EXAMPLE
            raise SmaBayesError(f"--limit {text!r}", expected=expected)
        return WatchLimit(text, name, at, share / 100.0, None, "")
    number, unit = number_and_unit(value, what="limit")
    return WatchLimit(text, name, at, None, number, unit)


def require_known(limit: WatchLimit, strands: Sequence[Strand]) -> None:
    """Refuse a limit of something that was not fitted, or in a unit that is not its own, before a cycle is watched.

    Raises
    ------
    SmaBayesError, QuantityError
        Naming what was fitted, or the unit.
    """
    units = {s.channel: s.unit for s in strands}
    if {"force", "displacement"} <= set(units):
        units.setdefault("stiffness", stiffness_unit(units["force"], units["displacement"]))
    known = {name: [s.units[name] for s in strands] for name in NUMBERS}
    if limit.at is not None:
        known = {channel: [unit] for channel, unit in units.items()}
    if limit.name not in known:
        raise SmaBayesError(
            f"--limit {limit.asked!r}: nothing that was fitted has {limit.name!r}",
            expected=f"one of {', '.join(NUMBERS)}, or a channel at a temperature: {', '.join(units)}",
        )
    if limit.share is None:
        for unit in known[limit.name]:
            _converted(limit, unit)


def remaining_cycles(
    reference: Reference,
    later: Sequence[Sequence[StrandNumbers]],
    limits: Sequence[WatchLimit],
    begins: int | None,
    seed: int,
) -> list[LimitDocument]:
    """Cycles that remain until each limit, for each branch and channel that has the quantity.

    Parameters
    ----------
    reference : Reference
    later : sequence of sequence of StrandNumbers
        Watched cycles, by strand.
    limits : sequence of WatchLimit
    begins : int or None
        Watched cycle, from 1, with which a change began; what was before does not tell its course.
    seed : int

    Raises
    ------
    SmaBayesError
        If nothing that was fitted has a quantity, or its unit is another one.
    """
    if not limits or reference.fitted + len(later) < LEAST_CYCLES:
        return []
    total = reference.fitted + len(later)
    first = max(0, total - HISTORY)
    if begins is not None and total - (reference.fitted + begins - 2) >= LEAST_CYCLES:
        first = max(first, reference.fitted + begins - 2)
    strands = [_extended(reference, s, later, first) for s in range(len(reference.strands))]
    pooled = pool(strands, FORECAST_CYCLES, seed, DRAWS)
    settled = replace(pooled, draws=tuple(replace(d, sweep=d.state) for d in pooled.draws))
    return [r for limit in limits for r in _of_limit(reference, settled, limit)]


def _extended(reference: Reference, s: int, later: Sequence[Sequence[StrandNumbers]], first: int) -> Strand:
    """All sweeps of a strand, fitted and watched, from one on."""
    sweeps = [*reference.numbers[s], *(cycle[s] for cycle in later)][first:]
    cycle = np.concatenate([reference.cycle, reference.cycle[-1] + 1.0 + np.arange(len(later))])[first:]
    values = np.array([n.value[: len(NUMBERS)] for n in sweeps])
    sds = np.array([n.sd for n in sweeps])
    return reference.strands[s].of_numbers(cycle, values, sds)


def _of_limit(reference: Reference, pooled: Pooled, limit: WatchLimit) -> Iterator[LimitDocument]:
    found = list(_fitting(pooled, limit))
    if not found:
        there = sorted({q.name for q in quantities(pooled, ())})
        raise SmaBayesError(
            f"--limit {limit.asked!r}: nothing that was fitted has {limit.name!r}",
            expected=f"one of {', '.join(there)}, or a channel at a temperature",
        )
    for q in found:
        yield _reached(reference, pooled, q, limit)


def _fitting(pooled: Pooled, limit: WatchLimit) -> Iterator[CycleSeries]:
    """What the limit is of: numbers about the common curve as it was fitted, values at a temperature."""
    if limit.at is not None:
        yield from (q for q in quantities(pooled, (limit.at,)) if q.name == limit.name and q.at is not None)
        return
    alone = np.full(pooled.cycle.size, np.nan)
    for place, s in enumerate(pooled.strands):
        drawn = s.in_units(limit.name, pooled.numbers(place)[..., NUMBERS.index(limit.name)])
        unit = s.units[limit.name]
        yield CycleSeries(s.record.branch.value, s.channel, limit.name, unit, None, alone, alone, drawn)


def _reached(reference: Reference, pooled: Pooled, q: CycleSeries, limit: WatchLimit) -> LimitDocument:
    last = int(np.searchsorted(pooled.cycle, pooled.last))
    fitted = _as_fitted(reference, q)
    target = fitted * (1.0 + limit.share) if limit.share is not None else _converted(limit, q.unit)
    now = q.draws[:, last]
    rises = target > fitted
    over = q.draws[:, last:] >= target if rises else q.draws[:, last:] <= target
    when = np.where(over.any(axis=1), over.argmax(axis=1), np.inf)
    horizon = int(pooled.cycle.size - 1 - last)
    levels = tuple(INTERVAL.values())
    remaining = IntervalDocument(**as_interval(np.quantile(when, levels, method="inverted_cdf")))
    probability = float(np.mean(np.isfinite(when)))
    with np.errstate(all="ignore"):
        at_last = IntervalDocument(**as_interval(np.nanquantile(now, levels)))
    return LimitDocument.about(
        q,
        limit=limit.asked,
        quantity=limit.name,
        fitted=fitted,
        now=at_last,
        target=target,
        remaining=remaining,
        probability=probability,
        horizon=horizon,
        statement=f"{q.branch} {q.channel}, {limit.asked}: {_statement(remaining, horizon, probability)}",
    )


def _statement(remaining: IntervalDocument, horizon: int, probability: float) -> str:
    low, middle, high = remaining.q05, remaining.median, remaining.q95
    if middle == 0.0:
        return "reached"
    if middle is None:
        soon = (
            "already" if low == 0.0 else f"within {low:.0f} cycle{'' if low == 1.0 else 's'}" if low else ""
        )
        at_least = f", reached {soon} with 5 %" if soon else ""
        return (
            f"not within {horizon} cycles with a probability of {100.0 * (1.0 - probability):.0f} %{at_least}"
        )
    upper = f"{high:.0f}" if high is not None else f"more than {horizon}"
    return f"in {middle:.0f} cycles (90 %: {low:.0f} to {upper})"


def _as_fitted(reference: Reference, q: CycleSeries) -> float:
    """The quantity with the mean numbers of the fitted sweeps."""
    strands = {
        s.channel: (i, s) for i, s in enumerate(reference.strands) if s.record.branch.value == q.branch
    }
    mean = {
        c: np.mean([n.value[: len(NUMBERS)] for n in reference.numbers[i]], axis=0)
        for c, (i, _) in strands.items()
    }
    if q.name in NUMBERS:
        i = NUMBERS.index(q.name)
        return float(strands[q.channel][1].in_units(q.name, mean[q.channel][i]))
    t = np.array([q.at if q.at is not None else np.nan])
    if q.name in strands:
        return float(strands[q.name][1].curve(mean[q.name], t)[0])
    force, displacement = (strands[c][1].slope(mean[c], t)[0] for c in ("force", "displacement"))
    return float(force / displacement)


def _converted(limit: WatchLimit, unit: str) -> float:
    """The limit in a unit."""
    value = limit.value if limit.value is not None else np.nan
    if not limit.unit:
        if unit in ("1", ARBITRARY):
            return value
        raise SmaBayesError(f"--limit {limit.asked!r} has no unit", expected=f"its unit, such as {unit!r}")
    if limit.unit == unit:
        return value
    return float(convert(value, limit.unit, unit, what=limit.name))
