"""LabVIEW measurement files in text form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sma_bayes.errors import MeasurementError
from sma_bayes.records.formats import RawTable, Reading, read_table, recognise
from sma_bayes.records.formats.numbers import numbers

HEADER = """\
LabVIEW Measurement\t
Writer_Version\t2
Reader_Version\t2
Separator\tTab
Decimal_Separator\t.
Multi_Headings\tYes
X_Columns\tOne
Time_Pref\tRelative
Operator\tme
Date\t2024/01/02
Time\t12:00:00,5
***End_of_Header***\t
\t
"""

SEGMENT = """\
Channels\t2\t
Samples\t2\t2
Date\t2024/01/02\t2024/01/02
Y_Unit_Label\tdegC\tN
X_Dimension\tTime\tTime
X0\t{x0}\t{x0}
Delta_X\t0.5\t0.5
***End_of_Header***\t\t
X_Value\tTemp\tForce\tComment
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "run.lvm"
    path.write_bytes(text.replace("\n", "\r\n").encode())
    return path


def values(table: RawTable, index: int) -> list[float]:
    cells = table.columns[index]
    decimal = table.decimal or "."
    return numbers(cells, table.row, file=Path("run.lvm"), column="x", decimal=decimal)[0].tolist()


def test_one_segment_with_a_comment(tmp_path: Path) -> None:
    text = HEADER + SEGMENT.format(x0=0) + "0.0\t20.5\t1.5\tbegun, by hand\n0.5\t21.5\t2.5\n"
    path = write(tmp_path, text)
    assert recognise(path) == "lvm"
    table = read_table(path, Reading())
    assert table.names == ("X_Value", "Temp", "Force")
    assert table.row.tolist() == [23, 24]
    assert path.read_text().split("\n")[22].startswith("0.0\t20.5")
    assert [values(table, i) for i in range(3)] == [[0, 0.5], [20.5, 21.5], [1.5, 2.5]]
    assert table.findings == ()


def test_segments_are_joined_and_special_blocks_passed_over(tmp_path: Path) -> None:
    special = "***Start_Special***\nProgram\tx\n1\t2\t3\n***End_Special***\n"
    one = SEGMENT.format(x0=0) + "0.0\t20\t1\n0.5\t21\t2\n"
    two = SEGMENT.format(x0=9) + "9.0\t22\t3\n9.5\t23\t\n"
    table = read_table(write(tmp_path, HEADER + special + one + "\n" + special + two), Reading())
    assert values(table, 0) == [0, 0.5, 9, 9.5]
    np.testing.assert_array_equal(values(table, 2), [1, 2, 3, np.nan])
    assert table.row.tolist() == [27, 28, 43, 44]
    assert [f.message for f in table.findings] == ["2 segments, joined in order"]


def test_without_x_values_the_clock_makes_them(tmp_path: Path) -> None:
    header = HEADER.replace("X_Columns\tOne", "X_Columns\tNo")
    body = SEGMENT.format(x0=3) + "\t20\t1\n\t21\t2\n" + SEGMENT.format(x0=7) + "\t22\t3\n\t23\t4\n"
    assert values(read_table(write(tmp_path, header + body), Reading()), 0) == [3, 3.5, 7, 7.5]
    broken = write(tmp_path, (header + body).replace("Delta_X", "Delta"))
    with pytest.raises(MeasurementError, match="X0 or Delta_X is not there"):
        read_table(broken, Reading())


def test_commas_separate_or_mark_decimals_as_the_file_declares(tmp_path: Path) -> None:
    comma = (HEADER + SEGMENT.format(x0=0)).replace("\t", ",").replace(",Tab", ",Comma")
    table = read_table(write(tmp_path, comma + "0.0,20.5,1.5\n"), Reading())
    assert [values(table, i) for i in range(3)] == [[0], [20.5], [1.5]]
    decimal = HEADER.replace("Decimal_Separator\t.", "Decimal_Separator\t,")
    table = read_table(write(tmp_path, decimal + SEGMENT.format(x0="0,0") + "0,5\t20,5\t1,5e-3\n"), Reading())
    assert table.decimal == ","
    assert [values(table, i) for i in range(3)] == [[0.5], [20.5], [0.0015]]


def test_one_x_column_for_each_channel(tmp_path: Path) -> None:
    header = HEADER.replace("X_Columns\tOne", "X_Columns\tMulti")
    segment = SEGMENT.format(x0=0).replace("X_Value\tTemp\tForce", "X_Value\tTemp\tX_Value\tForce")
    table = read_table(write(tmp_path, header + segment + "0\t20\t0.1\t1\n"), Reading())
    assert table.names == ("X_Value", "Temp", "X_Value", "Force")


def test_titles_right_after_the_file_header(tmp_path: Path) -> None:
    table = read_table(write(tmp_path, HEADER + "Time\tForce\n0\t1\n1\t2\n"), Reading())
    assert table.names == ("Time", "Force")
    assert table.row.tolist() == [15, 16]


@pytest.mark.parametrize(
    ("body", "found", "row"),
    [
        (SEGMENT.format(x0=0) + "0.0\t20\n", "the row has 2 cells, the titles are 3", 23),
        (SEGMENT.format(x0=0), "no row of numbers after the header", None),
        ("", "no row of numbers after the header", None),
        (
            SEGMENT.format(x0=0) + "0\t1\t2\n" + SEGMENT.format(x0=0).replace("Force", "Load") + "0\t1\t2\n",
            "this segment has the columns ['X_Value', 'Temp', 'Load']",
            33,
        ),
    ],
)
def test_what_is_wrong_is_refused_with_its_line(
    tmp_path: Path, body: str, found: str, row: int | None
) -> None:
    with pytest.raises(MeasurementError) as caught:
        read_table(write(tmp_path, HEADER + body), Reading())
    assert (caught.value.found, caught.value.row) == (found, row)


def test_a_header_that_never_ends(tmp_path: Path) -> None:
    with pytest.raises(MeasurementError, match="no line \\*\\*\\*End_of_Header"):
        read_table(write(tmp_path, HEADER.split("***")[0]), Reading())
