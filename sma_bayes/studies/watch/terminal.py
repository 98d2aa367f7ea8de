"""A watch on the screen: the last cycles, what was not whole, what changed, and one closing sentence."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from rich.table import Table

from sma_bayes.errors import many
from sma_bayes.quantities import quantity_of
from sma_bayes.report.notation import unit_label
from sma_bayes.report.screen import SHOWN, Screen, screen, show_end
from sma_bayes.studies.watch.schema import WatchDocument, WatchedNumber
from sma_bayes.studies.watch.shown import in_declared_units

LAST: Final = 5
"""Cycles that are shown number by number."""


def show_line(text: str) -> None:
    """Tell of one file, as it was taken."""
    screen().print(text, soft_wrap=True)


def show_watch(told: Mapping[str, Any], out: Path | None) -> None:
    """Tell what the watched cycles say."""
    found = in_declared_units(WatchDocument.model_validate(told))
    console = screen()
    console.tell(
        f"{found.campaign}, {found.condition}: {many(len(found.fitted), 'cycle')} fitted, {len(found.cycles)} watched; "
        f"false alarms, ever: at most {found.alpha:.2g}"
    )
    if found.cycles:
        _show_numbers(console, found)
    console.tell(*(f"not whole, not counted: {text}" for text in found.partial[-SHOWN:]))
    console.tell(*(f"remark: {text}" for text in (*found.declared_differently, *found.remarks[-SHOWN:])))
    console.tell(*(limit.statement for limit in found.limits))
    if not found.converged:
        console.print("NOT CONVERGED: the fit must not be relied on.")
    console.tell(found.statement)
    show_end(console, told, out)


def _show_numbers(console: Screen, found: WatchDocument) -> None:
    last = found.cycles[-LAST:]
    table = Table(title="watched cycles; ! is outside the normal range (95 %)", title_justify="left")
    for name in ("", "normal"):
        table.add_column(name, justify="left")
    for c in last:
        table.add_column(f"{c.cycle}", justify="right")
    table.add_column("log10 e-value", justify="right")
    for n in found.numbers:
        low, high = n.normal_low[-1], n.normal_high[-1]
        normal = "not known yet" if low is None or high is None else f"{low:.4g} to {high:.4g}"
        cells = [_cell(n, i - len(last)) for i in range(len(last))]
        channel = quantity_of(n.channel, specimen=found.specimen)
        name = f"{n.branch} {channel} {n.number} [{unit_label(n.unit) or '1'}]"
        table.add_row(name, normal, *cells, f"{n.log10_e[-1]:.2f}" + (" ALARM" if n.alarm else ""))
    console.print(table)


def _cell(n: WatchedNumber, at: int) -> str:
    value, low, high = n.value[at], n.normal_low[at], n.normal_high[at]
    outside = low is not None and high is not None and not low <= value <= high
    return f"{value:.4g}" + ("!" if outside else "")
