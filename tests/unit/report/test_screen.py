"""What people read on a terminal."""

from __future__ import annotations

import io
import re

import pytest
from rich.table import Table

from sma_bayes.quantities import number_and_unit
from sma_bayes.report.screen import Screen, numbers, titled, what_helps


def shown(*things: object) -> str:
    console = Screen(file=io.StringIO(), width=100, markup=False, emoji=False)
    for thing in things:
        console.print(thing)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_negative_numbers_have_a_minus_sign_in_sentences_and_tables() -> None:
    table = Table("temperature", "condition")
    table.add_row("-30.1 to 50.7 °C", "2A-150g")
    text = shown("shift of -1.5 °C (-2.0 to -0.9), sma-bayes ask DIR --stiffness '-130 N/m'", table)
    assert "−1.5 °C (−2.0 to −0.9)" in text
    assert "−30.1 to 50.7" in text
    assert "2A-150g" in text
    assert "--stiffness '-130 N/m'" in text


def test_a_number_can_be_given_as_it_was_shown() -> None:
    assert number_and_unit("−30 degC") == (-30.0, "degC")


@pytest.mark.parametrize(
    ("noises", "advised"),
    [
        ((), ["ar1", "independent"]),
        (("ar1_student_t+growing",), ["ar1", "independent"]),
        (("ar1",), ["independent"]),
        (("independent",), []),
        (("independent", "student_t"), ["ar1", "independent"]),
        (("independent", "ar1"), ["independent"]),
    ],
)
def test_what_helps_a_fit_that_has_not_converged_is_a_simpler_noise(
    noises: tuple[str, ...], advised: list[str]
) -> None:
    told = what_helps(noises)
    assert re.findall(r"--noise (\w+)", told) == advised
    assert told.startswith("what helps: ")
    assert "--seed" in told


@pytest.mark.parametrize("width", [80, 100])
def test_no_cell_of_a_wide_table_is_cut(width: int) -> None:
    """At 80 letters a line had records `100g-he…`, and intervals were broken within their numbers."""
    console = Screen(file=io.StringIO(), width=width, markup=False, emoji=False)
    cells = [
        "22.16 to 95.62",
        "2.274 (2.169 to 2.381)",
        "(2.163 to 2.387)",
        "14.55 (13.65 to 15.46)",
        "words go on below",
    ]
    heads = ["measured [°C]", "force F [N]", "a reading of F [N]", "displacement X [mm]"]
    table = titled("at 60 °C", "record", *map(numbers, heads), "remark")
    records = ["100g-heating", "150g-cooling"]
    for record in records:
        table.add_row(record, *cells)
    console.print(table)
    told = console.file.getvalue()
    assert max(map(len, told.splitlines())) <= width
    assert "…" not in told
    assert told.count("at 60 °C") == 1
    for text in (*cells[:-1], *records):
        assert told.count(text) >= 2
    lines = told.splitlines()
    assert any("100g-heating" in line and cells[3] in line for line in lines), "a part names its records"


def test_sentences_in_a_narrow_table_have_room() -> None:
    """At 80 letters a line, why an effect was rejected stood in 17 lines of 18 letters beside its numbers."""
    console = Screen(file=io.StringIO(), width=80, markup=False, emoji=False)
    table = titled("candidates", "effect", *map(numbers, ["ln BF", "held-out score"]), "status", "why")
    why = "one stage of another shape explains as much, and of that hardly anything lies beyond a free curve"
    for effect in ("thermal_expansion", "branch_stress_shift"):
        table.add_row(effect, "37.3", "57.4 ± 18.1", "rejected", why)
    console.print(table)
    told = console.file.getvalue()
    assert max(map(len, told.splitlines())) <= 80
    assert told.count("branch_stress_shift") == 2
    assert told.count("one stage of another shape explains") == 2


def test_every_part_of_a_wide_table_tells_its_rows_apart() -> None:
    """Cold and hot starts of a condition had the same name in all parts but the first."""
    console = Screen(file=io.StringIO(), width=60, markup=False, emoji=False)
    table = titled("end", "condition", "start", *map(numbers, ["force F [N]", "displacement X [mm]"]))
    for start in ("cold", "hot"):
        table.add_row("1.0A", start, "1.002 (0.964 to 1.049)", "10.00 (9.81 to 10.22)")
    console.print(table)
    told = console.file.getvalue()
    assert (
        told.count("cold") == told.count("hot") == told.count("force F") + told.count("displacement X") == 2
    )


def test_a_title_that_is_wider_than_its_table_is_one_line() -> None:
    """`ask` broke "measured from 35.5 to 296.1 °C" over lines of the width of two columns."""
    console = Screen(file=io.StringIO(), width=100, markup=False, emoji=False)
    title = "filtered_data_100MPa-cooling, measured from 35.5 to 296.1 °C"
    table = titled(title, *map(numbers, ["T [°C]", "strain"]))
    table.add_row("150", "1.347")
    console.print(table)
    console.print(table)
    assert console.file.getvalue().splitlines().count(title) == 2
