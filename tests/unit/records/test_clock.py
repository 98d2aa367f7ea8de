"""Clock times, against the standard library's own reading of them."""

from __future__ import annotations

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from sma_bayes.errors import MeasurementError
from sma_bayes.records.clock import clock_seconds, is_clock

START = datetime(2024, 11, 30, 23, 59, 30, 250000)
TIMES = [START + timedelta(seconds=7.25 * i) for i in range(20)]
WRITTEN = {
    "ISO": lambda t: t.isoformat(),
    "ISO in UTC": lambda t: t.isoformat() + "Z",
    "ISO with a blank": lambda t: t.isoformat(sep=" "),
    "day first": lambda t: t.strftime("%d.%m.%Y %H:%M:%S.%f"),
    "day first, comma": lambda t: t.strftime("%d/%m/%Y %H:%M:%S,%f"),
    "month first": lambda t: t.strftime("%m/%d/%Y %I:%M:%S.%f %p"),
    "two digits of the year": lambda t: t.strftime("%d.%m.%y %H:%M:%S.%f"),
    "no date": lambda t: t.strftime("%H:%M:%S.%f"),
    "in a workbook": lambda t: t,
    "time of day in a workbook": lambda t: t.time(),
    "duration in a workbook": lambda t: t - START,
}


def seconds(cells: list[object]) -> np.ndarray:
    return clock_seconds(cells, np.arange(2, 2 + len(cells)), file=Path("a.csv"), column="t")


@pytest.mark.parametrize("how", WRITTEN)
def test_seconds_between_clock_times(how: str) -> None:
    cells = [WRITTEN[how](t) for t in TIMES]
    assert is_clock(cells)
    found = seconds(cells)
    assert found - found[0] == pytest.approx(7.25 * np.arange(20), abs=2e-5)


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        (["1:30.5", "1:31.0"], 0.5),
        (["9:59", "10:00"], 60.0),
        (["100:00:00", "100:00:01"], 1.0),
        (["11:59:59 PM", "12:00:01 AM"], 2.0),
        (["3/4/2024 23:00:00", "4/4/2024 01:00:00"], 7200.0),
        (["24-03-05 23:59:58", "24-03-06 00:00:00"], 2.0),
        (["31.12.23 23:00:00", "01.01.24 01:00:00"], 7200.0),
        (["05-Mar-24 09:00:00", "06-Mar-24 09:00:00"], 86400.0),
        (["31 December 2023, 23:59", "1 January 2024, 00:01"], 120.0),
        (["2024-Feb-28T09:00:00", "2024-Mar-01T09:00:00"], 2 * 86400.0),
        (["2024-03-31T01:30:00+01:00", "2024-03-31T03:30:00+02:00"], 3600.0),
    ],
)
def test_forms_of_a_clock(cells: list[object], expected: float) -> None:
    first, second = seconds(cells)
    assert second - first == pytest.approx(expected)


@pytest.mark.parametrize("cells", [["1.5"], ["heating"], ["12:34:56 start"], [None], np.array([1.0])])
def test_what_is_no_clock(cells: object) -> None:
    assert not is_clock(cells)  # type: ignore[arg-type]


@pytest.mark.parametrize("bad", ["now", "2024-02-30 12:00:00", "25:00:61", "13:00:00 PM"])
def test_a_cell_that_is_no_time_is_named_with_its_row(bad: str) -> None:
    with pytest.raises(MeasurementError, match="found") as caught:
        seconds(["2024-02-28 12:00:00", bad])
    assert caught.value.row == 3
