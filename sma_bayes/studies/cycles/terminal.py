"""A study of cycles on the screen: cycle by cycle, the law, and one closing sentence for each condition."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from sma_bayes.report.notation import interval_text, unit_label
from sma_bayes.report.screen import ENTRIES_SHOWN, Screen, numbers, screen, show_end, titled
from sma_bayes.runs.shown import in_declared_units
from sma_bayes.studies.cycles.schema import ConditionCycles, CyclesDocument, QuantityByCycle
from sma_bayes.studies.cycles.tables import span

COLUMNS: Final = 7
"""Quantities side by side, at most; the report has all of them."""
FORECAST: Final = 4
"""Cycles that are forecast among those shown, where there are very many."""


def show_cycles(told: Mapping[str, Any], out: Path) -> None:
    """Tell what was found of each condition, and what to doubt."""
    found = in_declared_units(CyclesDocument.model_validate(told))
    console = screen()
    console.tell(f"{found.campaign}, seed {found.seed}")
    for one in found.conditions[:ENTRIES_SHOWN]:
        _show_condition(console, one, found.temperature_unit)
    if len(found.conditions) > ENTRIES_SHOWN:
        console.print(f"and {len(found.conditions) - ENTRIES_SHOWN} more conditions")
    console.tell(*(f"remark: {text}" for text in found.declared_differently))
    console.tell(*(f"left out {text}" for text in found.left_out))
    if not found.converged:
        console.tell("NOT CONVERGED: the numbers must not be relied on; another `--seed` may help.")
    show_end(console, told, out)


def _show_condition(console: Screen, one: ConditionCycles, temperature_unit: str) -> None:
    console.print()
    for branch in dict.fromkeys(q.branch for q in one.quantities):
        own = [q for q in one.quantities if q.branch == branch]
        shown = [q for q in own if q.name in ("offset", "stroke", "shift", "width")]
        shown = [
            *shown[:4],
            *([q for q in own if q.name == "stiffness"] or [q for q in own if q.at is not None]),
            *(q for q in own if q.name[-1] in "sf"),
        ]
        _show_branch(console, one, branch, list(dict.fromkeys(map(id, shown))), own, temperature_unit)
    if None in shown_rows(len(one.measured), len(one.cycles)):
        console.tell("cycles that are not shown (…) are in `quantities.csv`")
    console.tell(f"law of training: {one.law.reason}")
    console.tell(
        *(
            f"cycle{'s' if len(h.held_out) > 1 else ''} {span(h.held_out)} forecast from {span(h.trained)}, "
            f"{h.branch}, {h.channel}: misses "
            f"{h.rmse:.2%} of the range (the last curve {h.rmse_last:.2%}); "
            f"{h.covered:.0%} of the samples in their 90 % intervals"
            for h in one.held_out
        )
    )
    console.tell(*(f"remark: {text}" for text in one.remarks))
    console.tell(f"{one.condition}: {one.stable.statement}")


def _show_branch(
    console: Screen,
    one: ConditionCycles,
    branch: str,
    order: list[int],
    own: list[QuantityByCycle],
    temperature_unit: str,
) -> None:
    by_id = {id(q): q for q in own}
    shown = [by_id[i] for i in order][:COLUMNS]
    heads = ["cycle"]
    for q in shown:
        at = f" at {q.at:g} {unit_label(temperature_unit)}" if q.at is not None else ""
        heads.append(f"{q.name}{at} [{unit_label(q.unit) or '1'}]")
    table = titled(f"{one.condition}, {branch}: median (90 %), pooled over cycles", *map(numbers, heads))
    for i in shown_rows(len(one.measured), len(one.cycles)):
        if i is None:
            table.add_row("…")
            continue
        later = "" if one.cycles[i] in one.measured else " forecast"
        table.add_row(
            f"{one.cycles[i]}{later}", *(interval_text(q.median[i], q.q05[i], q.q95[i]) for q in shown)
        )
    console.print(table)


def shown_rows(measured: int, cycles: int) -> list[int | None]:
    """Places of the cycles that are shown, None where some are left out: first and last ones, mostly measured."""
    if cycles <= ENTRIES_SHOWN:
        return list(range(cycles))
    return [
        *_first_and_last(range(measured), ENTRIES_SHOWN - FORECAST),
        *_first_and_last(range(measured, cycles), FORECAST),
    ]


def _first_and_last(rows: range, most: int) -> list[int | None]:
    return [*rows] if len(rows) <= most else [*rows[: most // 2], None, *rows[-most // 2 :]]
