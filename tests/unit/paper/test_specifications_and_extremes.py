"""Tables 1, 2 and 9 to 12 and the numbers of the running text: every cell against the text, every doubt recomputed."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from pint import UnitRegistry

from sma_bayes.errors import QuantityError, UnknownNameError
from sma_bayes.paper.errata import PRINTED_TABLES, printed_table
from sma_bayes.paper.extremes import (
    EXTREME_CONDITIONS,
    EXTREME_TABLES,
    EXTREME_UNITS,
    TABLE_9,
    TABLE_10,
    TABLE_11,
    TABLE_12,
    extremes,
)
from sma_bayes.paper.specifications import TABLE_1, TABLE_2, TEXT_VALUES, specification
from sma_bayes.paper.tables import CellStatus, PrintedCell, PrintedTable
from sma_bayes.quantities import ARBITRARY

ROOT = Path(__file__).resolve().parents[3]
ENTRY_TABLES = (TABLE_1, TABLE_2, TEXT_VALUES)


@pytest.fixture(scope="module")
def text() -> list[str]:
    path = ROOT.parent / "shared" / "paper" / "modified-sigmoid-sma-spring.txt"
    if not path.is_file():
        pytest.skip("the text of the paper is not at ../shared/paper beside the checkout")
    return path.read_text(encoding="utf-8").split("\n")


def fields(text: list[str], line: int) -> list[str]:
    return [field.strip() for field in text[line - 1].split("\t") if field.strip()]


# --- against the text ---------------------------------------------------------------------------------


@pytest.mark.parametrize("table", [TABLE_1, TABLE_2], ids=lambda t: f"table{t.number}")
def test_an_entry_is_the_last_field_of_its_line(text: list[str], table: PrintedTable) -> None:
    for cell in table.cells:
        found = fields(text, cell.line)[-1]
        assert cell.entry in (found, found.strip("$")), cell


def test_values_of_the_text_stand_on_their_line(text: list[str]) -> None:
    for cell in TEXT_VALUES.cells:
        assert cell.entry in text[cell.line - 1], cell


@pytest.mark.parametrize("table", ENTRY_TABLES, ids=lambda t: f"table{t.number}")
def test_digits_and_power_of_ten_stand_in_the_entry(table: PrintedTable) -> None:
    raised = str.maketrans("⁻⁴⁵⁶", "-456")
    for cell in table.cells:
        assert cell.printed in cell.entry, cell
        plain = cell.entry.translate(raised).replace("{", "").replace("}", "").replace(" ", "")
        power = re.search(r"10\^?(-\d)", plain)
        assert cell.power == (int(power[1]) if power else 0), cell


def test_no_row_of_tables_1_and_2_is_left_out(text: list[str]) -> None:
    for table, first, last in ((TABLE_1, 182, 205), (TABLE_2, 213, 216)):
        with_digits = {
            n for n in range(first, last + 1) if any(c.isdigit() for c in (fields(text, n) or [""])[-1])
        }
        assert {cell.line for cell in table.cells} == with_digits


@pytest.mark.parametrize("table", EXTREME_TABLES, ids=lambda t: f"table{t.number}")
def test_every_extreme_is_printed_in_its_place(text: list[str], table: PrintedTable) -> None:
    for cell in table.cells:
        row = fields(text, cell.line)
        assert cell.printed == row[1 + list(EXTREME_UNITS).index(cell.quantity)], cell
        condition = EXTREME_CONDITIONS[cell.condition]
        named = {
            9: condition.current,
            10: (condition.load or 0) / 9.80665e-3,
            11: 100 * (condition.duty_cycle or 0),
            12: 1e3 * (condition.frequency or 0),
        }[table.number]
        assert float(row[0]) == pytest.approx(named), cell


# --- what is there ------------------------------------------------------------------------------------


def test_tables_1_to_12_and_the_text() -> None:
    assert [t.number for t in PRINTED_TABLES] == [*range(1, 13), 0]
    assert [len(t.cells) for t in EXTREME_TABLES] == [12, 12, 12, 12]
    assert printed_table(11) is TABLE_11
    with pytest.raises(UnknownNameError, match="table 13"):
        printed_table(13)


def test_units_are_known() -> None:
    ureg = UnitRegistry()
    for table in PRINTED_TABLES:
        for cell in table.cells:
            if ARBITRARY not in cell.unit:
                ureg.Unit(cell.unit)


def test_a_power_of_ten_belongs_to_value_and_resolution() -> None:
    cell = PrintedCell("x", "m", "81.67", 1, power=-8)
    assert cell.value == 81.67e-8
    assert cell.resolution == pytest.approx(1e-10)


def test_specification_converts_and_names_what_is_there() -> None:
    assert specification(TABLE_1, "resistivity_martensite", "ohm*m") == pytest.approx(8e-7)
    with pytest.raises(UnknownNameError, match="wire_diameter"):
        specification(TABLE_1, "wire_diametre", "m")
    with pytest.raises(QuantityError, match="wrong kind"):
        specification(TABLE_1, "wire_diameter", "kg")


# --- statuses, recomputed -----------------------------------------------------------------------------


def doubted(table: PrintedTable, status: CellStatus) -> set[tuple[str, str]]:
    return {(c.condition, c.quantity) for c in table.cells if c.status is status}


def test_a_temperature_is_doubted_exactly_where_it_stays_below_as() -> None:
    for table in EXTREME_TABLES:
        below = {
            (c.condition, c.quantity)
            for c in table.cells
            if c.quantity == "temperature_max" and c.value < 73.83
        }
        assert {d for d in doubted(table, CellStatus.IMPLAUSIBLE) if d[1] == "temperature_max"} == below
    assert doubted(TABLE_10, CellStatus.IMPLAUSIBLE) == set()


def test_a_stiffness_is_doubted_exactly_where_it_needs_more_than_any_other_table() -> None:
    greatest = max(c.value for t in (TABLE_9, TABLE_10) for c in t.cells if c.quantity == "stiffness_max")
    assert greatest == 189.52
    beyond = {(c.condition, c.quantity) for c in TABLE_11.cells if c.unit == "N/m" and c.value > greatest}
    assert {d for d in doubted(TABLE_11, CellStatus.IMPLAUSIBLE) if d[1] == "stiffness_max"} == beyond


def test_numbers_in_the_reasons_of_table_11() -> None:
    for condition, row in extremes(TABLE_11).items():
        cells = TABLE_11.select(condition, None)
        modulus = 8 * 3.0e-3**3 * 45 * row["stiffness_max"] / 0.5e-3**4
        assert f"{modulus / 1e9:.1f} GPa" in cells["stiffness_max"].reason
        assert f"{row['stiffness_max'] / row['stiffness_min']:.1f}-fold" in cells["temperature_max"].reason


def test_lost_stiffness_of_table_12_copies_frequency_and_temperature() -> None:
    for frequency in (10, 30, 50):
        suffix = "-table5" if frequency == 10 else ""
        row = TABLE_12.select(f"2A-{frequency}mHz{suffix}", None)
        assert row["stiffness_min"].printed == str(frequency)
        assert row["stiffness_max"].printed == row["temperature_min"].printed
        assert {row[f"stiffness_{end}"].status for end in ("min", "max")} == {CellStatus.DAMAGED}
    assert all("stiffness_min" not in row for row in extremes(TABLE_12).values())


def test_figures_9_and_11_repeat_tables_9_and_10() -> None:
    text = TEXT_VALUES.select("", None)
    for figure, table, condition in ((9, TABLE_9, "1.5A-10mHz"), (11, TABLE_10, "100g-10mHz")):
        for end in ("min", "max"):
            cell = table.select(condition, None)[f"stiffness_{end}"]
            assert text[f"stiffness_{end}_fig{figure}"].printed == cell.printed
