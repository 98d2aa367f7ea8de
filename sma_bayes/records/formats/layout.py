"""Where in rows of cells the header stands and the data begin: shared by text files and workbooks."""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TypeAlias

import numpy as np

from sma_bayes.arrays import Ints
from sma_bayes.errors import MeasurementError, ReadingError, many
from sma_bayes.records.formats.numbers import NOT_AVAILABLE, is_blank, looks_numeric
from sma_bayes.records.formats.table import RawTable, Reading, cut_findings, rows_finding
from sma_bayes.records.types import Finding

Row: TypeAlias = tuple[int, Sequence[object]]
"""Source line and cells."""

SAMPLE = 200
"""At least so many rows, where there are as many, tell the shape of the data."""

_UNIT = re.compile(r"\s*[(\[]\s*(.*?)\s*[)\]]\s*")

_PLAIN_UNITS = frozenset({
    "s", "sec", "ms", "min", "h", "hr", "C", "°C", "degC", "deg C", "K", "°F", "degF", "N", "mN", "kN", "gf", "kgf",
    "lbf", "m", "mm", "um", "µm", "cm", "in", "inch", "N/m", "N/mm", "Pa", "kPa", "MPa", "GPa", "psi", "ksi", "%",
    "pct", "mm/mm", "A", "mA", "V", "mV", "W", "Hz", "mHz", "g", "kg", "-", "1",
})  # fmt: skip
"""Units that a line below the names states without brackets."""


_CLOCK_FORMAT = re.compile(r"(?:[dmyhst]{1,4}[-./: ]+)+[dmyhs]{1,4}(?:[.,][0fxs]+)?", re.IGNORECASE)
"""How a clock is written, where a unit would stand: ``dd.mm.yyyy hh:mm:ss``."""


@dataclass(frozen=True, slots=True)
class RowShape:
    """What a row of data looks like.

    Attributes
    ----------
    width : int
        Cells of a row.
    filled : int
        Cells up to the last one that is ever filled; the rest stems from a delimiter at the end of the line.
    numeric : tuple of int
        Columns, from 0, that hold numbers.
    score : float
        Share of the sampled cells that fit: how well this explains the file.
    """

    width: int
    filled: int
    numeric: tuple[int, ...]
    score: float


def spread(n: int) -> range:
    """Indices of some of n rows, evenly spread over them, so that a preamble has little weight."""
    return range(n - 1, -1, -max(1, n // SAMPLE))


def shape_of(sample: Sequence[Sequence[object]], reading: Reading) -> RowShape:
    """Shape of the rows of data, from a sample of the rows of a file.

    Parameters
    ----------
    sample : sequence of rows
        Rows spread over the file, none of them blank.
    reading : Reading
        Codes of missing values count as numbers.

    Returns
    -------
    RowShape
        With score 0 where no row has a number.
    """
    numeric_of = [[_is_number(cell, reading) for cell in row] for row in sample]
    widths = Counter(len(row) for row, is_number in zip(sample, numeric_of, strict=True) if any(is_number))
    if not widths:
        return RowShape(0, 0, (), 0.0)
    width = max(widths, key=lambda w: (widths[w], w))
    rows = [
        (row, is_number)
        for row, is_number in zip(sample, numeric_of, strict=True)
        if len(row) == width and any(is_number)
    ]
    numbers = np.array([is_number for _, is_number in rows])
    empty = np.array([[is_blank(cell) for cell in row] for row, _ in rows])
    ever_filled = np.flatnonzero(~empty.all(axis=0))
    # a column with as many numbers as texts has bad cells, not another meaning
    numeric = tuple(
        int(i) for i in np.flatnonzero(2 * numbers.sum(axis=0) >= (~empty).sum(axis=0)) if i in ever_filled
    )
    filled = int(ever_filled[-1]) + 1
    some = list(numeric)  # a line of words with a number among them, above the data, is no row
    data = 2 * numbers[:, some].sum(axis=1) >= (~empty[:, some]).sum(axis=1)
    share = float(numbers[data].sum() / max(1, (~empty[data]).sum()))
    return RowShape(width, filled, numeric, int(data.sum()) / len(sample) * share)


def tabulate(
    rows: Iterable[Row],
    shape: RowShape,
    reading: Reading,
    file: Path,
    resplit: Callable[[int], Iterable[Sequence[str]]] | None = None,
) -> RawTable:
    """Table from rows of cells: finds the header, checks that the rows are equally long.

    Parameters
    ----------
    rows : iterable of (source line, cells)
    shape : RowShape
    reading : Reading
        ``first_row`` and ``last_row`` are applied here, so that lines outside may look as they like.
    file : Path
        For messages.
    resplit : callable, optional
        Other ways to split a source line into names, for a header with another delimiter than the data.

    Raises
    ------
    MeasurementError
        If there is no data, no header where one must be, or a row of another length.
    """
    rows = iter(rows)
    above, first = _until_data(rows, shape, reading) if shape.numeric else ([], None)
    if first is None:
        raise ReadingError(
            "no row of numbers",
            file=file,
            expected="rows with the same number of cells, most of them numbers",
            remedy="check `delimiter`, `decimal`, `skip_rows` and `quoted_rows` in [reading] of campaign.toml",
            elsewhere="check that the file holds a table of numbers, one delimiter between the cells of every row",
        )
    names, units, findings = _header(above, shape, reading.header, file, resplit)
    cells, lines, more = _collect(chain([first], rows), shape, reading, file)
    columns = tuple(cells[i :: shape.width] for i in range(shape.width))
    return RawTable(names, columns, lines, (*findings, *more), above=tuple(above), units=units)


def _until_data(rows: Iterator[Row], shape: RowShape, reading: Reading) -> tuple[list[Row], Row | None]:
    """Rows above the data (not the blank ones), and the first row of data."""
    above: list[Row] = []
    header = reading.header
    for line, cells in rows:
        if all(is_blank(cell) for cell in cells):
            continue
        if _is_data(cells, shape, reading) if header is None else _follows(above, cells, header=header):
            return above, (line, cells)
        above.append((line, cells))
    return above, None


def _follows(above: Sequence[Row], cells: Sequence[object], *, header: bool) -> bool:
    """Whether data begin here, where the user told of a header: only it and a line of units stand above."""
    return not header or bool(above and not _is_units(cells))


def _is_data(cells: Sequence[object], shape: RowShape, reading: Reading) -> bool:
    if len(cells) < shape.filled:
        return False
    columns = [cells[i] for i in shape.numeric]
    numbers = sum(_is_number(cell, reading) for cell in columns)
    # a row with one bad cell is data, so that the cell is reported and not mistaken for a header
    return numbers > 0 and 2 * numbers >= sum(not is_blank(cell) for cell in columns)


def _is_number(cell: object, reading: Reading) -> bool:
    if looks_numeric(cell):
        return True
    return isinstance(cell, str) and (cell.strip() in reading.missing or cell.strip() in NOT_AVAILABLE)


def _is_units(cells: Sequence[object]) -> bool:
    """Whether each filled cell is a known unit, how a clock is written, or stands in brackets."""
    filled = [cell for cell in cells if not is_blank(cell)]
    return bool(filled) and all(isinstance(cell, str) and _is_unit(cell) for cell in filled)


def _is_unit(cell: str) -> bool:
    text = cell.strip()
    return bool(_UNIT.fullmatch(text) or text in _PLAIN_UNITS or _CLOCK_FORMAT.fullmatch(text))


def _unit(cell: object) -> str:
    """Unit in a cell of a line of units, without brackets; a clock has none."""
    text = "" if is_blank(cell) else str(cell).strip()
    bracketed = _UNIT.fullmatch(text)
    unit = bracketed[1] if bracketed else text
    return "" if _CLOCK_FORMAT.fullmatch(unit) else unit


def _header(
    above: list[Row],
    shape: RowShape,
    header: bool | None,
    file: Path,
    resplit: Callable[[int], Iterable[Sequence[str]]] | None,
) -> tuple[tuple[str, ...] | None, tuple[str, ...] | None, tuple[Finding, ...]]:
    """Names and units of the columns, and findings about the lines above the data."""
    if not above:
        return None, None, ()
    at = len(above) - 1
    units: tuple[str, ...] | None = None
    if at > 0 and _is_units(above[at][1]):
        units = tuple(map(_unit, above[at][1]))
        at -= 1
    line, cells = above[at]
    names = _names(cells, shape)
    findings: tuple[Finding, ...] = ()
    if names is None and resplit:
        names = next(filter(None, (_names(other, shape) for other in resplit(line))), None)
        if names:
            message = f"the header is split otherwise than the rows, into {', '.join(map(repr, names))}"
            findings = (rows_finding("header", message, np.array([line])),)
    if names is None and header:
        raise MeasurementError(
            f"the header has {len(cells)} names, the rows have {shape.filled} columns",
            file=file,
            row=line,
            expected="one name a column",
            remedy="correct the header, or leave it out (`header = false` with `skip_rows`) and give each "
            "column by its number: { column = 2, unit = ... }",
        )
    if names is None or units is None or len(units) > len(names):
        units = None
    else:
        units += ("",) * (len(names) - len(units))
    used = () if names is None else (at,) if units is None else (at, at + 1)
    if units is not None:
        message = f"the units stand below the names: {', '.join(u or '-' for u in units)}"
        findings = (*findings, rows_finding("units", message, np.array([above[at + 1][0]])))
    skipped = np.array([n for i, (n, _) in enumerate(above) if i not in used], dtype=np.int64)
    if not skipped.size:
        return names, units, findings
    what = "above the data" if names is None else f"around the header in line {line}"
    message = f"{many(skipped.size, 'line')} {what}, neither names nor data, left out"
    return names, units, (*findings, rows_finding("preamble", message, skipped))


def _names(cells: Sequence[object], shape: RowShape) -> tuple[str, ...] | None:
    """Column names if the cells fit the columns; columns that are never filled need none."""
    names = ["" if cell is None else " ".join(str(cell).split()) for cell in cells]
    names[:1] = [name.lstrip("# ") for name in names[:1]]
    while len(names) > shape.width and not names[-1]:
        names.pop()
    if not shape.filled <= len(names) <= shape.width or not any(names):
        return None
    return tuple(names + [""] * (shape.width - len(names)))


def _collect(
    rows: Iterable[Row], shape: RowShape, reading: Reading, file: Path
) -> tuple[list[object], Ints, tuple[Finding, ...]]:
    """All cells one after the other, the line of each row, and what was left out."""
    first, last = reading.first_row or 0, reading.last_row or sys.maxsize
    cells: list[object] = []
    lines: list[int] = []
    blank: list[int] = []
    cut: list[int] = []
    for line, row in rows:
        if len(row) != shape.width or is_blank(row[0]):
            if all(is_blank(cell) for cell in row):
                blank.append(line)
                continue
            if first <= line <= last:
                row = _fitted(row, shape, file, line)
        if first <= line <= last:
            cells.extend(row)
            lines.append(line)
        else:
            cut.append(line)
    kept, blank_lines = np.array(lines, dtype=np.int64), np.array(blank, dtype=np.int64)
    between = blank_lines[(blank_lines > kept[:1].sum()) & (blank_lines < kept[-1:].sum())]
    findings = cut_findings(np.array(cut, dtype=np.int64), kept, reading, file)
    if between.size:
        message = f"{many(between.size, 'blank line')} between the data, left out"
        findings = (*findings, rows_finding("blank-line", message, between))
    return cells, kept, findings


def _fitted(row: Sequence[object], shape: RowShape, file: Path, line: int) -> Sequence[object]:
    """Row with as many cells as the others, where only empty cells at its end make the difference."""
    extra = row[shape.width :]
    if len(row) < shape.filled or not all(is_blank(cell) for cell in extra):
        raise ReadingError(
            f"the row has {len(row)} cells, the others have {shape.filled}",
            file=file,
            row=line,
            expected="rows of equal length",
            remedy="complete the row, or leave it out with `first_row` or `last_row` in [reading] of campaign.toml",
            elsewhere="complete the row, or remove it",
        )
    return [*row[: shape.width], *[""] * (shape.width - len(row))]
