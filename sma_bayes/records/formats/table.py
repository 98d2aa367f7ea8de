"""What a data format gives, a table of cells with their source lines, and what it is told: how to read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import compress
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from sma_bayes.arrays import Floats, Ints
from sma_bayes.errors import MeasurementError, ReadingError, many
from sma_bayes.records.types import Finding

Cells: TypeAlias = Floats | Sequence[object]
"""One column: numbers already, or cells as they stand in the file (text, numbers, None for an empty cell)."""

WHITESPACE = "whitespace"
"""Delimiter that stands for any run of blanks and tabs."""

ROWS_SHOWN = 10
"""A finding lists the first so many source lines."""


class Reading(BaseModel):
    """The ``[reading]`` table: what a file needs to be read, as far as it can't be found in the file itself.

    Attributes
    ----------
    format : str, optional
        Name of the format; recognised from the file's content otherwise.
    header : bool, optional
        Whether a row of column names stands before the data; found by itself otherwise.
    skip_rows : int
        Lines at the top to leave out.
    delimiter : str, optional
        One character, or ``"whitespace"``; found by itself otherwise.
    decimal : {".", ","}
        Decimal mark; where it isn't declared, found by itself in text whose cells a comma does not separate.
    missing : tuple of float or str
        Codes that stand for a missing value in any column. A number matches by value, a text by its letters.
    quoted_rows : bool
        Whether each whole row stands in quotation marks, with the inner ones doubled.
    encoding : str, optional
        Text encoding; UTF-8, or what the byte-order mark says, otherwise.
    first_row, last_row : int, optional
        First and last source line to keep, counted from 1.
    sheet : str or int, optional
        Sheet of a workbook, by name or number from 1.
    group : str, optional
        Channel group of a TDMS file.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    format: str | None = None
    header: bool | None = None
    skip_rows: int = Field(default=0, ge=0)
    delimiter: str | None = None
    decimal: Literal[".", ","] = "."
    missing: Annotated[tuple[float | str, ...], Field(strict=False)] = ()
    quoted_rows: bool = False
    encoding: str | None = None
    first_row: int | None = Field(default=None, ge=1)
    last_row: int | None = Field(default=None, ge=1)
    sheet: str | int | None = None
    group: str | None = None

    @field_validator("delimiter")
    @classmethod
    def _one_character(cls, delimiter: str | None) -> str | None:
        if delimiter is not None and delimiter != WHITESPACE and len(delimiter) != 1:
            raise ValueError(f"one character, or {WHITESPACE!r}")
        return WHITESPACE if delimiter == " " else delimiter

    @model_validator(mode="after")
    def _consistent(self) -> Reading:
        if self.delimiter == self.decimal:
            raise ValueError("a delimiter other than the decimal mark")
        if self.first_row and self.last_row and self.first_row > self.last_row:
            raise ValueError("a first_row that is not after last_row")
        return self


@dataclass(frozen=True, slots=True, eq=False)
class RawTable:
    """Content of one data file, cells not yet turned into numbers.

    Cells stay as they are because a column that nobody asks for may hold anything; `numbers` turns one column
    into numbers and knows the source line of a cell that isn't one.

    Attributes
    ----------
    names : tuple of str or None
        Column names, runs of blanks and line ends in them as one blank; None where the file has no header. A
        name may be empty or occur twice.
    columns : tuple of Cells
        One entry a column. Formats without rows (MAT, TDMS) may hold columns of different lengths.
    row : ndarray of int, shape (n,)
        Source line of each entry of the longest column, counted from 1; number of the sample in a format
        without lines.
    findings : tuple of Finding
        What was skipped on the way.
    decimal : str or None
        Decimal mark, where the file itself declares or shows one.
    above : tuple of tuple
        Rows above the data with their source line, that of the names included; blank ones are left out.
    units : tuple of str or None
        Units that a line below the names states, empty where it has none; None without such a line.
    """

    names: tuple[str, ...] | None
    columns: tuple[Cells, ...]
    row: Ints
    findings: tuple[Finding, ...] = ()
    decimal: str | None = None
    above: tuple[tuple[int, Sequence[object]], ...] = ()
    units: tuple[str, ...] | None = None

    @property
    def headers(self) -> tuple[str, ...]:
        """Name of each column with its unit in brackets where a line of its own states it; empty without names."""
        names = self.names or ()
        units = self.units or ("",) * len(names)
        return tuple(f"{name} [{unit}]" if unit else name for name, unit in zip(names, units, strict=True))

    @property
    def shown_names(self) -> tuple[str, ...]:
        """How each column is called in messages: its name, or its number where it has none."""
        names = self.names or ("",) * len(self.columns)
        return tuple(name or f"column {i}" for i, name in enumerate(names, start=1))


@dataclass(frozen=True, slots=True)
class Format:
    """One kind of data file.

    Attributes
    ----------
    title : str
        Name for people.
    recognises : callable
        Tells from the path and the first bytes whether a file is of this kind.
    read : callable
        Reads such a file.
    plain : bool
        True for text without a signature of its own; asked only where no signature was found.
    """

    title: str
    recognises: Callable[[Path, bytes], bool]
    read: Callable[[Path, Reading], RawTable]
    plain: bool = False


def rows_finding(kind: str, message: str, rows: Ints, *, column: str = "", dropped: int = 0) -> Finding:
    """Finding about some source lines, of which it lists the first few."""
    shown = tuple(int(r) for r in rows[:ROWS_SHOWN])
    return Finding(kind, message, rows=shown, count=int(rows.size), dropped=dropped, column=column)


def sample_rows(n: int) -> Ints:
    """Numbers of the samples of a format that has no lines, shape (n,)."""
    return np.arange(1, n + 1, dtype=np.int64)


def cut_findings(cut: Ints, kept: Ints, reading: Reading, file: Path) -> tuple[Finding, ...]:
    """What the limits ``first_row`` and ``last_row`` cut off.

    Raises
    ------
    MeasurementError
        If they leave nothing.
    """
    if not cut.size:
        return ()
    limits = f"first_row = {reading.first_row or 1}, last_row = {reading.last_row or 'the end'}"
    if not kept.size:
        raise ReadingError(
            f"no row is left by {limits}",
            file=file,
            expected=f"limits within the rows of data, {cut[0]} to {cut[-1]}",
            remedy="correct `first_row` and `last_row` in [reading] of campaign.toml; lines count from 1",
            elsewhere="check that the file holds a table of numbers, one delimiter between the cells of every row",
        )
    message = f"{many(cut.size, 'row')} outside {limits}, left out as declared"
    return (rows_finding("cut", message, cut, dropped=cut.size),)


def limited(table: RawTable, reading: Reading, file: Path) -> RawTable:
    """Table without the rows before ``first_row`` and after ``last_row``.

    Raises
    ------
    MeasurementError
        If nothing is left.
    """
    keep = np.ones(table.row.shape, dtype=bool)
    if reading.first_row is not None:
        keep &= table.row >= reading.first_row
    if reading.last_row is not None:
        keep &= table.row <= reading.last_row
    if keep.all():
        return table
    kept = table.row[keep]
    columns = tuple(_taken(cells, keep[: len(cells)]) for cells in table.columns)
    findings = (*table.findings, *cut_findings(table.row[~keep], kept, reading, file))
    return replace(table, columns=columns, row=kept, findings=findings)


def _taken(cells: Cells, keep: NDArray[np.bool_]) -> Cells:
    return cells[keep] if isinstance(cells, np.ndarray) else list(compress(cells, keep))


def too_large(found: str, path: Path) -> MeasurementError:
    """Error for a binary file that exceeds a limit."""
    return MeasurementError(
        found,
        file=path,
        expected="measurements and little else",
        remedy="save the channels that are needed, or fewer samples of them",
    )
