"""Exports: nothing lost, nothing replaced, the page of the documentation up to date."""

from __future__ import annotations

import csv
import io
import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from sma_bayes.cli import command_line
from sma_bayes.errors import OutputError, UnknownNameError
from sma_bayes.paper.errata import PRINTED_TABLES, errata
from sma_bayes.paper.tables import CellStatus
from sma_bayes.studies.paper.export import FORMATS, render, select, sheets, texts, write

ROOT = Path(__file__).resolve().parents[4]


def test_the_page_of_the_documentation_is_up_to_date() -> None:
    page = (ROOT / "docs" / "reference" / "errata.md").read_text(encoding="utf-8")
    assert page == render(select(errata_only=True), "markdown"), (
        "write it anew: sma-bayes paper --errata --format markdown > docs/reference/errata.md"
    )


def test_json_holds_every_cell_and_every_erratum() -> None:
    document = json.loads(render(select(), "json"))
    assert document["schema"] == "sma-bayes/paper/1"
    assert [t["number"] for t in document["tables"]] == [t.number for t in PRINTED_TABLES]
    for written, table in zip(document["tables"], PRINTED_TABLES, strict=True):
        assert len(written["cells"]) == len(table.cells)
        for row, cell in zip(written["cells"], table.cells, strict=True):
            lost = cell.status is CellStatus.DAMAGED
            assert row["published"] == (None if lost else cell.value)
            assert row["corrected"] == cell.reconstructed
            assert cell.printed in row["printed"]
            assert bool(row["errata"]) == (cell.status is not CellStatus.OK)
    assert [e["id"] for e in document["errata"]] == [e.id for e in errata()]


def test_csv_reads_back() -> None:
    named = texts(select(7), "csv")
    rows = list(csv.DictReader(io.StringIO(named["table-7.csv"])))
    assert len(rows) == 24
    moved = next(r for r in rows if r["status"] == "reconstructed")
    assert (moved["published"], moved["corrected"], moved["errata"]) == ("0.058", "0.0058", "E22")
    assert [r["published"] for r in rows if r["status"] == "damaged"] == [""] * 12
    effects = list(csv.DictReader(io.StringIO(named["effects.csv"])))
    assert {r["id"] for r in effects} <= {e.id for e in errata() if 7 in e.tables}


def test_latex_is_plain_and_balanced() -> None:
    for name, tex in texts(select(), "latex").items():
        assert tex.isascii(), (name, sorted({c for c in tex if ord(c) > 127}))
        assert tex.count(r"\begin{longtable}") == tex.count(r"\end{longtable}") == 1
        body = tex.split(r"\endfoot")[1].split(r"\end{longtable}")[0]
        alignment = re.search(r"\\begin\{longtable\}\{(.*)\}\n", tex)[1]
        columns = len(re.sub(r">\{[^}]*\}p\{[^}]*\}", "l", alignment))
        for row in body.strip().splitlines():
            assert len(re.findall(r"(?<!\\)&", row)) == columns - 1, (name, row)


def test_text_shows_printed_and_corrected_side_by_side() -> None:
    text = render(select(7), "text")
    line = next(row for row in text.splitlines() if "0.0580" in row and "reconstructed" in row)
    assert "0.0058" in line


def test_one_table_comes_with_its_errata_only() -> None:
    chosen = select(12)
    assert [t.number for t in chosen.tables] == [12]
    assert {e.id for e in chosen.errata} == {e.id for e in errata() if 12 in e.tables}
    assert [s.name for s in sheets(select(9, errata_only=True))] == ["errata", "effects"]


@pytest.mark.parametrize("form", FORMATS)
def test_every_format_is_written_as_it_is_rendered(form: str, tmp_path: Path) -> None:
    chosen = select(2)
    paths = write(chosen, tmp_path / "new", form)
    assert sorted(tmp_path.glob("new/*")) == sorted(paths)
    assert "\n".join(p.read_text(encoding="utf-8") for p in paths) == render(chosen, form)


def test_mistakes_of_the_user_are_named(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="json"):
        render(select(2), "jsn")
    (tmp_path / "file").write_text("in the way", encoding="utf-8")
    with pytest.raises(OutputError, match="can't be written"):
        write(select(2), tmp_path / "file", "csv")


def test_the_verb(tmp_path: Path) -> None:
    runner = CliRunner()
    shown = runner.invoke(command_line(), ["paper", "--table", "2", "--format", "csv"])
    assert shown.exit_code == 0
    assert "130 N/m" in shown.output
    assert json.loads(runner.invoke(command_line(), ["paper", "--table", "2", "--format", "json"]).output)[
        "tables"
    ]
    only = runner.invoke(command_line(), ["paper", "--errata", "--table", "1", "--format", "markdown"]).output
    assert "## E33" in only
    assert "## Table 1" not in only
    written = runner.invoke(
        command_line(), ["paper", "--table", "1", "--format", "latex", "--out", str(tmp_path)]
    )
    assert sorted(p.name for p in tmp_path.iterdir()) == ["effects.tex", "errata.tex", "table-1.tex"]
    assert written.output.split() == [str(tmp_path / n) for n in ("table-1.tex", "errata.tex", "effects.tex")]
    assert isinstance(runner.invoke(command_line(), ["paper", "--table", "99"]).exception, UnknownNameError)
