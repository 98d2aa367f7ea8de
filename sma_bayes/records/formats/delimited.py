"""Delimited text: CSV, TSV, TXT."""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from sma_bayes.errors import ReadingError
from sma_bayes.records.formats.layout import Row, RowShape, shape_of, spread, tabulate
from sma_bayes.records.formats.numbers import has_decimal_commas
from sma_bayes.records.formats.table import WHITESPACE, Format, RawTable, Reading
from sma_bayes.records.types import Finding

CANDIDATES = ("\t", ";", "|", ",", WHITESPACE)
"""Delimiters that are found by themselves; of two that split the sample alike the first is taken."""

_BYTE_ORDER_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)


def recognises(path: Path, head: bytes) -> bool:
    """Whether the first bytes are text."""
    return b"\0" not in head or any(head.startswith(mark) for mark, _ in _BYTE_ORDER_MARKS[1:])


def read(path: Path, reading: Reading) -> RawTable:
    """Read a delimited text file.

    Returns
    -------
    RawTable
        Source lines are those of the file, whatever was skipped and however its lines end.

    Raises
    ------
    MeasurementError
        If the text can't be decoded, the delimiter can't be told, or the rows are not equally long.
    """
    lines = text_lines(path, reading.encoding)
    if reading.quoted_rows:
        lines = [_unquoted(line) for line in lines]
    body = lines[reading.skip_rows :]

    def resplit(line: int) -> Iterator[Sequence[str]]:
        return _other_splits(lines[line - 1])

    try:
        delimiter, shape = _delimiter(body, reading, path)
        table = tabulate(_rows(body, delimiter, reading.skip_rows), shape, reading, path, resplit)
    except csv.Error as error:
        raise ReadingError(
            f"the text can't be split into cells: {error}",
            file=path,
            expected="quotation marks in pairs",
            remedy="close the quotation mark; where each whole row stands in quotes set quoted_rows = true",
            elsewhere="close the quotation mark",
        ) from None
    if "decimal" in reading.model_fields_set or delimiter == ",":
        return table
    return _with_decimal_mark(table, shape)


def _with_decimal_mark(table: RawTable, shape: RowShape) -> RawTable:
    """Table with the decimal comma that its cells show, where they do."""
    some = spread(table.row.size)
    if not has_decimal_commas(table.columns[i][k] for i in shape.numeric for k in some):
        return table
    seen = Finding("decimal-comma", "the decimal mark is a comma: no number has a point")
    return replace(table, decimal=",", findings=(*table.findings, seen))


def text_lines(path: Path, encoding: str | None) -> list[str]:
    """Lines of a text file, split at LF, CR LF and bare CR, and at nothing else.

    Raises
    ------
    MeasurementError
        If the file is not text in that encoding.
    """
    raw = path.read_bytes()
    if encoding is None:
        encoding = next((name for mark, name in _BYTE_ORDER_MARKS if raw.startswith(mark)), "utf-8")
    try:
        text = raw.decode(encoding)
    except UnicodeDecodeError as error:
        before = raw[: error.start]
        row = before.count(b"\n") + 1 if b"\n" in before else before.count(b"\r") + 1
        raise ReadingError(
            f"byte 0x{raw[error.start]:02x} is not {encoding}",
            file=path,
            row=row,
            expected=f"text in {encoding}",
            remedy='name the encoding in [reading] of campaign.toml, for many Windows programs encoding = "cp1252"',
            elsewhere="save the text as UTF-8",
        ) from None
    except LookupError:
        raise ReadingError(
            f"encoding {encoding!r} is not known",
            file=path,
            expected="an encoding that Python knows, such as utf-8, cp1252, latin-1 or utf-16",
            remedy="correct `encoding` in [reading] of campaign.toml",
            elsewhere="correct the encoding",
        ) from None
    return text.replace("\r\n", "\n").replace("\r", "\n").removeprefix("\ufeff").split("\n")


def _unquoted(line: str) -> str:
    """Row that stands in quotation marks as a whole, without them.

    Examples
    --------
    >>> _unquoted('"0.1,""a b"",2"')
    '0.1,"a b",2'
    """
    stripped = line.strip()
    if len(stripped) >= 2 and stripped[0] == stripped[-1] == '"':
        return stripped[1:-1].replace('""', '"')
    return line


def _split(lines: Sequence[str], delimiter: str) -> Iterator[list[str]]:
    if delimiter == WHITESPACE:
        return (line.split() for line in lines)
    return csv.reader(lines, delimiter=delimiter)


def _rows(lines: Sequence[str], delimiter: str, skipped: int) -> Iterator[Row]:
    """Cells of each row with the line on which it begins; a quoted cell may run over several lines."""
    if delimiter == WHITESPACE:
        yield from enumerate((line.split() for line in lines), start=skipped + 1)
        return
    reader = csv.reader((line + "\n" for line in lines), delimiter=delimiter)
    begin = skipped + 1
    for cells in reader:
        yield begin, cells
        begin = skipped + reader.line_num + 1


def _delimiter(lines: Sequence[str], reading: Reading, path: Path) -> tuple[str, RowShape]:
    """Delimiter that explains most of the file, and the shape of the rows under it."""
    sample = [lines[i] for i in spread(len(lines)) if lines[i].strip()]
    candidates = CANDIDATES if reading.delimiter is None else (reading.delimiter,)
    shapes = {
        delimiter: shape_of([cells for line in sample for cells in _split([line], delimiter)], reading)
        for delimiter in candidates
        if delimiter != reading.decimal
    }
    best = max(shapes, key=lambda d: (shapes[d].filled > 1, shapes[d].score))
    rivals = [d for d in shapes if shapes[d].score == shapes[best].score and shapes[d].filled > 1]
    if best in rivals and best != WHITESPACE:  # runs of blanks differ from it in empty cells alone
        rivals = [d for d in rivals if d != WHITESPACE]
    if len({(shapes[d].filled, shapes[d].numeric) for d in rivals}) > 1:
        raise ReadingError(
            "the delimiter can't be told: " + " and ".join(repr(d) for d in rivals) + " fit equally well",
            file=path,
            expected="one delimiter",
            remedy="set `delimiter` in [reading] of campaign.toml",
            elsewhere="export it with semicolons or tabs between the cells",
        )
    if shapes[best].filled < 2 and not reading.quoted_rows and _whole_rows_quoted(sample):
        raise ReadingError(
            "each whole row stands in quotation marks",
            file=path,
            expected="a delimiter outside the quotation marks",
            remedy="set quoted_rows = true in [reading] of campaign.toml",
            elsewhere="take the quotation marks about the rows away",
        )
    return best, shapes[best]


def _whole_rows_quoted(sample: Sequence[str]) -> bool:
    quoted = sum(_unquoted(line) is not line for line in sample)
    return 2 * quoted > len(sample)


def _other_splits(line: str) -> Iterator[Sequence[str]]:
    """Other ways to read a line of names: another delimiter than the data, or a comment sign before it."""
    for text in (line, line.lstrip("#%; \t")):
        for delimiter in CANDIDATES[:-1]:
            yield next(csv.reader([text], delimiter=delimiter), [])
        yield text.split()
        yield next(csv.reader([text], delimiter=" ", skipinitialspace=True), [])
        yield re.split(r"\s{2,}", text.strip())


FORMAT = Format("delimited text", recognises, read, plain=True)
