"""Workbooks: XLSX."""

from __future__ import annotations

import warnings
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias

from sma_bayes.errors import MeasurementError, ReadingError, near_matches
from sma_bayes.limits import WORKBOOK_BYTES, WORKBOOK_CELLS, WORKBOOK_ROWS
from sma_bayes.records.formats.layout import shape_of, spread, tabulate
from sma_bayes.records.formats.numbers import is_blank
from sma_bayes.records.formats.table import Format, RawTable, Reading

_Sheet: TypeAlias = list[list[object]]


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file is a zip archive that holds a workbook."""
    if not head.startswith(b"PK\x03\x04"):
        return False
    try:
        with zipfile.ZipFile(path) as archive:
            return "xl/workbook.xml" in archive.namelist()
    except (zipfile.BadZipFile, NotImplementedError):
        return path.suffix.lower() in (".xlsx", ".xlsm")


def read(path: Path, reading: Reading) -> RawTable:
    """Read one sheet of a workbook; formulas give the values that were saved with them.

    Parameters
    ----------
    path : Path
    reading : Reading
        ``sheet`` says which sheet where several hold cells.

    Returns
    -------
    RawTable
        Columns are counted from A, source lines are the rows of the sheet.

    Raises
    ------
    MeasurementError
        If the workbook is damaged, the sheet is not there or not told, or the sheet has no rows of numbers.
    """
    sheets = _sheets(path)
    rows = _chosen(sheets, reading.sheet, path)
    body = rows[reading.skip_rows :]
    sample = [body[i] for i in spread(len(body)) if not all(is_blank(cell) for cell in body[i])]
    return tabulate(enumerate(body, start=reading.skip_rows + 1), shape_of(sample, reading), reading, path)


def sheet_titles(path: Path) -> tuple[str, ...]:
    """Titles of the sheets of a workbook, without reading their cells.

    Raises
    ------
    MeasurementError
        If the workbook is damaged.
    """
    with _opened(path) as book:
        return tuple(sheet.title for sheet in book.worksheets)


def _sheets(path: Path) -> dict[str, _Sheet]:
    """Cells of every sheet by its title."""
    with _opened(path) as book:
        for sheet in book.worksheets:
            sheet.reset_dimensions()  # what a file says of them may be wrong, and rows beyond would go missing
        return {sheet.title: _cells(sheet.iter_rows(values_only=True), path) for sheet in book.worksheets}


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Workbook, open for reading of values."""
    import openpyxl

    try:
        # opened here, because openpyxl judges a path by its suffix
        with path.open("rb") as file, warnings.catch_warnings():
            # parts of a workbook that openpyxl drops (drawings, validation rules) hold no cells
            warnings.simplefilter("ignore", UserWarning)
            _require_bytes(path)
            yield openpyxl.load_workbook(file, read_only=True, data_only=True)
    except MeasurementError:
        raise
    except Exception as error:  # on a damaged file the parsers of zip and XML raise whatever they meet
        raise MeasurementError(
            f"the workbook is damaged: {error}",
            file=path,
            expected="a workbook that a spreadsheet program opens",
            remedy="open and save it again, or export the sheet as CSV",
        ) from None


def _require_bytes(path: Path) -> None:
    with zipfile.ZipFile(path) as archive:
        size = sum(part.file_size for part in archive.infolist())
    if size > WORKBOOK_BYTES.value:
        raise _too_large(
            f"the workbook has {size} bytes when unpacked, the limit is {WORKBOOK_BYTES.value}", path
        )


def _too_large(found: str, path: Path) -> MeasurementError:
    return MeasurementError(
        found,
        file=path,
        expected="a sheet of measurements and little else",
        remedy="delete rows and columns beyond the data and save it again, or export the sheet as CSV",
    )


def _cells(rows: Iterable[tuple[object, ...]], path: Path) -> _Sheet:
    """Cells of a sheet, each row as long as the longest."""
    cells: _Sheet = []
    width = 0
    for row in rows:
        width = max(width, len(row))
        cells.append([_cell(value) for value in row])
        if len(cells) > WORKBOOK_ROWS.value or len(cells) * width > WORKBOOK_CELLS.value:
            raise _too_large(
                f"a sheet has more than {WORKBOOK_ROWS.value} rows or {WORKBOOK_CELLS.value} cells, empty ones too",
                path,
            )
    return [row + [None] * (width - len(row)) for row in cells]


def _cell(value: object) -> object:
    # a truth value would pass for the number 0 or 1
    return str(value).upper() if isinstance(value, bool) else value


def _chosen(sheets: dict[str, _Sheet], wanted: str | int | None, path: Path) -> _Sheet:
    filled = {title: rows for title, rows in sheets.items() if rows}
    titles = list(sheets)
    if wanted is None and len(filled) == 1:
        return next(iter(filled.values()))
    if isinstance(wanted, int) and 1 <= wanted <= len(titles):
        return sheets[titles[wanted - 1]]
    if isinstance(wanted, str) and wanted in sheets:
        return sheets[wanted]
    if wanted is None:
        found = "the workbook has no cells" if not filled else f"the workbook has {len(filled)} sheets"
        expected = "one sheet: " + ", ".join(repr(title) for title in filled or titles)
    else:
        found = f"the workbook has no sheet {wanted!r}"
        expected = near_matches(str(wanted), titles)
    raise ReadingError(
        found,
        file=path,
        expected=expected,
        remedy="set `sheet` in [reading] of campaign.toml",
        elsewhere="save the sheet as a workbook of its own, or export it as CSV",
    )


FORMAT = Format("Excel workbook", recognises, read)
