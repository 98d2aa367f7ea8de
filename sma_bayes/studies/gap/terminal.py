"""A gap study on the screen: the verdict, where, what, and by how much the gap closed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from rich.table import Column, Table

from sma_bayes.report.notation import compact, interval_text, unit_label
from sma_bayes.report.screen import Screen, numbers, screen, show_end, titled
from sma_bayes.studies.gap.schema import (
    AddedEffect,
    EffectParameter,
    GapDocument,
    GapFindings,
    GapOfModel,
    HeatingFindings,
    HeatParameter,
    JudgedCandidate,
    StatedDisagreement,
)
from sma_bayes.studies.gap.shown import in_declared_units
from sma_bayes.studies.gap.words import (
    channel_text,
    closed_text,
    covariate_text,
    jump_text,
    p_text,
    periodic_text,
    remainder_text,
    shape_text,
)

MOST_JUMPS: Final = 3
"""Jumps that are told; the file has all."""
ROWS_OF_ONE_REASON: Final = 3
"""Candidates that have a row each although the reason is the same; more share a line."""
VERDICTS: Final = {
    "named": "NAMED: the model misses something, and the catalogue has a name for it",
    "unnamed": "UNNAMED: the model misses something, and nothing in the catalogue accounts for it",
    "none": "NONE: no disagreement beyond what chance explains",
}


def show_gap(stated: dict[str, Any], out: Path) -> None:
    """Tell what `gap.json` says."""
    console, found = screen(), in_declared_units(GapDocument.model_validate(stated))
    reason = "" if found.model_choice is None else found.model_choice.reason
    _show_part(console, found, found.campaign, reason)
    if found.heating is not None:
        _show_part(console, found.heating, f"{found.campaign}, heating (temperature from current)")
        console.tell(f"heat balance: {_numbers(found.heating.parameters)}")
    console.tell(*(f"note: {text}" for text in (*found.declared_differently, *found.remarks)))
    if not found.converged:
        console.tell(
            "NOT CONVERGED: draws and intervals must not be relied on; the verdict does not rest on them."
        )
    show_end(console, stated, out)


def _show_part(console: Screen, found: GapFindings | HeatingFindings, title: str, reason: str = "") -> None:
    """The response, or the heat balance."""
    chance = p_text(found.p_value)
    verdict = VERDICTS[found.verdict]
    if found.verdict == "named" and remainder_text(found):
        verdict = f"{verdict}, {remainder_text(found)}"
    console.tell(f"{title}: {verdict} ({chance})")
    if shape_text(found):
        console.tell(f"  {shape_text(found)}")
    if reason:
        console.tell(f"  model {reason}")
    for line in found.periodic[:3]:
        console.tell(f"  {periodic_text(found.channels, line)} ({line.size_sigma:.1f} sigma)")
    for jump in found.jumps[:MOST_JUMPS]:
        console.tell(f"  {jump_text(found.channels, jump)}")
    if len(found.jumps) > MOST_JUMPS:
        console.tell(f"  and {len(found.jumps) - MOST_JUMPS} more jumps; gap.json has all")
    for d in found.disagreement[:3]:
        console.tell(
            f"  {d.condition} {d.branch}: {channel_text(found.channels, d.channel)} "
            f"{d.side} the model, {covariate_text(found.channels, d.covariate)} "
            f"{_stretch(d)} ({abs(d.size_sigma):.1f} sigma)"
        )
    console.tell(*(_effect_text(e, partial=e in found.partial) for e in found.added))
    if found.verdict == "none":
        factors = [c.ln_bayes_factor for c in found.candidates if c.ln_bayes_factor is not None]
        if factors:
            console.print(f"no candidate stands out; the greatest ln Bayes factor is {max(factors):.1f}")
    else:
        _show_candidates(console, [c for c in found.candidates if c.status != "untestable"])
    untested = [c.id for c in found.candidates if c.status == "untestable"]
    if untested:
        console.tell(f"these data cannot test {', '.join(untested)}; the report says why")
    console.tell(_gap_text(found), *(f"caution: {text}" for text in found.cautions))


def _effect_text(e: AddedEffect, *, partial: bool) -> str:
    lines = [f"{'helps: ' if partial else ''}{e.id} ({e.title}): {_numbers(e.parameters)}"]
    if e.rivals:
        lines.append(f"  these data cannot tell it from {', '.join(e.rivals)}")
    if e.next_experiment:
        lines.append(f"  what would: {e.next_experiment}")
    return "\n".join(lines)


def _numbers(parameters: Mapping[str, EffectParameter] | Mapping[str, HeatParameter]) -> str:
    """Parameters with their medians and 90 % intervals."""
    return ", ".join(
        f"{name} {interval_text(p.median, p.q05, p.q95)} {unit_label(p.unit)}".rstrip()
        for name, p in parameters.items()
    )


def _stretch(d: StatedDisagreement) -> str:
    """Where a stretch begins and ends, or the one place that it is."""
    ends = dict.fromkeys(compact(end) for end in (d.from_, d.to))
    return f"{' to '.join(ends)} {unit_label(d.unit)}".rstrip()


def _show_candidates(console: Screen, tested: Sequence[JudgedCandidate]) -> None:
    """A row each; one line for all that share a reason."""
    times = Counter(c.why for c in tested)
    rows = [c for c in tested if times[c.why] <= ROWS_OF_ONE_REASON]
    if rows:
        console.print(_candidate_rows(rows))
    for why in (why for why, n in times.items() if n > ROWS_OF_ONE_REASON):
        alike = (f"{c.id} ({_factor(c)})" for c in tested if c.why == why)
        console.tell(f"rejected, {why} (ln BF): {', '.join(alike)}")


def _factor(candidate: JudgedCandidate) -> str:
    factor = candidate.ln_bayes_factor
    return "-" if factor is None else f"{factor:z.1f}"


def _candidate_rows(tested: Sequence[JudgedCandidate]) -> Table:
    scored = any(c.delta_elpd_held_out is not None for c in tested)
    table = titled(
        "candidates that could be tested",
        Column("effect", no_wrap=True),
        numbers("ln BF", no_wrap=True),
        *([numbers("held-out score")] if scored else []),
        Column("status", no_wrap=True),
        "why",
    )
    for c in tested:
        score = c.delta_elpd_held_out
        told = "-" if score is None else f"{score:.1f} ± {c.delta_elpd_se:.1f}"
        cells = [c.id, _factor(c), told, c.status, c.why]
        table.add_row(*(cells if scored else cells[:2] + cells[3:]))
    return table


def _gap_text(found: GapOfModel) -> str:
    gap = found.gap
    start = f"gap on held-out measurements ({gap.held_out}; 1 is noise alone)"
    if not found.added:
        return f"{start}: {gap.before:.3f}; nothing was added"
    explainable = (
        f"{100.0 * gap.shrink:.0f} % of what can be explained (floor {gap.floor:.3f})"
        if gap.before > gap.floor
        else "nothing to explain"
    )
    return f"{start}: {closed_text(found)}; {explainable}"
