"""The registry of errata: what can't be taken as printed, why, what was meant, and what it amounts to.

The words stand in ``errata.toml`` beside this file; the numbers are recomputed by `sma_bayes.paper.effects` each
time that they are asked for. Nothing here changes a printed value.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from fnmatch import fnmatchcase
from functools import cache
from importlib.resources import files
from typing import Any, Final

from sma_bayes.errors import UnknownNameError
from sma_bayes.paper.effects import EFFECTS, Amount
from sma_bayes.paper.extremes import EXTREME_TABLES
from sma_bayes.paper.specifications import TABLE_1, TABLE_2, TEXT_VALUES
from sma_bayes.paper.tables import PARAMETER_TABLES, STATISTICS_TABLES, PrintedCell, PrintedTable, address_of

PRINTED_TABLES: Final[tuple[PrintedTable, ...]] = (
    TABLE_1,
    TABLE_2,
    *PARAMETER_TABLES,
    *STATISTICS_TABLES,
    *EXTREME_TABLES,
    TEXT_VALUES,
)
"""Tables 1 to 12, and as number 0 what the running text prints."""


class Confidence(StrEnum):
    """How sure the problem is."""

    CERTAIN = "certain"
    """Follows from the printed numbers or equations alone."""
    LIKELY = "likely"
    """Needs one fact from elsewhere, or one reading of an ambiguous sentence."""
    POSSIBLE = "possible"
    """Another explanation is about as good."""


@dataclass(frozen=True, slots=True)
class Erratum:
    """One thing that can't be taken as printed.

    Attributes
    ----------
    id : str
        ``E01`` to ``E49`` as in the list of errata that goes with the text; ``N..`` found beyond it.
    lines : tuple of int
        Lines of the source text, counted from 1.
    printed, problem, correction : str
        What is printed, what is wrong with it, what to use instead.
    confidence : Confidence
    tables : tuple of int
        Tables that it touches; 0 is the running text.
    cells : tuple of str
        Addresses of the cells that it casts doubt on, as `address` writes them; ``*`` stands for anything.
    note_only : bool
        True where there is no number to recompute.
    """

    id: str
    lines: tuple[int, ...]
    printed: str
    problem: str
    correction: str
    confidence: Confidence
    tables: tuple[int, ...]
    cells: tuple[str, ...] = ()
    note_only: bool = False

    def __post_init__(self) -> None:
        if self.note_only == (self.id in EFFECTS):
            raise ValueError(f"{self.id} must either be a note or have an effect")

    def effect(self) -> tuple[Amount, ...]:
        """What it amounts to, recomputed; empty for a note."""
        return () if self.note_only else EFFECTS[self.id]()

    def doubted(self) -> tuple[tuple[PrintedTable, PrintedCell], ...]:
        """The printed cells that it casts doubt on, each with its table."""
        return tuple(
            (table, cell)
            for table in PRINTED_TABLES
            for cell in table.cells
            if any(fnmatchcase(address(table, cell), pattern) for pattern in self.cells)
        )


def address(table: PrintedTable, cell: PrintedCell) -> str:
    """Address of a cell: ``table/condition/branch/quantity``, with a dash for what it has not.

    Examples
    --------
    >>> address(TABLE_1, TABLE_1.cells[1])
    '1/-/-/resistivity'
    """
    return address_of(table.number, cell.condition, cell.branch, cell.quantity)


def printed_table(number: int) -> PrintedTable:
    """One printed table.

    Raises
    ------
    UnknownNameError
        If there is no table of that number.
    """
    for table in PRINTED_TABLES:
        if table.number == number:
            return table
    raise UnknownNameError(f"there is no table {number}", expected="1 to 12, or 0 for the running text")


@cache
def errata() -> tuple[Erratum, ...]:
    """All errata in the order of their ids.

    Examples
    --------
    >>> len([e for e in errata() if e.id.startswith("E")])
    49
    """
    text = files("sma_bayes.paper").joinpath("errata.toml").read_text(encoding="utf-8")
    return tuple(_read(entry) for entry in tomllib.loads(text)["erratum"])


def _read(entry: Mapping[str, Any]) -> Erratum:
    tuples = {name: tuple(entry.get(name, ())) for name in ("lines", "tables", "cells")}
    return Erratum(**{**entry, **tuples, "confidence": Confidence(entry["confidence"])})
