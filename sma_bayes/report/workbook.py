"""Tables of a report as one Excel workbook, a sheet a table."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from sma_bayes.report.tables import Table, csv_columns
from sma_bayes.runs.store import write_file

SHEET_NAME_LETTERS: Final = 31
"""Letters that Excel allows in the name of a sheet."""


def write_workbook(tables: Mapping[str, Table], path: Path) -> None:
    """Write all tables that have rows, with all digits and columns, units in the head.

    Parameters
    ----------
    tables : mapping of str to Table
    path : Path
        Of the file, ``.xlsx``.

    Raises
    ------
    OutputError
        If it can't be written.
    """
    from openpyxl import Workbook
    from openpyxl.styles import Alignment, Font
    from openpyxl.utils import get_column_letter

    book = Workbook()
    book.remove(book.active)
    for table in tables.values():
        if not table.rows:
            continue
        sheet = book.create_sheet(table.name[:SHEET_NAME_LETTERS])
        columns = csv_columns(table)
        sheet.append(list(columns))
        for row in zip(*columns.values(), strict=True):
            sheet.append([_plain(value) for value in row])
        for cells in sheet.iter_rows():
            for cell in cells:
                if cell.data_type == "f":  # what a user has named is text, whatever it begins with
                    cell.data_type = "s"
        for number, name in enumerate(columns, 1):
            head = sheet.cell(1, number)
            head.font, head.alignment = Font(bold=True), Alignment(wrap_text=True, vertical="top")
            sheet.column_dimensions[get_column_letter(number)].width = min(max(len(name) + 2, 10), 28)
        sheet.freeze_panes = sheet.cell(2, 1)
    write_file(path, book.save)


def _plain(value: Any) -> Any:
    """A value as Excel knows it; what is not finite becomes an empty cell."""
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return int(value) if isinstance(value, np.integer) else value
