"""Cells to numbers: what is missing is counted by kind, what is wrong is refused with its place."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from sma_bayes.arrays import Floats
from sma_bayes.errors import MeasurementError
from sma_bayes.records.formats.numbers import numbers

FILE = Path("run.csv")


def read(
    cells: Sequence[object] | Floats, **options: object
) -> tuple[list[float], dict[str, tuple[int, ...]]]:
    row = 10 + np.arange(len(cells))
    values, findings = numbers(cells, row, file=FILE, column="F", **options)  # type: ignore[arg-type]
    assert all(f.column == "F" and f.count == len(f.rows) and f.dropped == 0 for f in findings)
    return values.tolist(), {f.kind: f.rows for f in findings}


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1))
def test_numbers_come_back_to_the_last_digit(values: list[float]) -> None:
    assert read([f" {v!r} " for v in values]) == (values, {})
    assert read([repr(v).replace(".", ",") for v in values], decimal=",") == (values, {})
    assert read(np.array(values)) == (values, {})


def test_each_kind_of_missing_value_is_counted_apart() -> None:
    cells = ["1", "", "-999", "ERR", " ", "2"]
    values, seen = read(cells, missing=[-999.0, "ERR"])
    np.testing.assert_array_equal(values, [1, *[np.nan] * 4, 2])
    assert seen == {"empty": (11, 14), "missing-code": (12, 13)}


@pytest.mark.parametrize("word", ["nan", "NaN", "inf", "-inf", "Infinity"])
def test_what_is_not_finite_is_refused_unless_declared(word: str) -> None:
    with pytest.raises(MeasurementError) as caught:
        read(["1", word, "2"])
    assert (caught.value.row, caught.value.found, caught.value.expected) == (
        11,
        f"found {word!r}",
        "a number",
    )
    assert f"list {word!r} under `missing`" in str(caught.value.remedy)
    for code in (word, float(word)):
        values, seen = read(["1", word, "", "2"], missing=[code])
        np.testing.assert_array_equal(values, [1, np.nan, np.nan, 2])
        assert seen == {"missing-code": (11,), "empty": (12,)}


def test_nan_is_the_empty_cell_of_a_format_that_stores_numbers() -> None:
    assert read(np.array([1.0, np.nan, 2.0]))[1] == {"empty": (11,)}
    assert read(np.array([1.0, np.inf, 2.0]), missing=[np.inf])[1] == {"missing-code": (11,)}
    with pytest.raises(MeasurementError, match="found 'inf'"):
        read(np.array([1.0, np.inf, 2.0]))


def test_a_number_matches_by_value_and_a_text_by_its_letters() -> None:
    assert read(["0.0", "0", "1"], missing=[0.0])[1] == {"missing-code": (10, 11)}
    assert read(["0.0", "0", "1"], missing=["0.0"])[1] == {"missing-code": (10,)}
    assert read(["nan", "1"], missing=["nan"])[1] == {"missing-code": (10,)}


def test_cells_of_a_workbook() -> None:
    assert read([1, 2.5, None, "3"])[1] == {"empty": (12,)}
    with pytest.raises(MeasurementError, match="found '2024-01-01'"):
        read([1.0, np.datetime64("2024-01-01")])


def test_a_long_list_of_rows_is_cut_but_fully_counted() -> None:
    _, findings = numbers(["1", *[""] * 50], np.arange(51), file=FILE, column="F")
    assert findings[0].count == 50
    assert len(findings[0].rows) == 10
    assert findings[0].message == "50 cells empty in 'F', taken as missing"


@pytest.mark.parametrize(
    ("cells", "decimal", "row", "found"),
    [
        (["1", "oops", "2"], ".", 11, "found 'oops'"),
        (["1", "1 000", "2"], ".", 11, "found '1 000'"),
        (["1", "2", "1_000"], ".", 12, "found '1_000'"),  # Python would read 1000
        (["1", "1.234,5"], ",", 11, "found '1.234,5'"),
        (["1", "1.234"], ",", 11, "found '1.234'"),  # a thousand, or not
        (["1", "x", "3", "y", "z"], ".", 11, "found 'x' (and 2 more in this column)"),
    ],
)
def test_anything_else_is_refused_with_its_place(
    cells: list[str], decimal: str, row: int, found: str
) -> None:
    with pytest.raises(MeasurementError) as caught:
        read(cells, decimal=decimal)
    error = caught.value
    assert (error.file, error.row, error.column, error.found, error.expected) == (
        "run.csv", row, "F", found, "a number",
    )  # fmt: skip
    assert error.remedy is not None
    assert "`missing`" in error.remedy


def test_a_decimal_comma_is_suspected_aloud() -> None:
    with pytest.raises(MeasurementError, match=r'set decimal = "," in \[reading\]'):
        read(["1,5", "2,5"])


def test_a_column_without_any_number_is_refused() -> None:
    with pytest.raises(MeasurementError, match="no number in 2 rows"):
        read(["", "-1"], missing=[-1.0])
