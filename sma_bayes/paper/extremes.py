"""Tables 9 to 12: least and greatest temperature and stiffness of each test; see `sma_bayes.paper.tables`.

The tables don't say which test runs they belong to. That Table 9 goes with Table 3 and Table 12 with Table 5,
both of which print 2 A at 10 mHz, is inferred from their titles.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Final

from sma_bayes.paper.tables import CONDITIONS, CellStatus, PrintedCell, PrintedTable
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

_BELOW_AS = (
    "below the austenite start of 73.83 °C (line 339): either the sensor missed the hottest part of the spring, "
    "or the calorimeter's temperatures don't hold for it under load"
)
_LOST = "repeats the columns of frequency and least temperature; the stiffness is lost"

_DOUBTS: Final[Mapping[tuple[int, str, str], tuple[CellStatus, str]]] = MappingProxyType(
    {
        (9, "1A-10mHz", "temperature_max"): (
            CellStatus.IMPLAUSIBLE,
            f"{_BELOW_AS}; the stiffness of this row rises 6.0-fold",
        ),
        **{
            (11, f"2A-20mHz-{percent}pct", "temperature_max"): (
                CellStatus.IMPLAUSIBLE,
                f"{_BELOW_AS}; the stiffness of this row rises {rise}-fold",
            )
            for percent, rise in ((40, "14.0"), (60, "29.2"), (80, "31.9"))
        },
        **{
            (11, f"2A-20mHz-{percent}pct", "stiffness_max"): (
                CellStatus.IMPLAUSIBLE,
                f"needs a shear modulus of {modulus} GPa in the spring of Table 1, where the greatest stiffness of "
                "the other tables (189.52 N/m) needs 29.5 GPa; a slope along the path, not the stiffness of a spring",
            )
            for percent, modulus in ((40, "36.6"), (60, "77.1"), (80, "80.8"))
        },
        (12, "2A-50mHz", "temperature_max"): (CellStatus.IMPLAUSIBLE, _BELOW_AS),
        **{
            (12, condition, quantity): (CellStatus.DAMAGED, _LOST)
            for condition in ("2A-10mHz-table5", "2A-30mHz", "2A-50mHz")
            for quantity in ("stiffness_min", "stiffness_max")
        },
    }
)


def _table(number: int, title: str, rows: Iterable[tuple[int, str, str]]) -> PrintedTable:
    """Read rows of (line, condition, four printed values)."""
    cells = []
    for line, condition, text in rows:
        for (quantity, unit), printed in zip(EXTREME_UNITS.items(), text.split(), strict=True):
            status, reason = _DOUBTS.get((number, condition, quantity), (CellStatus.OK, ""))
            cells.append(PrintedCell(quantity, unit, printed, line, condition, status=status, reason=reason))
    return PrintedTable(number, title, tuple(cells))


TABLE_9: Final = _table(
    9,
    "temperature and stiffness by current, 10 mHz",
    (
        (394, "1A-10mHz", "30.08 71.87 24.39 146.54"),
        (395, "1.5A-10mHz", "25.01 123.04 21.78 159.07"),
        (396, "2A-10mHz-table3", "29.22 130.77 29.96 180.26"),
    ),
)

TABLE_10: Final = _table(
    10,
    "temperature and stiffness by load, 10 mHz",
    (
        (405, "100g-10mHz", "35.5 141.25 34.78 153.97"),
        (406, "150g-10mHz", "36.73 159.21 25.38 184.99"),
        (407, "200g-10mHz", "27.24 146.20 23.16 189.52"),
    ),
)

TABLE_11: Final = _table(
    11,
    "temperature and stiffness by duty cycle, 2 A, 20 mHz",
    (
        (455, "2A-20mHz-40pct", "28.06 55.46 16.80 235.46"),
        (456, "2A-20mHz-60pct", "28.06 65.55 16.96 495.68"),
        (457, "2A-20mHz-80pct", "31.28 71.38 16.30 519.28"),
    ),
)

TABLE_12: Final = _table(
    12,
    "temperature and stiffness by frequency, 2 A",
    (
        (466, "2A-10mHz-table5", "29.16 126.81 10 29.16"),
        (467, "2A-30mHz", "29.40 126.13 30 29.40"),
        (468, "2A-50mHz", "31.00 73.80 50 31.00"),
    ),
)

EXTREME_TABLES: Final = (TABLE_9, TABLE_10, TABLE_11, TABLE_12)
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
