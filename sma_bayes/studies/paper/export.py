"""The printed tables and the errata as text, CSV, JSON, LaTeX or Markdown.

Printed and reconstructed values stand side by side, each cell with its status; nothing is replaced.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from io import StringIO
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from sma_bayes.errors import OutputError, require_known
from sma_bayes.latex import longtable, tex_row, wrapped
from sma_bayes.paper.correlation import ImpliedCorrelationRow, implied_average, implied_correlations
from sma_bayes.paper.errata import PRINTED_TABLES, Erratum, address, errata, printed_table
from sma_bayes.paper.tables import CellStatus, PrintedCell, PrintedTable
from sma_bayes.quantities import unit_text
from sma_bayes.studies.paper.schema import (
    ErratumEntry,
    ImpliedCorrelations,
    PaperTablesDocument,
    PrintedEntry,
    PrintedTableDocument,
    RecomputedAmount,
)

SOURCE: Final = (
    "Modified sigmoid based model and experimental analysis of shape memory alloy spring as variable stiffness "
    "actuator, Smart Structures and Systems (2019), as printed in the supplied text"
)

Row = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Sheet:
    """Rows with the same columns, as they go into one file.

    Attributes
    ----------
    name, title : str
    rows : tuple of dict
        Column name to text, number or None.
    """

    name: str
    title: str
    rows: tuple[Row, ...]


@dataclass(frozen=True, slots=True)
class Selection:
    """What is exported."""

    tables: tuple[PrintedTable, ...]
    errata: tuple[Erratum, ...]


def select(table: int | None = None, *, errata_only: bool = False) -> Selection:
    """Choose what to export.

    Parameters
    ----------
    table : int, optional
        One table and the errata that touch it; 0 is the running text. All by default.
    errata_only : bool
        Leave the tables out.

    Raises
    ------
    UnknownNameError
        If there is no such table.
    """
    tables = PRINTED_TABLES if table is None else (printed_table(table),)
    chosen = tuple(e for e in errata() if table is None or table in e.tables)
    return Selection(() if errata_only else tables, chosen)


def printed_entry(table: PrintedTable, cell: PrintedCell) -> PrintedEntry:
    """One printed cell: where it stands, what is printed, whether it can be believed."""
    return PrintedEntry.about(
        cell,
        table=table.number,
        branch="" if cell.branch is None else cell.branch.value,
        printed=cell.entry or cell.printed,
        published=None if cell.status is CellStatus.DAMAGED else cell.value,
        status=cell.status.value,
        corrected=cell.reconstructed,
        errata=" ".join(_doubts().get(address(table, cell), ())),
    )


@cache
def _doubts() -> dict[str, tuple[str, ...]]:
    """Ids of the errata that cast doubt on a cell, by its address."""
    found: dict[str, tuple[str, ...]] = {}
    for erratum in errata():
        for table, cell in erratum.doubted():
            place = address(table, cell)
            found[place] = (*found.get(place, ()), erratum.id)
    return found


def erratum_entry(erratum: Erratum) -> ErratumEntry:
    """One erratum, with what it amounts to."""
    return ErratumEntry.about(
        erratum,
        confidence=erratum.confidence.value,
        cells=tuple(address(table, cell) for table, cell in erratum.doubted()),
        effect=tuple(
            RecomputedAmount.about(a, what=a.name, claimed=a.claimed or None) for a in erratum.effect()
        ),
    )


def sheets(selection: Selection) -> tuple[Sheet, ...]:
    """Sheets of a selection: one a table, then the errata and their recomputed effects."""
    found = [*_table_sheets(selection), *_correlation_sheets(selection)]
    entries = [erratum_entry(e) for e in selection.errata]
    effects = tuple({"id": e.id, **a.as_json()} for e in entries for a in e.effect)
    if entries:
        found.append(Sheet("errata", "Errata", tuple(_erratum_row(e) for e in entries)))
    if effects:
        found.append(Sheet("effects", "Effects of the errata, recomputed", effects))
    return tuple(found)


def _erratum_row(entry: ErratumEntry) -> Row:
    """An erratum in one row: lists with blanks between, without what it amounts to."""
    stated = entry.as_json()
    del stated["effect"]
    return {k: " ".join(map(str, v)) if isinstance(v, list) else v for k, v in stated.items()}


def _table_sheets(selection: Selection) -> list[Sheet]:
    return [
        Sheet(
            f"table-{table.number}",
            f"Table {table.number}: {table.title}" if table.number else table.title.capitalize(),
            tuple(printed_entry(table, cell).as_json() for cell in table.cells),
        )
        for table in selection.tables
    ]


def _implied(selection: Selection) -> tuple[ImpliedCorrelationRow, ...]:
    numbers = {table.number for table in selection.tables}
    return tuple(c for c in implied_correlations() if c.table in numbers)


def _correlation_sheets(selection: Selection) -> list[Sheet]:
    rows = _implied(selection)
    if not rows:
        return []
    mean = implied_average()
    title = (
        f"Correlation factors that Tables 6 to 8 imply at least: the {mean.columns} columns that can be read average "
        f"{mean.plain:.4f} (Fisher {mean.fisher:.4f}), the text claims {mean.claimed:g}"
    )
    return [Sheet("correlation", title, tuple(r.as_json() for r in rows))]


def tables_document(selection: Selection) -> PaperTablesDocument:
    """What a selection holds."""
    return PaperTablesDocument(
        schema="sma-bayes/paper/1",
        source=SOURCE,
        tables=tuple(
            PrintedTableDocument(
                number=t.number, title=t.title, cells=tuple(printed_entry(t, c) for c in t.cells)
            )
            for t in selection.tables
        ),
        implied_correlation=ImpliedCorrelations(columns=_implied(selection), average=implied_average()),
        errata=tuple(erratum_entry(e) for e in selection.errata),
    )


def _number(value: object) -> str:
    """Five digits for people; files for machines hold all of them."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def _shown(row: Row) -> list[str]:
    """Cells of a row for people."""
    return [_unit(value) if name == "unit" else _number(value) for name, value in row.items()]


def _unit(unit: str) -> str:
    return unit_text(unit.replace("delta_degC", "degC"))


def _csv(sheet: Sheet) -> str:
    out = StringIO()
    writer = csv.DictWriter(out, fieldnames=list(sheet.rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(sheet.rows)
    return out.getvalue()


def _text(sheet: Sheet) -> str:
    from rich.console import Console
    from rich.table import Table

    out = StringIO()
    shown = Table(*sheet.rows[0], title=sheet.title, title_justify="left")
    for row in sheet.rows:
        shown.add_row(*(cell.replace("[", r"\[") for cell in _shown(row)))
    Console(file=out, width=200).print(shown)
    return out.getvalue()


_WIDE: Final = frozenset({"reason", "problem", "correction", "cells", "what"})
"""Columns of sentences, which LaTeX must wrap."""


def _latex(sheet: Sheet) -> str:
    names = list(sheet.rows[0])
    alignment = [wrapped("0.17") if name in _WIDE else "l" for name in names]
    rows = (tex_row(_shown(row)) for row in sheet.rows)
    return longtable(f"paper-{sheet.name}", sheet.title, names, alignment, rows)


def pipes(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "".join("| " + " | ".join(c.replace("|", r"\|") for c in line) + " |\n" for line in lines)


def _pipes(rows: Sequence[Row]) -> str:
    return pipes(list(rows[0]), map(_shown, rows))


_FORMATS: Final[Mapping[str, tuple[str, Callable[[Sheet], str]]]] = MappingProxyType(
    {
        "text": ("txt", _text),
        "csv": ("csv", _csv),
        "latex": ("tex", _latex),
    }
)
"""Ending and renderer of the formats that go sheet by sheet."""

FORMATS: Final = (*_FORMATS, "markdown", "json")
"""Formats that `render` and `write` know."""


def texts(selection: Selection, form: str) -> dict[str, str]:
    """Text of each file of an export, by its name.

    Raises
    ------
    UnknownNameError
        If the format is not known.
    """
    require_known(form, FORMATS, f"there is no format {form!r}")
    if form == "json":
        return {
            "paper.json": json.dumps(tables_document(selection).as_json(), indent=1, ensure_ascii=False)
            + "\n"
        }
    if form == "markdown":
        whole = [*_table_sheets(selection), *_correlation_sheets(selection)]
        pages = {f"{s.name}.md": f"## {s.title}\n\n{_pipes(s.rows)}" for s in whole}
        return pages | ({"errata.md": errata_page(selection.errata)} if selection.errata else {})
    ending, one = _FORMATS[form]
    return {f"{sheet.name}.{ending}": one(sheet) for sheet in sheets(selection)}


def render(selection: Selection, form: str = "text") -> str:
    """A selection as one text.

    Parameters
    ----------
    selection : Selection
    form : str
        One of `FORMATS`. Sheets follow each other with an empty line between; the errata in Markdown are the page
        that the documentation shows.

    Raises
    ------
    UnknownNameError
        If the format is not known.
    """
    return "\n".join(texts(selection, form).values())


def write(selection: Selection, folder: Path, form: str = "csv") -> tuple[Path, ...]:
    """Write a selection into a folder: one file a sheet, for JSON one file in all.

    Parameters
    ----------
    selection : Selection
    folder : Path
        Made where it is missing; files of the same names are replaced.
    form : str
        One of `FORMATS`.

    Returns
    -------
    tuple of Path
        The files.

    Raises
    ------
    UnknownNameError
        If the format is not known.
    OutputError
        If a file can't be written.
    """
    named = texts(selection, form)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in named.items():
            (folder / name).write_text(text, encoding="utf-8", newline="\n")
    except OSError as error:
        raise OutputError(
            f"can't be written: {error.strerror}", file=folder, remedy="choose another folder with --out"
        ) from error
    return tuple(folder / name for name in named)


_PREFACE: Final = """# Errata of the paper

What can't be taken as printed in "Modified sigmoid based model and experimental analysis of shape memory alloy
spring as variable stiffness actuator", Smart Structures and Systems (2019). Lines are those of the plain text
from which the tables were read; the printed page may differ from that text. Table 0 is the running text.

`E01` to `E49` are those of a list of errata that goes with the text, `N..` were found beyond it. Each number below
is recomputed from the printed tables and equations; where the list states a number, it stands beside as
*claimed*, and *agrees* says whether the recomputed one rounds to it. Confidence: *certain* follows from the
printed numbers or equations alone, *likely* needs one outside fact or one reading of an ambiguous sentence,
*possible* has another explanation that is about as good.

This page is written by `sma-bayes paper --errata --format markdown`.
"""


def errata_page(chosen: Sequence[Erratum]) -> str:
    """Page of the documentation: a section for each erratum, what did not reproduce first."""
    entries = [erratum_entry(e) for e in chosen]
    differing = [(e.id, a) for e in entries for a in e.effect if a.agrees is False]
    parts = [_PREFACE]
    if differing:
        rows = [
            {"id": i, "what": a.what, "value": a.value, "unit": a.unit, "claimed": a.claimed}
            for i, a in differing
        ]
        parts.append("## Claims that do not reproduce as stated\n\n" + _pipes(rows))
    parts += [_section(e) for e in entries]
    return "\n".join(parts)


def _section(erratum: ErratumEntry) -> str:
    where = ", ".join(map(str, erratum.lines))
    tables = ", ".join(map(str, erratum.tables)) or "none"
    effect = (
        _pipes([a.as_json() for a in erratum.effect])
        if erratum.effect
        else "A note: no number to recompute.\n"
    )
    return (
        f"## {erratum.id}\n\n"
        f"Lines {where}; tables {tables}; {erratum.confidence}.\n\n"
        f"- Printed: {erratum.printed}\n- Problem: {erratum.problem}\n- Instead: {erratum.correction}\n\n{effect}"
    )
