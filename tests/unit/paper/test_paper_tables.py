"""Every printed cell against the text, every status against a recomputation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.special import expit

from sma_bayes.errors import UnknownNameError
from sma_bayes.paper.tables import (
    CONDITIONS,
    PARAMETER_TABLES,
    PARAMETER_UNITS,
    STATISTIC_UNITS,
    STATISTICS_TABLES,
    TABLE_3,
    CellStatus,
    PrintedCell,
    PrintedTable,
)
from sma_bayes.quantities import convert
from sma_bayes.records.types import Branch

ROOT = Path(__file__).resolve().parents[3]
TABLES = (*PARAMETER_TABLES, *STATISTICS_TABLES)
P = 6
"""Parameters counted by the paper's adjusted R2."""

COLUMNS = [
    (table, condition, branch)
    for table in STATISTICS_TABLES
    for condition in dict.fromkeys(cell.condition for cell in table.cells)
    for branch in Branch
]

READABLE = [c for c in COLUMNS if c[0].select(*c[1:])["r2"].status is not CellStatus.DAMAGED]


@pytest.fixture(scope="module")
def text() -> list[str]:
    path = ROOT.parent / "shared" / "paper" / "modified-sigmoid-sma-spring.txt"
    if not path.is_file():
        pytest.skip("the text of the paper is not at ../shared/paper beside the checkout")
    return path.read_text(encoding="utf-8").split("\n")


def fields(text: list[str], line: int) -> list[str]:
    return [field.strip() for field in text[line - 1].split("\t") if field.strip()]


def interval(cell: PrintedCell) -> tuple[float, float]:
    """Every value that rounds to the printed one."""
    return cell.value - cell.resolution / 2, cell.value + cell.resolution / 2


def degrees_of_freedom(column: dict[str, PrintedCell]) -> tuple[float, float]:
    """Range of n - p = SSE / RMSE**2 that the printed digits leave."""
    (s_low, s_high), (r_low, r_high) = interval(column["sse"]), interval(column["rmse"])
    return s_low / r_high**2, s_high / r_low**2


def adjusted(r2: float, dof: float) -> float:
    return 1 - (1 - r2) * (dof + P - 1) / dof


# --- against the text ---------------------------------------------------------------------------------


@pytest.mark.parametrize("table", TABLES, ids=lambda t: f"table{t.number}")
def test_every_cell_is_printed_on_its_line(text: list[str], table: PrintedTable) -> None:
    for cell in table.cells:
        row = fields(text, cell.line)
        if table in PARAMETER_TABLES:
            expected = row[1 + list(PARAMETER_UNITS).index(cell.quantity)]
        else:
            conditions = list(dict.fromkeys(c.condition for c in table.cells))
            expected = row[1 + 2 * conditions.index(cell.condition) + list(Branch).index(cell.branch)]
        assert cell.printed == expected, cell


def test_rows_belong_to_the_condition_that_the_text_names(text: list[str]) -> None:
    for table, attribute, factor in zip(
        PARAMETER_TABLES, ("current", "load", "frequency"), (1.0, 1e-3 * 9.80665, 1e-3), strict=True
    ):
        for cell in table.cells:
            named = float(fields(text, cell.line)[0]) * factor
            assert getattr(CONDITIONS[cell.condition], attribute) == pytest.approx(named), cell


def test_branches_follow_the_heading_above(text: list[str]) -> None:
    """The headings are torn by tabs ("HE ATING CYCLE"), but are the only lines all in capitals."""
    for table in PARAMETER_TABLES:
        for cell in table.cells:
            above = ("".join(line.split()) for line in reversed(text[: cell.line - 1]))
            heading = next(line for line in above if line.isalpha() and line.isupper())
            assert heading[:2] == ("HE" if cell.branch is Branch.HEATING else "CO"), (cell, heading)


def test_statistics_stand_in_their_rows(text: list[str]) -> None:
    names = {"sse": "SSE", "r2": "R-Squared", "rmse": "Root", "adj_r2": "Adjusted"}
    for table in STATISTICS_TABLES:
        for cell in table.cells:
            assert names[cell.quantity] in fields(text, cell.line)[0], cell


# --- what is there ------------------------------------------------------------------------------------


def test_there_are_eighteen_rows_and_eighteen_columns() -> None:
    assert [len(t.cells) for t in PARAMETER_TABLES] == [36, 36, 36]
    assert [len(t.cells) for t in STATISTICS_TABLES] == [24, 24, 24]
    assert {c.condition for t in TABLES for c in t.cells} == set(CONDITIONS)
    for parameters, statistics in zip(PARAMETER_TABLES, STATISTICS_TABLES, strict=True):
        assert {(c.condition, c.branch) for c in parameters.cells} == {
            (c.condition, c.branch) for c in statistics.cells
        }


def test_two_runs_at_2_A_and_10_mHz_are_kept_apart() -> None:
    one, other = CONDITIONS["2A-10mHz-table3"], CONDITIONS["2A-10mHz-table5"]
    assert (one.current, one.frequency) == (other.current, other.frequency) == (2.0, 0.010)
    a, b = (
        t.select(i, Branch.HEATING)["A1"].value
        for t, i in ((TABLE_3, one.id), (PARAMETER_TABLES[2], other.id))
    )
    assert a / b > 2


def test_selecting_an_unknown_row_names_the_known_ones() -> None:
    with pytest.raises(UnknownNameError, match="1A-10mHz"):
        TABLE_3.select("3A-10mHz", Branch.HEATING)
    with pytest.raises(UnknownNameError):
        TABLE_3.select("1A-10mHz", None)


def test_statistics_are_in_the_unit_of_stiffness_squared() -> None:
    assert convert(convert(1.0, "N/cm", "N/m"), "N/m", "N/cm") == pytest.approx(1.0)
    assert convert(1.0, STATISTIC_UNITS["sse"], "(N/cm)**2") == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("status", "reason", "reconstructed"),
    [
        (CellStatus.OK, "a reason", None),
        (CellStatus.DAMAGED, "", None),
        (CellStatus.RECONSTRUCTED, "a reason", None),
        (CellStatus.OK, "", 1.0),
        (CellStatus.DAMAGED, "a reason", 1.0),
    ],
)
def test_a_cell_can_not_contradict_its_own_status(
    status: CellStatus, reason: str, reconstructed: float | None
) -> None:
    with pytest.raises(ValueError, match="line 7"):
        PrintedCell("A1", "cm", "1.0", 7, status=status, reason=reason, reconstructed=reconstructed)


def test_resolution_is_one_unit_of_the_last_digit() -> None:
    assert PrintedCell("A1", "cm", "4.769", 1).resolution == pytest.approx(1e-3)
    assert PrintedCell("A1", "cm", "75", 1).resolution == 1.0


# --- statuses, recomputed -----------------------------------------------------------------------------


@pytest.mark.parametrize(("table", "condition", "branch"), COLUMNS)
def test_a_lost_column_is_a_copy_and_no_other_is(table: PrintedTable, condition: str, branch: Branch) -> None:
    places = list(dict.fromkeys((c.condition, c.branch) for c in table.cells if c.quantity == "sse"))
    position = places.index((condition, branch))
    column = [cell.printed for cell in table.select(condition, branch).values()]
    earlier = [[c.printed for c in table.select(*place).values()] for place in places[:position]]
    lost = {cell.status is CellStatus.DAMAGED for cell in table.select(condition, branch).values()}
    assert lost == {column in earlier}


@pytest.mark.parametrize(("table", "condition", "branch"), READABLE)
def test_statistics_agree_exactly_where_they_are_marked_ok(
    table: PrintedTable, condition: str, branch: Branch
) -> None:
    """SSE, RMSE, R2 and adjusted R2 of a column are tied: check every combination that rounding leaves."""
    column = table.select(condition, branch)
    dof, (r2_low, r2_high) = degrees_of_freedom(column), interval(column["r2"])
    low, high = adjusted(r2_low, dof[0]), adjusted(r2_high, dof[1])
    printed_low, printed_high = interval(column["adj_r2"])
    consistent = printed_low <= high and low <= printed_high
    assert consistent == (column["sse"].sound and column["adj_r2"].sound), (low, high)
    assert column["r2"].sound
    assert column["rmse"].sound


def test_a_doubted_adjusted_r2_has_beside_it_what_its_column_gives() -> None:
    doubted = [c for t in STATISTICS_TABLES for c in t.cells if c.status is CellStatus.IMPLAUSIBLE]
    assert [c.quantity for c in doubted] == ["adj_r2"] * 3
    for cell in doubted:
        column = STATISTICS_TABLES[0].select(cell.condition, cell.branch)
        dof = column["sse"].value / column["rmse"].value ** 2
        expected = adjusted(column["r2"].value, dof)
        assert cell.reconstructed == pytest.approx(expected, abs=0.5e-4)
        assert f"{cell.reconstructed:.4f}" in cell.reason


def test_reasons_of_the_doubted_adjusted_r2() -> None:
    def parameters_needed(condition: str, branch: Branch) -> tuple[float, float]:
        """Range of p in 1 - adj = (1 - R2)(n - 1)/(n - p) that rounding leaves."""
        column = STATISTICS_TABLES[0].select(condition, branch)
        (adj_low, adj_high), (r2_low, r2_high) = interval(column["adj_r2"]), interval(column["r2"])
        dof_low, dof_high = degrees_of_freedom(column)
        needed = [
            dof * ((1 - adj) / (1 - r2) - 1) + 1
            for dof in (dof_low, dof_high)
            for adj, r2 in ((adj_high, r2_low), (adj_low, r2_high))
        ]
        return min(needed), max(needed)

    assert parameters_needed("1A-10mHz", Branch.HEATING)[0] > 400
    assert 4 < parameters_needed("1A-10mHz", Branch.COOLING)[1] < 5
    assert parameters_needed("2A-10mHz-table3", Branch.COOLING)[1] < 0  # adjusted R2 above R2
    low, high = parameters_needed("2A-10mHz-table3", Branch.HEATING)
    assert low < P < high


def test_the_sse_of_150_g_is_off_by_a_factor_of_ten() -> None:
    column = STATISTICS_TABLES[1].select("150g-10mHz", Branch.HEATING)
    sse = column["sse"]
    assert sse.status is CellStatus.RECONSTRUCTED
    assert sse.reconstructed == pytest.approx(sse.value / 10)
    (r2_low, r2_high), (adj_low, adj_high) = interval(column["r2"]), interval(column["adj_r2"])
    # (1 - adj)/(1 - R2) = 1 + (p - 1)/dof, solved for dof
    allowed = (
        (P - 1) / ((1 - adj_low) / (1 - r2_high) - 1),
        (P - 1) / ((1 - adj_high) / (1 - r2_low) - 1),
    )
    assert [round(bound) for bound in allowed] == [15, 23]
    rmse = column["rmse"].value
    assert round(sse.value / rmse**2) == 189
    assert allowed[0] < sse.reconstructed / rmse**2 < allowed[1]


def test_degrees_of_freedom_of_the_sound_columns() -> None:
    """The list that goes with the paper, recomputed."""
    columns = [table.select(condition, branch) for table, condition, branch in COLUMNS]
    sound = [c for c in columns if c["sse"].sound and c["rmse"].sound]
    found = [round(c["sse"].value / c["rmse"].value ** 2) for c in sound]
    assert found == [85, 82, 67, 122, 22, 63, 20, 25, 35, 97, 26]


def test_cooling_at_1_A_is_nearly_a_step(text: list[str]) -> None:
    doubted = [c for t in PARAMETER_TABLES for c in t.cells if not c.sound]
    assert [(c.condition, c.branch, c.quantity, c.status) for c in doubted] == [
        ("1A-10mHz", Branch.COOLING, name, CellStatus.IMPLAUSIBLE) for name in ("A2", "B2")
    ]
    for cell in doubted:
        others = [
            c.value
            for t in PARAMETER_TABLES
            for c in t.cells
            if c.quantity == cell.quantity and c is not cell
        ]
        assert cell.value > 2 * max(others)
        heating = TABLE_3.select("1A-10mHz", Branch.HEATING)[cell.quantity].value
        assert cell.value / heating == pytest.approx(5, abs=0.15)
    v = {name: cell.value for name, cell in TABLE_3.select("1A-10mHz", Branch.COOLING).items()}
    temperature = np.linspace(-10, 15, 250_001)
    a, b = v["A2"] * (temperature - v["A3"]), v["B2"] * (temperature - v["B3"])
    stiffness = v["B1"] * v["B2"] * expit(b) * expit(-b) / (v["A1"] * v["A2"] * expit(a) * expit(-a))
    assert stiffness.max() < 0.97  # a hump: A2 < B2, so it falls on both sides
    assert stiffness[[0, -1]].max() < 0.02 * stiffness.max()
    assert float(fields(text, 394)[4]) == 146.54


def test_facts_of_the_printed_rows() -> None:
    rows = [
        {name: cell.value for name, cell in table.select(condition, branch).items()}
        for table in PARAMETER_TABLES
        for condition in dict.fromkeys(c.condition for c in table.cells)
        for branch in Branch
    ]
    assert len(rows) == 18
    assert all(row["B3"] > row["A3"] for row in rows)
    assert sum(row["A2"] > row["B2"] for row in rows) == 3  # unbounded; the other 15 are humps
    ratio = np.array([row["B1"] / row["A1"] for row in rows]).reshape(-1, 2)
    assert np.all(np.abs(np.log(ratio[:, 0] / ratio[:, 1])) < np.log(1.09))
    assert max(row["B3"] for row in rows) < 4.2
