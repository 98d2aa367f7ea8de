"""Clock times: ``12:34:56.7``, ``2024-05-01T12:34+02:00``, ``5/1/2024 1:34:56 PM``, ``01-May-24 12:34:56``."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from datetime import date, datetime, time as time_of_day, timedelta
from pathlib import Path
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats, Ints
from sma_bayes.errors import MeasurementError
from sma_bayes.records.formats.numbers import is_blank
from sma_bayes.records.formats.table import Cells

DAY: Final = 86400.0
"""Seconds of a day."""

_TIME = re.compile(
    r"(?:(?P<date>\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4})(?:T|,?\s+))?"
    r"(?P<first>\d{1,4}):(?P<second>\d{2})(?::(?P<third>\d{2}))?(?:[.,](?P<part>\d+))?"
    r"\s*(?P<half>[AaPp])?(?(half)\.?[Mm]\.?)\s*(?P<zone>Z|[+-]\d{2}:?\d{2})?"
)

_MONTHS: Final = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_NAMED_MONTH = re.compile(
    rf"(\d{{1,4}})[-/.\s]+({'|'.join(_MONTHS)})[a-z]*[-/.,\s]+(\d{{1,4}})(?=[T,\s])", re.IGNORECASE
)
"""A date whose month is a name, between day and year."""
_ORDERS: Final = ((2, 1, 0), (2, 0, 1), (0, 1, 2))
"""Places of year, month and day in a date with a year of two digits or a year last."""


def is_clock(cells: Cells) -> bool:
    """Whether the first cell that holds anything is a clock time.

    Examples
    --------
    >>> is_clock(["", "12:34:56"]), is_clock(["1.5"]), is_clock(["10:30 to 11:00"])
    (True, False, False)
    """
    if isinstance(cells, np.ndarray):
        return False
    first = next((cell for cell in cells if not is_blank(cell)), None)
    return _TIME.fullmatch(_text(first)) is not None


def clock_seconds(cells: Sequence[object], row: Ints, *, file: Path, column: str) -> Floats:
    """Seconds of clock times, from midnight or, where a date is told, from the first day of year 1 [s].

    Days of a clock without a date are counted on where it passes midnight. Of dates such as 3/4/2024 day and month are
    told apart by numbers above 12, else by which of the two makes the record shorter; a year of two digits may be
    first, as in 24-03-05, or last.

    Parameters
    ----------
    cells : sequence
    row : ndarray of int, shape (n,)
        Source lines, for messages.
    file : Path
    column : str

    Returns
    -------
    ndarray, shape (n,)
        NaN where a cell is empty.

    Raises
    ------
    MeasurementError
        If a cell is no clock time, or no such day or hour exists.

    Examples
    --------
    >>> times = ["23:59:59.5", "", "00:00:01"]
    >>> clock_seconds(times, np.array([2, 3, 4]), file=Path("a.csv"), column="t").tolist()
    [86399.5, nan, 86401.0]
    """
    found = [None if is_blank(cell) else _TIME.fullmatch(_text(cell)) for cell in cells]
    dates = sorted({m["date"] for m in found if m and m["date"]})
    orders = [_days(dates, order) for order in _ORDERS]
    days = min(orders, key=lambda d: (-len(d), max(d.values(), default=0) - min(d.values(), default=0)))
    seconds = np.full(len(cells), np.nan)
    for i, (cell, match) in enumerate(zip(cells, found, strict=True)):
        if is_blank(cell):
            continue
        value = None if match is None else _seconds(match)
        day = 0 if match is None or not match["date"] else days.get(match["date"])
        if value is None or day is None:
            raise MeasurementError(
                f"found {str(cell).strip()!r}",
                file=file,
                row=int(row[i]),
                column=column,
                expected="a clock time such as 12:34:56.7 or 2024-05-01T12:34:56, as in the rows before",
                remedy="correct the cell, or leave it empty",
            )
        seconds[i] = DAY * day + value
    return seconds if dates else _past_midnight(seconds)


def _text(cell: object) -> str:
    """A cell as a text; workbooks hold times as such."""
    if isinstance(cell, timedelta):
        total = cell.total_seconds()
        return f"{int(total // 3600)}:{int(total % 3600 // 60):02d}:{total % 60:09.6f}"
    if isinstance(cell, datetime | time_of_day):
        return cell.isoformat()
    return _NAMED_MONTH.sub(_numbered, cell.strip(), count=1) if isinstance(cell, str) else ""


def _numbered(match: re.Match[str]) -> str:
    """The date with the number of its month, year first."""
    first, name, last = match.groups()
    year, day = (first, last) if len(first) > 2 else (last, first)
    month = _MONTHS.index(name[:3].lower()) + 1
    return f"{int(year) + (2000 if len(year) < 3 else 0)}-{month}-{day}"


def _seconds(match: re.Match[str]) -> float | None:
    """Seconds since midnight; of two numbers with a decimal part the first is minutes. None for no such time."""
    numbers = [int(n) for n in (match["first"], match["second"], match["third"]) if n is not None]
    if match["third"] is None:
        numbers = [0, *numbers] if match["part"] else [*numbers, 0]
    hours, minutes, whole = numbers
    if match["half"]:
        if not 1 <= hours <= 12:
            return None
        hours = hours % 12 + (12 if match["half"].lower() == "p" else 0)
    if whole >= 60 or (match["third"] is not None and minutes >= 60) or (match["date"] and hours >= 24):
        return None
    zone = match["zone"]
    ahead = 0 if zone in (None, "Z") else int(zone[0] + "1") * (60 * int(zone[1:3]) + int(zone[-2:]))
    return 3600.0 * hours + 60.0 * (minutes - ahead) + whole + float("0." + (match["part"] or "0"))


def _days(dates: Sequence[str], order: tuple[int, int, int]) -> dict[str, int]:
    """Day of each date that there is, counted from the first of year 1."""
    found = {}
    for text in dates:
        parts = [int(part) for part in re.split(r"[-/.]", text)]
        year, month, day = parts if parts[0] > 31 else (parts[place] for place in order)
        with suppress(ValueError):
            found[text] = date(year + 2000 if year < 100 else year, month, day).toordinal()
    return found


def _past_midnight(seconds: Floats) -> Floats:
    """The same with a day more after each step back by more than half a day."""
    there = np.flatnonzero(np.isfinite(seconds))
    days = np.cumsum(np.diff(seconds[there], prepend=seconds[there][:1]) < -0.5 * DAY)
    seconds[there] += DAY * days
    return seconds
