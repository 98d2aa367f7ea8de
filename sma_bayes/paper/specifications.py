"""Tables 1 and 2 and the numbers of the running text, as printed; see `sma_bayes.paper.tables`.

The entries of Tables 1 and 2 mix digits, units and symbols. `PrintedCell.entry` keeps the whole entry,
`PrintedCell.printed` its digits; a range such as "28 – 41 GPa" gives two cells. Units are written as pint knows
them; kCal and J stand without the rest of their unit in some entries, and the heat transfer coefficient without
any: what had to be added is said in the errata.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from sma_bayes.errors import require_known
from sma_bayes.paper.tables import PrintedCell, PrintedTable, read_table
from sma_bayes.quantities import convert


def _cells(found: Mapping[str, Any]) -> Iterator[PrintedCell]:
    """Rows of line, quantity, unit, digits, power of ten, and the whole entry."""
    for line, quantity, unit, printed, power, entry in found["rows"]:
        yield PrintedCell(quantity, unit, printed, line, power=power, entry=entry)


TABLE_1, TABLE_2 = (read_table(n, _cells) for n in (1, 2))
TEXT_VALUES: Final = read_table(0, _cells)
"""Numbers that the errata need and no table holds. Figs. 9 to 11 are 1.5 A, 2 A, and 100 g at 2 A, all at
10 mHz."""


def specification(table: PrintedTable, quantity: str, unit: str) -> float:
    """Printed value of a specification, in a wanted unit, whatever its status.

    Parameters
    ----------
    table : PrintedTable
        `TABLE_1`, `TABLE_2` or `TEXT_VALUES`.
    quantity : str
    unit : str
        Any unit of the same kind.

    Raises
    ------
    UnknownNameError
        If the table has no such quantity.
    QuantityError
        If the unit is of another kind.

    Examples
    --------
    >>> specification(TABLE_1, "wire_diameter", "mm")
    0.5
    """
    row = table.select("", None)
    require_known(quantity, row, f"table {table.number} has no {quantity!r}")
    cell = row[quantity]
    return float(convert(cell.value, cell.unit, unit, what=quantity))
