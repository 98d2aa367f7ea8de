"""Tables as CSV and as LaTeX."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from sma_bayes.account import Account
from sma_bayes.report.content import Content, Estimate, Number
from sma_bayes.report.tables import (
    UNIT_OF_ROW,
    Cell,
    Column,
    Table,
    cell_text,
    correlation_table,
    csv_columns,
    group_text,
    powers,
    report_tables,
    rows_text,
    tex,
    write_tables,
)
from sma_bayes.report.took import account_table
from sma_bayes.runs.fit_document import DiscrepancySummary
from sma_bayes.runs.schema import FindingDocument, RunAccount, Workers

TABLES = (
    "parameters", "goodness_of_fit", "correlation", "loops", "transformation", "diagnostics", "noise", "checks",
    "findings", "printed",
)  # fmt: skip


@pytest.fixture(scope="module")
def written(content: Content, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tables")
    write_tables(report_tables(content), folder)
    return folder


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("name", TABLES)
def test_each_table_is_written_twice(written: Path, name: str) -> None:
    assert rows_of(written / f"{name}.csv")
    assert (written / f"{name}.tex").stat().st_size > 200


def test_transformation_temperatures_are_those_of_the_summary(finished: Path, written: Path) -> None:
    summary = json.loads((finished / "summary.json").read_text(encoding="utf-8"))
    told = [(r["branch"], name, t) for r in summary["records"] for name, t in r["transformation"].items()]
    assert [(b, n) for b, n, _ in told] == [
        ("heating", "As"), ("heating", "Af"), ("cooling", "Mf"), ("cooling", "Ms")
    ]  # fmt: skip
    for row, (branch, name, t) in zip(rows_of(written / "transformation.csv"), told, strict=True):
        assert (row["branch"], row["name"]) == (branch, name)
        assert float(row["value_median [unit]"]) == pytest.approx(t["median"], rel=1e-8)
        assert row["within_data"] == ("yes" if t["within_data"] else "no, extrapolated")


def test_parameters_keep_all_digits(written: Path, content: Content) -> None:
    rows = rows_of(written / "parameters.csv")
    parameters = [p for r in content.records for p in r.parameters]
    assert len(rows) == len(parameters)
    for row, p in zip(rows, parameters, strict=True):
        assert float(row["mean [unit]"]) == pytest.approx(p.mean, rel=1e-8)
        assert float(row["q95 [unit]"]) == pytest.approx(p.estimate.q95, rel=1e-8)
        assert float(row["rhat [1]"]) == pytest.approx(p.rhat, rel=1e-8)
        assert (row["identified"], row["prior"]) == ("true" if p.identified else "false", p.prior_text)
    assert {row["unit"] for row in rows} == {"cm", "N", "arbitrary unit", "1/arbitrary unit"}


@pytest.mark.parametrize("name", TABLES)
def test_every_header_of_numbers_has_a_unit(content: Content, name: str) -> None:
    table = report_tables(content)[name]
    for place, column in enumerate(table.columns):
        numeric = any(isinstance(row[place], Number | Estimate) for row in table.rows)
        assert bool(column.unit) >= numeric, f"{name}: {column.name}"
        if column.unit == UNIT_OF_ROW:
            assert any(c.key == "unit" for c in table.columns)
        assert "degC" not in column.header
    assert all(len(row) == len(table.columns) for row in table.rows)


def test_a_goodness_of_fit_is_what_its_note_says(content: Content) -> None:
    """The RMSE of least squares has n - p below it, that of correlation factors n; both were a mean square error."""
    table = report_tables(content)["goodness_of_fit"]
    assert "RMSE (the root of SSE over n − p)" in table.note
    columns = {k.split(" [")[0]: v for k, v in csv_columns(table).items()}
    sse, n, p, rmse = (np.asarray(columns[k], dtype=float) for k in ("sse", "n", "p", "rmse"))
    np.testing.assert_allclose(rmse, np.sqrt(sse / (n - p)))


def test_adjusted_r2_says_that_a_discrepancy_is_not_counted(content: Content) -> None:
    record, beside = content.records[0], cast("dict[str, DiscrepancySummary]", {"force": object()})
    missed = replace(record, document=record.document.model_copy(update={"discrepancy": beside}))
    assert "discrepancy" not in correlation_table([record]).note
    assert "not what the discrepancy beside it takes up" in correlation_table([missed]).note


def test_an_estimate_becomes_three_columns() -> None:
    table = Table("t", "T", "", (Column("r", "r", "1"),), ((Estimate(0.5, 0.4, 0.6),), (None,)))
    columns = csv_columns(table)
    assert list(columns) == ["r_q05 [1]", "r_median [1]", "r_q95 [1]"]
    assert columns["r_q95 [1]"] == pytest.approx([0.6, float("nan")], nan_ok=True)


def test_an_empty_cell_does_not_turn_a_column_of_numbers_into_text(tmp_path: Path) -> None:
    rows = ((Number(1 / 3, "N"), True, "x"), (Number(None, "N"), "fixed", None))
    table = Table("t", "T", "", (Column("v", "v", UNIT_OF_ROW), Column("b", "b"), Column("w", "w")), rows)
    write_tables({"t": table}, tmp_path)
    lines = (tmp_path / "t.csv").read_text(encoding="utf-8").split("\n")
    assert lines == ["v [unit],b,w", "0.333333333,true,x", ",fixed,", ""]


@pytest.mark.parametrize("name", TABLES)
def test_latex_is_balanced_and_rectangular(written: Path, name: str) -> None:
    text = (written / f"{name}.tex").read_text(encoding="utf-8")
    assert text.count(r"\begin{longtable}") == text.count(r"\end{longtable}") == 1
    assert all(ord(c) < 256 for c in text)
    bare = re.sub(r"\\[{}&%$#_]", "", text)
    assert bare.count("{") == bare.count("}")
    assert bare.count("$") % 2 == 0
    columns = re.search(r"\\begin\{longtable\}\{(.*)\}\n", text)
    assert columns is not None
    wanted = len(re.sub(r">\{[^}]*\}p\{[^}]*\}", "p", columns.group(1)))
    body = [
        line
        for line in bare.split("\n")
        if line.endswith(r"\\") and "multicolumn" not in line and "&" in line
    ]
    assert body
    assert {line.count("&") + 1 for line in body} == {wanted}


def test_user_text_can_not_break_latex(content: Content) -> None:
    nasty = FindingDocument(
        kind="spike", message=r"100 % & \end{longtable} $x_1$ {", file="a_b.csv", rows=(1, 2), count=2, dropped=2,
        condition="c#1", branch="heating", column="σ", severity="look",
    )  # fmt: skip
    text = tex(report_tables(replace(content, findings=(nasty,)))["findings"])
    assert r"100 \% \& \textbackslash{}end\{longtable\} \$x\_1\$ \{" in text
    assert text.count(r"\end{longtable}") == 1


def test_groups_of_rows_are_named_once(content: Content) -> None:
    table = report_tables(content)["parameters"]
    text = tex(table)
    assert text.count(r"\textit{100g-10mHz, heating}") == 1
    assert group_text(table, ("c", "heating", False)) == "c, heating, not converged"


def test_a_number_over_a_group_of_rows_has_its_unit() -> None:
    columns = (
        Column("sweep", "sweep"),
        Column("at", "at", "degF"),
        Column("share", "share", "1"),
        Column("x", "x"),
    )
    table = Table("t", "T", "", columns, (), 3)
    assert group_text(table, ("a", Number(68.0, "degF", 0.1), Number(0.5, "1", 0.1))) == "a, 68.00 °F, 0.50"
    assert group_text(table, ("a", None, None)) == "a", "what a group does not have is not a dash"


def test_rows_are_listed_in_runs() -> None:
    assert rows_text((), 0) == ""
    assert rows_text((7,), 1) == "7"
    assert rows_text((1, 2, 3, 7, 9, 10), 6) == "1–3, 7, 9–10"
    assert rows_text((1, 2), 50) == "1–2 …"


def test_cells_as_people_read_them() -> None:
    assert [cell_text(c) for c in (True, False, None, "", 7)] == ["yes", "no", "–", "–", "7"]
    assert cell_text(Number(0.5, "N", 0.01)) == "0.500"
    assert cell_text(Estimate(None, None, None)) == "–"


def test_a_column_with_one_unit_has_one_notation_and_its_power_in_the_head() -> None:
    cells = [Estimate(2.31e10, 2.30e10, 2.32e10, "Pa"), Estimate(4.0e8, 3.9e8, 4.1e8, "Pa"), None]
    table = Table("t", "T", "", (Column("modulus", "modulus", "Pa"),), tuple((c,) for c in cells))
    assert powers(table) == (10,)
    text = tex(table)
    assert r"modulus [$10^{10}$ \unit{\pascal}]" in text
    assert "2.3100 [2.3000, 2.3200]" in text
    assert "0.04000 [0.03900, 0.04100]" in text
    assert text.count("times") == 0


def test_rows_that_share_a_unit_have_one_notation() -> None:
    columns = (Column("unit", "unit"), Column("R-hat", "rhat", "1"), Column("RMSE", "rmse", UNIT_OF_ROW))
    small, large = Estimate(7.55e-5, 6.90e-5, 8.75e-5, "1"), Estimate(1.91e-4, 1.60e-4, 2.34e-4, "1")
    table = Table("t", "T", "", columns, (("1", small, small), ("1", large, large)))
    assert powers(table) == (None, -4, -4)
    text = tex(table)
    assert r"$\hat{R}$ [$10^{-4}$]" in text
    assert "RMSE [$10^{-4}$ unit]" in text
    assert "0.755 [0.690, 0.875]" in text
    assert "times" not in text


@pytest.mark.parametrize("other", [Number(2.508, "1", 0.001), Estimate(0.3, 0.2, 0.4, "N")])
def test_numbers_of_another_unit_or_without_an_interval_keep_the_notation_of_all(other: Cell) -> None:
    columns = (Column("unit", "unit"), Column("RMSE", "rmse", UNIT_OF_ROW))
    table = Table("t", "T", "", columns, (("1", Estimate(7.5e-5, 7e-5, 8e-5, "1")), ("?", other)))
    assert powers(table) == (None, None)


def test_a_time_is_told_to_hundredths_of_a_second() -> None:
    found = SimpleNamespace(
        stages_s={"read": 9.52e-6, "sample": 61.3}, stages_cpu_s={"read": 9.4e-6, "sample": 60.2},
        workers=Workers(where="this process", lost=()),
    )  # fmt: skip
    rows = account_table(cast(RunAccount, found), Account()).rows
    assert [[cell_text(c) for c in row[1:]] for row in rows] == [["0.000", "0.000"], ["61.3", "60.2"]]


def test_wide_columns_leave_room_for_the_others_in_print() -> None:
    columns = (Column("meaning", "meaning"), Column("why not", "why"))
    table = Table("t", "T", "", columns, (("modulus", "the slope is -114 microstrain"),))
    text = tex(table)
    assert sum(map(float, re.findall(r"p\{([0-9.]+)\\linewidth\}", text))) <= 0.53
    assert "-114" not in text, "a minus sign, not a hyphen"
    alone = tex(Table("t", "T", "", columns[1:], (("x",),)))
    assert r"p{0.5\linewidth}" in alone


def test_a_share_is_not_told_more_finely_than_it_is_known() -> None:
    shares = [cell_text(Number(p, "1", 0.05, 0.002)) for p in (0.0, 0.0019, 0.002, 0.5, 0.998, 1.0)]
    assert shares == ["< 0.002", "< 0.002", "0.002", "0.500", "0.998", "> 0.998"]
    assert cell_text(Number(None, "1", 0.05, 0.002)) == "–"


def test_numbers_of_ordinary_size_keep_their_notation() -> None:
    table = Table("t", "T", "", (Column("K", "k", "N/m"),), ((Estimate(80.8, 70.4, 84.2, "N/m"),),))
    assert powers(table) == (None,)
    assert r"K [\unit{\newton\per\metre}]" in tex(table)
