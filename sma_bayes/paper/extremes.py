"""Tables 9 to 12: least and greatest temperature and stiffness of each test; see `sma_bayes.paper.tables`.

The tables don't say which test runs they belong to. That Table 9 goes with Table 3 and Table 12 with Table 5,
both of which print 2 A at 10 mHz, is inferred from their titles.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any, Final

from sma_bayes.paper.tables import CONDITIONS, CellStatus, PrintedCell, PrintedTable, read_table
from sma_bayes.records.types import Condition

EXTREME_UNITS: Final[Mapping[str, str]] = MappingProxyType(
    {"temperature_min": "degC", "temperature_max": "degC", "stiffness_min": "N/m", "stiffness_max": "N/m"}
)
"""Quantities of Tables 9 to 12 in the order of their columns, with printed units."""

DUTY_CONDITIONS: Final[Mapping[str, Condition]] = MappingProxyType(
    {
        c.id: c
        for c in (
            Condition(f"2A-20mHz-{percent}pct", current=2.0, frequency=0.020, duty_cycle=percent / 100)
            for percent in (40, 60, 80)
        )
    }
)
"""Conditions of Table 11."""

EXTREME_CONDITIONS: Final[Mapping[str, Condition]] = MappingProxyType({**CONDITIONS, **DUTY_CONDITIONS})
"""Conditions of Tables 9 to 12."""


def _cells(found: Mapping[str, Any]) -> Iterator[PrintedCell]:
    """Rows of line, condition, and four printed values."""
    for line, condition, text in found["rows"]:
        for (quantity, unit), printed in zip(EXTREME_UNITS.items(), text.split(), strict=True):
            yield PrintedCell(quantity, unit, printed, line, condition)


TABLE_9, TABLE_10, TABLE_11, TABLE_12 = EXTREME_TABLES = tuple(read_table(n, _cells) for n in (9, 10, 11, 12))
"""Printed extremes."""


def extremes(table: PrintedTable) -> dict[str, dict[str, float]]:
    """Printed extremes by condition, whatever their status; lost values are left out.

    Examples
    --------
    >>> extremes(TABLE_9)["1A-10mHz"]["stiffness_max"]
    146.54
    """
    found: dict[str, dict[str, float]] = {}
    for cell in table.cells:
        if cell.status is not CellStatus.DAMAGED:
            found.setdefault(cell.condition, {})[cell.quantity] = cell.value
    return found
