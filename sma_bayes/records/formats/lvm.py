"""LabVIEW measurement files, the text form: LVM.

The layout (a file header, then segments with a header of their own, each closed by ``***End_of_Header***``;
``Channels``, ``X0``, ``Delta_X``, ``X_Columns``, special blocks, a comment column) is specified by National
Instruments, "Specification for the LabVIEW Measurement File (.lvm)", document 4139.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.errors import MeasurementError, ReadingError
from sma_bayes.records.formats.delimited import text_lines
from sma_bayes.records.formats.table import Cells, Format, RawTable, Reading
from sma_bayes.records.types import Finding

SIGNATURE = "LabVIEW Measurement"

DECIMAL_MARKS = (".", ",")

_END = "***End_of_Header***"
_SPECIAL = ("***Start_Special***", "***End_Special***")
_COMMENT = "Comment"


@dataclass(slots=True)
class _Segment:
    """One segment while it is read."""

    tags: dict[str, list[str]] = field(default_factory=dict)
    titles: list[str] = field(default_factory=list)
    rows: list[list[str]] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins with the words that every such file begins with."""
    return head.removeprefix(b"\xef\xbb\xbf").startswith(SIGNATURE.encode())


def read(path: Path, reading: Reading) -> RawTable:
    """Read a LabVIEW measurement file; its segments are joined in order.

    Separator and decimal mark are those that the file declares. Where it saved no x values
    (``X_Columns No``) the blank first column is filled with ``X0 + i Delta_X``.

    Parameters
    ----------
    path : Path
    reading : Reading
        Only ``encoding`` matters.

    Returns
    -------
    RawTable
        Titles as in the file, without the comment column.

    Raises
    ------
    MeasurementError
        If there is no data, a row is too short or too long, or segments have different columns.
    """
    lines = text_lines(path, reading.encoding)
    header = _file_header(lines, path)
    separator = "," if header.get("Separator", ["Tab"])[0].strip().lower() == "comma" else "\t"
    decimal = header.get("Decimal_Separator", ["."])[0].strip()
    if decimal not in DECIMAL_MARKS:
        raise MeasurementError(
            f"the header states the decimal mark {decimal[:20]!r}",
            file=path,
            expected="a full stop or a comma",
            remedy="mend the line Decimal_Separator",
        )
    segments = [s for s in _segments(lines, separator, path) if s.rows]
    if not segments:
        raise MeasurementError(
            "no row of numbers after the header",
            file=path,
            expected="at least one segment with data",
            remedy="check that the recording was written to its end",
        )
    titles = segments[0].titles
    for segment in segments[1:]:
        if segment.titles != titles:
            raise MeasurementError(
                f"this segment has the columns {segment.titles}",
                file=path,
                row=segment.lines[0],
                expected=f"{titles}, as in the first segment",
                remedy="split the file into one file for each set of columns",
            )
    row = np.array([line for s in segments for line in s.lines], dtype=np.int64)
    columns: list[Cells] = [[cells[i] for s in segments for cells in s.rows] for i in range(len(titles))]
    if header.get("X_Columns", ["One"])[0].strip() == "No":
        columns[0] = np.concatenate([_x_values(s, decimal, path) for s in segments])
    findings = (
        (Finding("segments", f"{len(segments)} segments, joined in order", count=len(segments)),)
        if len(segments) > 1
        else ()
    )
    return RawTable(tuple(titles), tuple(columns), row, findings, decimal)


def _file_header(lines: Sequence[str], path: Path) -> dict[str, list[str]]:
    """Tags of the file header; the separator follows the word Separator on its own line."""
    separator = next((line[9:10] for line in lines if line.startswith("Separator")), "\t")
    tags: dict[str, list[str]] = {}
    for line in lines:
        if line.startswith(_END):
            return tags
        name, *values = line.split(separator)
        tags[name.strip()] = values
    raise MeasurementError(
        f"no line {_END}",
        file=path,
        expected="a header that is closed by that line",
        remedy="check that the recording was written to its end",
    )


def _segments(lines: Sequence[str], separator: str, path: Path) -> Iterator[_Segment]:
    segment = _Segment()
    in_header = special = False
    for number, line in _after_file_header(lines):
        first = line.split(separator, 1)[0].strip()
        if first in _SPECIAL:
            special = first == _SPECIAL[0]
        elif special or not line.strip():
            continue
        elif first == "Channels":
            yield segment
            segment, in_header = _Segment(), True
        elif first == _END:
            in_header = False
        elif in_header:
            segment.tags[first] = line.split(separator)[1:]
        elif not segment.titles:
            segment.titles = _titles(line.split(separator))
        else:
            segment.rows.append(_row(line.split(separator), segment.titles, path, number))
            segment.lines.append(number)
    yield segment


def _after_file_header(lines: Sequence[str]) -> Iterator[tuple[int, str]]:
    start = next(i for i, line in enumerate(lines) if line.startswith(_END)) + 1
    return enumerate(lines[start:], start=start + 1)


def _titles(cells: list[str]) -> list[str]:
    titles = [cell.strip() for cell in cells]
    while titles and titles[-1] in ("", _COMMENT):
        titles.pop()
    return titles


def _row(cells: list[str], titles: list[str], path: Path, line: int) -> list[str]:
    """Cells under the titles; what follows is the comment."""
    if len(cells) < len(titles) or len(cells) > len(titles) + 2:
        raise MeasurementError(
            f"the row has {len(cells)} cells, the titles are {len(titles)}",
            file=path,
            row=line,
            expected="one cell a title, and perhaps a comment",
            remedy="complete the row, or remove it",
        )
    return cells[: len(titles)]


def _x_values(segment: _Segment, decimal: str, path: Path) -> Floats:
    """``X0 + i Delta_X`` of a segment without saved x values, shape (n,)."""
    try:
        x0, step = (float(segment.tags[tag][0].replace(decimal, ".")) for tag in ("X0", "Delta_X"))
    except (KeyError, IndexError, ValueError):
        raise ReadingError(
            "the file saved no x values, and X0 or Delta_X is not there or not a number",
            file=path,
            row=segment.lines[0],
            expected="tags X0 and Delta_X in the header of the segment",
            remedy="give the time by { row_interval = ..., unit = ... }, and name each column by its number",
            elsewhere="record it again with the x values saved, or export it as CSV with a column of the time",
        ) from None
    return x0 + step * np.arange(len(segment.rows), dtype=np.float64)


FORMAT = Format("LabVIEW measurement file (LVM)", recognises, read)
