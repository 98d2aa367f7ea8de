"""A watch on the screen: the last cycles, what was not whole, what changed, and one closing sentence."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from sma_bayes.errors import many
from sma_bayes.quantities import quantity_of
from sma_bayes.report.notation import unit_label, write
from sma_bayes.report.screen import ENTRIES_SHOWN, FIT_AGAIN, Screen, numbers, screen, show_end, titled
from sma_bayes.runs.shown import in_declared_units
from sma_bayes.studies.watch.schema import WatchDocument, WatchedNumber
from sma_bayes.studies.watch.tables import scatter_of

CYCLES_SHOWN: Final = 5
"""Cycles that are shown number by number."""


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
    console.tell(
        *(
            f"numbers together, as one cause moves them ({c.title}): most log10 e {max(c.log10_e):.2f} ALARM"
            for c in found.together
            if c.alarm
        )
    )
    console.tell(*(f"not whole, not counted: {text}" for text in found.partial[-ENTRIES_SHOWN:]))
    console.tell(
        *(f"remark: {text}" for text in (*found.declared_differently, *found.remarks[-ENTRIES_SHOWN:]))
    )
    console.tell(*(limit.statement for limit in found.limits))
    if not found.converged:
        console.tell(f"NOT CONVERGED: the fit must not be relied on; {FIT_AGAIN}.")
    console.tell(found.statement)
    show_end(console, told, out)


def _show_numbers(console: Screen, found: WatchDocument) -> None:
    last = found.cycles[-CYCLES_SHOWN:]
    counted = map(numbers, [*(f"{c.cycle}" for c in last), "most log10 e"])
    which = "watched cycles" if len(last) == len(found.cycles) else f"last {len(last)} of the watched cycles"
    table = titled(f"{which}; ! is outside the normal range (95 %)", "", "normal", *counted)
    for n in found.numbers:
        name = f"{n.branch} {quantity_of(n.channel, specimen=found.specimen)} {n.number} [{unit_label(n.unit) or '1'}]"
        evidence = f"{max(n.log10_e):z.2f}" + (" ALARM" if n.alarm else "")
        table.add_row(name, *_row(n, len(last)), evidence)
    console.print(table)


def _row(n: WatchedNumber, count: int) -> list[str]:
    """Normal range and the last values of a number, with the digits that the range bears."""
    low, high = n.normal_low[-1], n.normal_high[-1]
    known = low is not None and high is not None
    ends, values = [low, high] if known else [], n.value[-count:]
    digits = write([*ends, *values], resolution=scatter_of(n)).plain
    normal = f"{digits[0]} to {digits[1]}" if known else "not known yet"
    outside = [_outside(n, i - count) for i in range(count)]
    return [normal, *(v + "!" * o for v, o in zip(digits[len(ends) :], outside, strict=True))]


def _outside(n: WatchedNumber, at: int) -> bool:
    value, low, high = n.value[at], n.normal_low[at], n.normal_high[at]
    return low is not None and high is not None and not low <= value <= high
