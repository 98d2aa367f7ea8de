"""Workbooks."""

from __future__ import annotations

import datetime
from pathlib import Path

import numpy as np
import openpyxl
import pytest

from sma_bayes.errors import MeasurementError
from sma_bayes.records.formats import Reading, read_table
from sma_bayes.records.formats.numbers import numbers


def workbook(path: Path, **sheets: list[list[object]]) -> Path:
    book = openpyxl.Workbook()
    book.remove(book.active)
    for title, rows in sheets.items():
        sheet = book.create_sheet(title)
        for row in rows:
            sheet.append(row)
    book.save(path)
    return path


ROWS: list[list[object]] = [
    ["Operator", "me"],
    [],
    ["T", "note", "F"],
    [20.5, "begin", 1],
    [21.5, None, None],
    [],
    [22.5, "end", 3],
]


def test_header_rows_and_empty_cells(tmp_path: Path) -> None:
    table = read_table(workbook(tmp_path / "a.xlsx", run=ROWS), Reading())
    assert table.names == ("T", "note", "F")
    assert table.row.tolist() == [4, 5, 7]
    values, findings = numbers(table.columns[2], table.row, file=Path("a.xlsx"), column="F")
    np.testing.assert_array_equal(values, [1, np.nan, 3])
    assert [(f.kind, f.rows) for f in findings] == [("empty", (5,))]
    assert [(f.kind, f.rows) for f in table.findings] == [("preamble", (1,)), ("blank-line", (6,))]


def test_columns_are_counted_from_a_whatever_is_empty(tmp_path: Path) -> None:
    rows: list[list[object]] = [[None, "T", None, "F"], [None, 1, None, 2], [None, 3, None, 4]]
    table = read_table(workbook(tmp_path / "a.xlsx", run=rows), Reading())
    assert table.names == ("", "T", "", "F")
    assert table.shown_names == ("column 1", "T", "column 3", "F")


def test_the_content_counts_and_not_the_suffix(tmp_path: Path) -> None:
    path = workbook(tmp_path / "a.xlsx", run=ROWS).rename(tmp_path / "a.csv")
    assert read_table(path, Reading()).row.tolist() == [4, 5, 7]


def test_one_of_several_sheets_must_be_told(tmp_path: Path) -> None:
    path = workbook(tmp_path / "a.xlsx", first=ROWS, second=[["T", "F"], [1, 2]], empty=[])
    with pytest.raises(MeasurementError, match="has 2 sheets") as caught:
        read_table(path, Reading())
    assert "'first', 'second'" in str(caught.value)
    for sheet in ("second", 2):
        assert read_table(path, Reading(sheet=sheet)).names == ("T", "F")
    with pytest.raises(MeasurementError, match="no sheet 'secnd'") as caught:
        read_table(path, Reading(sheet="secnd"))
    assert "did you mean 'second'?" in str(caught.value)
    with pytest.raises(MeasurementError, match="no sheet 4"):
        read_table(path, Reading(sheet=4))


def test_an_empty_sheet_alone_is_left_aside(tmp_path: Path) -> None:
    assert read_table(workbook(tmp_path / "a.xlsx", run=ROWS, empty=[]), Reading()).row.size == 3
    with pytest.raises(MeasurementError, match="the workbook has no cells"):
        read_table(workbook(tmp_path / "b.xlsx", empty=[]), Reading())


@pytest.mark.parametrize("cell", [True, datetime.datetime(2024, 1, 1), "#DIV/0!"])
def test_what_is_not_a_number_is_refused(tmp_path: Path, cell: object) -> None:
    rows: list[list[object]] = [["T", "F"], [1, 2], [2, cell], [3, 4], [5, 6]]
    path = workbook(tmp_path / "a.xlsx", run=rows)
    table = read_table(path, Reading())
    with pytest.raises(MeasurementError) as caught:
        numbers(table.columns[1], table.row, file=path, column="F")
    assert (caught.value.row, caught.value.column) == (3, "F")


def test_a_damaged_workbook(tmp_path: Path) -> None:
    whole = workbook(tmp_path / "a.xlsx", run=ROWS).read_bytes()
    path = tmp_path / "cut.xlsx"
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(MeasurementError, match="the workbook is damaged"):
        read_table(path, Reading())


def test_real_workbooks(shared_data: Path) -> None:
    path = shared_data / "muscle_wire_stress_strain" / "pseudoelastic_40C.xlsx"
    table = read_table(path, Reading())
    assert table.names is not None
    assert table.names[1:5] == ("Time (s)", "Load (N)", "CH (mm)", "Temperature")
    assert table.row[[0, -1]].tolist() == [7, 2093]
    values, _ = numbers(table.columns[2], table.row, file=path, column="Load (N)")
    same = read_table(path.with_suffix(".csv"), Reading())
    np.testing.assert_allclose(
        values, numbers(same.columns[1], same.row, file=path, column="load_N")[0], rtol=1e-6
    )

    several = shared_data / "muscle_wire_electric_cycling" / "Period_21.xlsx"
    with pytest.raises(MeasurementError, match="has 9 sheets"):
        read_table(several, Reading())
    assert read_table(several, Reading(sheet="50%, 0%")).row.size > 1000
