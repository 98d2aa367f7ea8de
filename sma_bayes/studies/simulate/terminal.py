"""A simulation on the screen: what the current ends in, which current reaches a value, and what to doubt."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from rich.table import Table

from sma_bayes.assess.inverse import FEW_PASSAGES
from sma_bayes.errors import many
from sma_bayes.report.notation import interval_text, unit_label, write_interval
from sma_bayes.report.screen import NOT_CONVERGED, numbers, screen, show_end, titled
from sma_bayes.runs.declared_units import units_of
from sma_bayes.runs.shown import shown_part
from sma_bayes.studies.gap.schema import HeatParameter
from sma_bayes.studies.simulate.schema import (
    CurrentPassage,
    ReachDocument,
    ReachOfCondition,
    SimulatedRun,
    SimulationFindings,
    ValueAtEnd,
)

LEAST_PASSING_SHARE: Final = 0.05
"""Share of the draws that pass a value, below which where they do is only counted."""


def show_simulation(found: dict[str, Any], out: Path | None) -> None:
    """What `simulate.json` says, for a terminal."""
    document = SimulationFindings.model_validate(found)
    console = screen()
    console.tell(f"{document.campaign}: {balance_text(document)}")
    if document.profile is not None:
        console.print()
        console.print(_ends(document))
    if document.reach is not None:
        console.print()
        console.tell(*reach_lines(document.reach))
    console.tell(*(f"caution: {caution}" for caution in document.cautions))
    console.tell(closing(document))
    show_end(console, found, out)


def balance_text(document: SimulationFindings) -> str:
    """What heats and cools, in a sentence."""
    told = []
    for name, p in shown_parameters(document).items():
        if name.partition("[")[0] in ("gain", "time_constant"):
            value = interval_text(p.median, p.q05, p.q95)
            told.append(f"{name.replace('_', ' ')} {value} {unit_label(p.unit)}")
    effects = ", ".join(document.balance.effects)
    return f"heat balance with {'; '.join(told)}" + (f"; with {effects.replace('_', ' ')}" if effects else "")


def shown_parameters(document: SimulationFindings) -> dict[str, HeatParameter]:
    """Parameters of the heat balance as people see them."""
    return dict(shown_part(document.balance, units_of(document)).parameters)


def _ends(document: SimulationFindings) -> Table:
    profile = document.profile
    assert profile is not None
    degrees = {r.temperature_unit for r in document.runs}
    columns = {(c, unit): name for r in document.runs for c, (name, unit) in _named(r).items()}
    table = titled(
        f"after {profile.duration_s:.4g} s of {profile.file}: median (90 % interval of another run)",
        "condition",
        "start",
        numbers(f"hottest [{' or '.join(map(unit_label, sorted(degrees)))}]"),
        *(numbers(f"{name} [{unit_label(unit) or '1'}]") for (_, unit), name in columns.items()),
    )
    for r, start in with_starts(document.runs):
        end = r.shown
        cells = [value_text(end[c]) if c in end and end[c].unit == unit else "-" for c, unit in columns]
        table.add_row(r.condition, start, value_text(r.hottest.shown_in(r.temperature_unit)), *cells)
    return table


def _named(run: SimulatedRun) -> Mapping[str, tuple[str, str]]:
    return {c: (v.name, v.unit) for c, v in run.shown.items()}


def with_starts(runs: Sequence[SimulatedRun]) -> Iterator[tuple[SimulatedRun, str]]:
    """Simulations, each with where it begins; of those that end alike, to the digits that are written, one for all."""
    alike: dict[tuple[str, ...], list[SimulatedRun]] = {}
    for r in runs:
        ends = [r.hottest.shown_in(r.temperature_unit), *r.shown.values()]
        written = [text(v) for v in ends for text in (curve_text, value_text)]
        alike.setdefault((r.condition, *r.shown, *written), []).append(r)
    return ((same[0], " or ".join(map(start_text, same))) for same in alike.values())


def start_text(run: SimulatedRun) -> str:
    """Where a simulation begins."""
    if run.start_temperature is None:
        return run.start
    return (
        f"{run.start} at {run.shown_temperature(run.start_temperature):g} {unit_label(run.temperature_unit)}"
    )


def curve_text(v: ValueAtEnd) -> str:
    """Median with the interval of the curve."""
    return _interval_text(v.median, v.q05, v.q95)


def value_text(v: ValueAtEnd) -> str:
    """Median with the interval of another run."""
    return _interval_text(v.median, v.pred_q05, v.pred_q95)


def _interval_text(median: float | None, low: float | None, high: float | None) -> str:
    if median is None:
        return "-"
    if low is None or high is None:
        return f"{median:.4g}"
    return "{} ({} to {})".format(*write_interval(median, low, high).plain)


def reach_lines(reach: ReachDocument) -> Iterator[str]:
    """Which steady current gives a value, in lines."""
    yield f"{reach_title(reach)}:"
    for first, *more in reach_texts(reach):
        yield f"  {first}"
        yield from (f"    {text}" for text in more)


def reach_title(reach: ReachDocument) -> str:
    """What was asked for."""
    return f"steady current for {reach.asked}, tolerance {reach.tolerance}, heated from cold"


def reach_texts(reach: ReachDocument) -> Iterator[list[str]]:
    """What is said of each condition; of none of them, where none has the quantity."""
    for c in reach.conditions:
        caution = [f"caution: {c.caution}"] if c.caution else []
        yield [f"{c.condition}: {_current_text(c)}", _surely(c, reach.probability), *caution]
    if not reach.conditions:
        yield ["no condition has that quantity on both branches"]


def _current_text(c: ReachOfCondition) -> str:
    often = [p for p in c.passages if p.probability >= LEAST_PASSING_SHARE]
    told = (
        [_wound_text(often)]
        if len(often) > FEW_PASSAGES
        else [
            f"{interval_text(p.median, p.q05, p.q95)} A ({p.direction}, in {p.probability:.0%} of the draws"
            f"{', beyond the measured currents' if p.beyond_measured else ''})"
            for p in often
        ]
    )
    if len(often) < len(c.passages):
        told.append(
            f"{many(len(c.passages) - len(often), 'other')} in less than {LEAST_PASSING_SHARE:.0%} of the draws each"
        )
    reachable = f"reached within the measured temperatures with probability {c.reachable:.3g}"
    return f"{'; '.join(told) or 'none'}; {reachable}"


def _wound_text(passages: Sequence[CurrentPassage]) -> str:
    """Between which currents draws wind about a value, which each passes many times."""
    times = sum(p.probability for p in passages)
    low, high = min(p.quantiles[0] for p in passages), max(p.quantiles[2] for p in passages)
    beyond = ", beyond the measured currents" if any(p.beyond_measured for p in passages) else ""
    between = f"between {low:.3g} and {high:.3g} A{beyond}"
    return f"up and down, {times:.0f} times a draw, {between}: they wind about the value there"


def _surely(c: ReachOfCondition, probability: float) -> str:
    if c.best is None:
        return f"no current up to {c.searched:.3g} A gives it"
    best = f"{c.best.current:.4g} A meets it most surely, with probability {c.best.probability:.2g}"
    stretches = ", ".join(f"{s.low:.4g} to {s.high:.4g} A" for s in c.intervals)
    return f"{best}; with {probability:g} or more: {stretches or 'none'}"


def closing(document: SimulationFindings) -> str:
    """The last sentence: how far the numbers go."""
    if not document.converged:
        return f"{NOT_CONVERGED}."
    beyond = [f"{r.condition} ({start_text(r)})" for r in document.runs if r.extrapolated_from is not None]
    if beyond:
        return (
            f"Part of it is extrapolated: {', '.join(beyond)} went beyond the temperatures that were measured. "
            "Measure there before you rely on it."
        )
    if document.balance.verdict == "unnamed":
        return "Temperatures stay within what was measured; the heat balance misses something: look at its bands."
    if document.runs:
        return "Temperatures stay within what was measured: bands hold as far as heat balance and curves describe it."
    return "Steady states only; how long they take, a profile of the current tells."
