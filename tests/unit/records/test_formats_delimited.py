"""Delimited text: every way in which a file can look, and true line numbers through all of it."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from sma_bayes.arrays import Floats
from sma_bayes.errors import MeasurementError
from sma_bayes.records.formats import RawTable, Reading, read_table
from sma_bayes.records.formats.numbers import numbers


def write(folder: Path, text: str | bytes, name: str = "data.txt") -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def column(table: RawTable, index: int, path: Path = Path("data.txt"), **options: object) -> Floats:
    cells = table.columns[index]
    return numbers(cells, table.row, file=path, column=f"column {index + 1}", **options)[0]  # type: ignore[arg-type]


def matrix(table: RawTable, **options: object) -> Floats:
    return np.transpose([column(table, i, **options) for i in range(len(table.columns))])


finite = st.floats(allow_nan=False, allow_infinity=False, width=64)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    values=st.integers(2, 5).flatmap(
        lambda width: st.lists(st.lists(finite, min_size=width, max_size=width), min_size=3, max_size=8)
    ),
    delimiter=st.sampled_from([",", ";", "\t", "|", " ", "  \t "]),
    decimal=st.sampled_from([".", ","]),
    line_end=st.sampled_from(["\n", "\r\n", "\r"]),
    names=st.booleans(),
    preamble=st.sampled_from(
        [
            [],
            ["made by a machine that likes to talk"],
            ["Operator: me", "", "and this makes it the ninth line of words"],
        ]
    ),
    mark=st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]),
    trailing=st.booleans(),
    last_end=st.booleans(),
)
def test_whatever_the_layout_the_values_and_their_lines_come_back(
    tmp_path: Path,
    values: list[list[float]],
    delimiter: str,
    decimal: str,
    line_end: str,
    names: bool,
    preamble: list[str],
    mark: str,
    trailing: bool,
    last_end: bool,
) -> None:
    if delimiter == decimal:
        delimiter = ";"
    end = delimiter.strip(" ") if trailing else ""
    lines = [*preamble]
    if names:
        lines.append(delimiter.join(f"q{i}" for i in range(len(values[0]))) + end)
    first = len(lines) + 1
    lines += [delimiter.join(repr(v).replace(".", decimal) for v in row) + end for row in values]
    text = line_end.join(lines) + (line_end if last_end else "")
    path = write(tmp_path, text.encode(mark))

    table = read_table(path, Reading(decimal=decimal))  # type: ignore[arg-type]

    np.testing.assert_array_equal(table.row, first + np.arange(len(values)))
    for i in range(len(values[0])):
        np.testing.assert_array_equal(column(table, i, decimal=decimal), [row[i] for row in values])
    if names:
        assert table.names is not None
        assert table.names[: len(values[0])] == tuple(f"q{i}" for i in range(len(values[0])))
    else:
        assert table.names is None
    lines_left_out = [n for n, line in enumerate(preamble, start=1) if line]
    assert [f.rows for f in table.findings] == ([tuple(lines_left_out)] if lines_left_out else [])


def test_two_columns_with_decimal_commas_and_comma_as_delimiter_are_not_guessed(tmp_path: Path) -> None:
    path = write(tmp_path, "1,5 2\n2,5 3\n")  # a blank between, or a comma and a decimal point?
    table = read_table(path, Reading())
    with pytest.raises(MeasurementError, match=r'set decimal = ","') as caught:
        column(table, 0, path)
    assert caught.value.row == 1
    np.testing.assert_array_equal(
        matrix(read_table(path, Reading(decimal=",")), decimal=","), [[1.5, 2], [2.5, 3]]
    )


def test_a_delimiter_that_cannot_be_told_is_an_error(tmp_path: Path) -> None:
    path = write(tmp_path, "1;a|2\n3;b|4\n")
    with pytest.raises(MeasurementError, match="the delimiter can't be told: ';' and '\\|' fit equally well"):
        read_table(path, Reading())
    np.testing.assert_array_equal(column(read_table(path, Reading(delimiter="|")), 1), [2, 4])


def test_tabs_with_an_empty_cell_between_are_no_blanks(tmp_path: Path) -> None:
    """Both split every row alike, but for the empty cell, which shifts those behind it."""
    path = write(tmp_path, "\tt\tx\n\t1\t2\n\t3\t4\n")
    table = read_table(path, Reading())
    assert table.names == ("", "t", "x")
    np.testing.assert_array_equal(column(table, 2), [2, 4])


def test_a_given_delimiter_is_taken(tmp_path: Path) -> None:
    path = write(tmp_path, "1:2\n3:4\n")
    with pytest.raises(MeasurementError, match="no row of numbers"):
        read_table(path, Reading())
    np.testing.assert_array_equal(matrix(read_table(path, Reading(delimiter=":"))), [[1, 2], [3, 4]])


def test_rows_in_quotes_with_doubled_inner_quotes(tmp_path: Path) -> None:
    text = '"Method,""a.msm"""\n\n"Time (h),""Load (N)"",""Ext, (mm)"""\n\n"0.1,7,-1"\n"0.2,8,-2"\n'
    path = write(tmp_path, text)
    with pytest.raises(MeasurementError, match="quoted_rows = true"):
        read_table(path, Reading())
    table = read_table(path, Reading(quoted_rows=True))
    assert table.names == ("Time (h)", "Load (N)", "Ext, (mm)")
    np.testing.assert_array_equal(table.row, [5, 6])
    np.testing.assert_array_equal(matrix(table), [[0.1, 7, -1], [0.2, 8, -2]])


def test_a_quoted_header_cell_over_two_lines_keeps_the_line_numbers(tmp_path: Path) -> None:
    path = write(tmp_path, '"Temperature\n[degC]",F\n1,2\n3,4\n')
    table = read_table(path, Reading())
    assert table.names == ("Temperature [degC]", "F")
    np.testing.assert_array_equal(table.row, [3, 4])


@pytest.mark.parametrize(
    ("header", "names"),
    [
        ("Temperature Strain", ("Temperature", "Strain")),
        ("# Temperature\tStrain", ("Temperature", "Strain")),
        ("Temperature;Strain", ("Temperature", "Strain")),
        ('"Wire temp" "Strain"', ("Wire temp", "Strain")),
        ("Wire temp   Strain in pct", ("Wire temp", "Strain in pct")),
    ],
)
def test_a_header_with_another_delimiter_than_its_rows(
    tmp_path: Path, header: str, names: tuple[str, ...]
) -> None:
    table = read_table(write(tmp_path, f"{header}\n1\t2\n3\t4\n"), Reading())
    assert table.names == names
    np.testing.assert_array_equal(table.row, [2, 3])
    said = [] if header.startswith("#") else [("header", (1,))]  # a sign of comment is no other delimiter
    assert [(f.kind, f.rows) for f in table.findings] == said


@pytest.mark.parametrize("units", ["(s),[N]", "s,N"])
def test_a_line_of_units_below_the_names_is_read_and_said(tmp_path: Path, units: str) -> None:
    path = write(tmp_path, f"Time,Load\n{units}\n1,2\n3,4\n")
    for header in (None, True):
        table = read_table(path, Reading(header=header))
        assert table.names == ("Time", "Load")
        assert table.headers == ("Time [s]", "Load [N]")
        np.testing.assert_array_equal(table.row, [3, 4])
        assert [(f.kind, f.rows) for f in table.findings] == [("units", (2,))]


@pytest.mark.parametrize("clock", ["dd.mm.yyyy hh:mm:ss", "(hh:mm:ss.000)", "YYYY-MM-DD HH:MM:SS", "HH:MM"])
def test_how_a_clock_is_written_is_no_unit_of_it(tmp_path: Path, clock: str) -> None:
    path = write(tmp_path, f"Spring 7,\nZeit,Kraft\n{clock},N\n10:00:01,2.5\n10:00:02,4.5\n")
    assert read_table(path, Reading()).headers == ("Zeit", "Kraft [N]")


def test_names_that_are_no_units_below_a_title_stay_names(tmp_path: Path) -> None:
    path = write(tmp_path, "Sample,NiTi 3\nT,F\n1,2\n3,4\n")
    assert read_table(path, Reading()).names == ("T", "F")


def test_header_false_takes_every_line_for_data(tmp_path: Path) -> None:
    path = write(tmp_path, "T,F\n1,2\n3,4\n")
    with pytest.raises(MeasurementError) as caught:
        column(read_table(path, Reading(header=False)), 0, path)
    assert (caught.value.row, caught.value.found) == (1, "found 'T'")
    table = read_table(path, Reading(header=False, skip_rows=1))
    assert table.names is None
    np.testing.assert_array_equal(table.row, [2, 3])


def test_header_true_takes_numbers_for_names(tmp_path: Path) -> None:
    table = read_table(write(tmp_path, "1,2\n3,4\n5,6\n"), Reading(header=True))
    assert table.names == ("1", "2")
    np.testing.assert_array_equal(table.row, [2, 3])


def test_a_header_of_the_wrong_length_is_refused_where_one_is_promised(tmp_path: Path) -> None:
    path = write(tmp_path, "T,F,X\n1,2\n3,4\n")
    assert read_table(path, Reading()).names is None
    with pytest.raises(MeasurementError, match="3 names, the rows have 2 columns") as caught:
        read_table(path, Reading(header=True))
    assert caught.value.row == 1
    assert "column = 2" in str(caught.value)


def test_a_bad_cell_in_the_first_row_is_not_taken_for_a_header(tmp_path: Path) -> None:
    path = write(tmp_path, "a,b,c\n1,oops,3\n4,5,6\n7,8,9\n")
    table = read_table(path, Reading())
    assert table.names == ("a", "b", "c")
    with pytest.raises(MeasurementError) as caught:
        column(table, 1, path)
    assert (caught.value.row, caught.value.found) == (2, "found 'oops'")


def test_a_first_row_of_missing_value_codes_is_not_taken_for_a_header(tmp_path: Path) -> None:
    path = write(tmp_path, "t,T,F\n0.0,ERR,ERR\n0.1,ERR,ERR\n0.2,20,1\n0.3,21,2\n")
    table = read_table(path, Reading(missing=("ERR",)))
    assert table.names == ("t", "T", "F")
    np.testing.assert_array_equal(column(table, 1, missing=["ERR"]), [np.nan, np.nan, 20, 21])


def test_columns_that_nobody_asks_for_may_hold_text(tmp_path: Path) -> None:
    rows = "".join(f"2024-01-0{i} 12:00:0{i},run,{i}.5\n" for i in range(1, 6))
    table = read_table(write(tmp_path, "when,what,T\n" + rows), Reading())
    assert table.names == ("when", "what", "T")
    np.testing.assert_array_equal(column(table, 2), [1.5, 2.5, 3.5, 4.5, 5.5])


def test_blank_lines_between_the_data_are_counted_and_those_at_the_end_are_not(tmp_path: Path) -> None:
    table = read_table(write(tmp_path, "T,F\n1,2\n\n , \n3,4\n\n\n"), Reading())
    np.testing.assert_array_equal(table.row, [2, 5])
    assert [(f.kind, f.rows, f.count) for f in table.findings] == [("blank-line", (3, 4), 2)]


@pytest.mark.parametrize("bad", ["3", "3,4,5"])
def test_a_row_of_another_length_is_refused_with_its_line(tmp_path: Path, bad: str) -> None:
    path = write(tmp_path, f"T,F\n1,2\n\n{bad}\n5,6\n7,8\n")
    with pytest.raises(MeasurementError) as caught:
        read_table(path, Reading())
    assert caught.value.row == 4
    assert caught.value.found == f"the row has {bad.count(',') + 1} cells, the others have 2"


def test_limits_cut_by_line_even_lines_that_are_no_data(tmp_path: Path) -> None:
    path = write(tmp_path, "T,F\n1,2\n3,4\n5,6\n7,8\nend of file, tested, signed\n")
    table = read_table(path, Reading(first_row=3, last_row=4))
    np.testing.assert_array_equal(table.row, [3, 4])
    np.testing.assert_array_equal(matrix(table), [[3, 4], [5, 6]])
    assert [(f.kind, f.rows, f.count, f.dropped) for f in table.findings] == [("cut", (2, 5, 6), 3, 3)]
    with pytest.raises(MeasurementError, match="no row is left by first_row = 50"):
        read_table(path, Reading(first_row=50))


def test_a_byte_that_is_not_text_tells_its_line_and_a_remedy(tmp_path: Path) -> None:
    path = write(tmp_path, "T,F\n1,2\n3,4 °\n".encode("latin-1"))
    with pytest.raises(MeasurementError, match="byte 0xb0 is not utf-8") as caught:
        read_table(path, Reading())
    assert caught.value.row == 3
    assert 'encoding = "cp1252"' in str(caught.value)
    path = write(tmp_path, "T °C,F\n1,2\n3,4\n".encode("cp1252"))
    assert read_table(path, Reading(encoding="cp1252")).names == ("T °C", "F")
    with pytest.raises(MeasurementError, match="encoding 'utf8000' is not known"):
        read_table(path, Reading(encoding="utf8000"))


def test_an_open_quotation_mark_is_refused(tmp_path: Path) -> None:
    rows = "".join(f"{i},{i}\n" for i in range(100_000))
    with pytest.raises(MeasurementError, match="can't be split into cells"):
        read_table(write(tmp_path, 'T,F\n1,2\n"3,4\n' + rows), Reading())


def test_text_without_numbers_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MeasurementError, match="no row of numbers"):
        read_table(write(tmp_path, "once upon a time\nthere was a wire\n"), Reading())


def test_only_a_header_is_refused(tmp_path: Path) -> None:
    for header in (None, True):
        with pytest.raises(MeasurementError, match="no row of numbers"):
            read_table(write(tmp_path, "T,F\n"), Reading(header=header))


def test_thirty_thousand_rows_in_well_under_a_second(tmp_path: Path) -> None:
    values = np.random.default_rng(1).normal(size=(30_000, 6))
    path = tmp_path / "big.csv"
    np.savetxt(path, values, delimiter=",", header="a,b,c,d,e,f", comments="")
    begin = time.process_time()
    table = read_table(path, Reading())
    read = matrix(table)
    assert time.process_time() - begin < 1.0  # measured: 0.1 s
    np.testing.assert_array_equal(read, values)


def test_real_files_give_all_their_rows(shared_data: Path) -> None:
    expected = {
        "flexinol_isobaric/isobaric_50MPa.txt": (None, 499, 1),
        "smareact_nitico_isobaric/7 MPa.txt": (None, 351, 1),
        "guarneros_spring_force/raw/AB0.csv": ("SMA temperature", 30_000, 2),
        "guarneros_spring_force/filtered_every20/AB3.csv": ("SMA temperature filtered", 1_500, 2),
        "niti_raw_isobaric/raw_100MPa.csv": ("load_N", 7_137, 2),
        "nitihf_sparse_isobaric/filtered_data_100MPa.txt": ("Strain", 56, 2),
        "wire_in_water/ele_hys_1.txt": (None, 474, 1),  # CR LF
        "wire_in_water/hyd_stp_1.txt": (None, 3_832, 1),  # bare CR
        "wire_in_water/hyd_stp_3.txt": (None, 2_552, 1),  # bare CR, and a tab too many
        "diamond_load_extension/QoI_expt_load.csv": ("Extension", 978, 3),  # quoted numbers, line of units
        "muscle_wire_stress_strain/March8_2cpm.txt": (None, 3_941, 1),
    }
    for name, (second, n, first) in expected.items():
        table = read_table(shared_data / name, Reading())
        assert (None if table.names is None else table.names[1]) == second, name
        assert table.row.tolist() == list(range(first, first + n)), name
        assert np.isfinite(column(table, 1)).all(), name


def test_real_file_with_quoted_rows(shared_data: Path) -> None:
    path = shared_data / "smareact_isobaric_7cycle" / "isobaric_7cycle.txt"
    table = read_table(path, Reading(quoted_rows=True))
    assert table.names is not None
    assert table.names[3] == "Temperature Chamber (C)"
    assert table.row[[0, -1]].tolist() == [7, 1182]
    assert table.row[column(table, 3) == 0].tolist() == [630, 632, 634, 717, 721, 773, 774, 980, 1036, 1126]
    assert [(f.kind, f.rows) for f in table.findings] == [("preamble", (1, 2, 3))]
