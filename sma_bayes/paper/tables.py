"""Published tables, cell by cell: what is printed, on which line, and whether it can be believed.

Reference: "Modified sigmoid based model and experimental analysis of shape memory alloy spring as variable
stiffness actuator", Smart Structures and Systems (2019). Lines are those of the plain text from which the
numbers were read; the printed page may differ from that text.

The tables stand in ``printed.toml`` beside this file. A printed value is never edited. Where other cells of the table
say what it should have been, that value stands beside it as `PrintedCell.reconstructed`, and nothing uses it unless it
is asked for by that name.

The tables print no units for the parameters. Force in N and displacement in cm are inferred: with them
Eq. (7) gives N/cm, and a hundredfold the 15 to 190 N/m of Tables 9 and 10. The unit of temperature can't be
recovered (the largest B3 is 4.1 where Tables 9 to 12 print up to 159 °C), so it is ``arbitrary``.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cache
from importlib.resources import files
from types import MappingProxyType
from typing import Any, Final

from sma_bayes.errors import UnknownNameError
from sma_bayes.quantities import ARBITRARY, STANDARD_GRAVITY, per
from sma_bayes.records.types import Branch, Condition

PARAMETER_UNITS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "A1": "cm",
        "A2": per(ARBITRARY),
        "A3": ARBITRARY,
        "B1": "N",
        "B2": per(ARBITRARY),
        "B3": ARBITRARY,
    }
)
"""Parameters of Tables 3 to 5 in the order of their columns, with inferred units."""

STATISTIC_UNITS: Final[Mapping[str, str]] = MappingProxyType(
    {"sse": "N**2/cm**2", "r2": "1", "rmse": "N/cm", "adj_r2": "1"}
)
"""Statistics of Tables 6 to 8 in the order of their rows, with inferred units."""


class CellStatus(StrEnum):
    """Whether a printed value can be believed."""

    OK = "ok"
    """Agrees with every printed value against which it can be checked."""
    DAMAGED = "damaged"
    """Is not there: the text holds something else in its place, such as a copy of another column."""
    IMPLAUSIBLE = "implausible"
    """Contradicts other printed values, and no single slip explains it."""
    RECONSTRUCTED = "reconstructed"
    """Contradicts other printed values; one slip explains it, so the value that was meant can be named."""


@dataclass(frozen=True, slots=True)
class PrintedCell:
    """One printed value.

    Attributes
    ----------
    quantity : str
        What it is a value of: ``"A1"``, ``"rmse"``.
    unit : str
        Its unit, inferred where none is printed.
    printed : str
        The digits as printed, trailing zeros included.
    line : int
        Line of the source text, counted from 1.
    condition : str
        Id of the condition; empty where the value belongs to none.
    branch : Branch or None
        None where the value belongs to both branches.
    status : CellStatus
    reason : str
        Why the value is doubted; empty where it is not.
    reconstructed : float or None
        What other cells say that it should have been [unit].
    power : int
        Power of ten that is printed beside the digits.
    entry : str
        The whole entry as it stands in the text, where that is more than the digits: Tables 1 and 2 print
        units, signs and symbols in it.
    """

    quantity: str
    unit: str
    printed: str
    line: int
    condition: str = ""
    branch: Branch | None = None
    status: CellStatus = CellStatus.OK
    reason: str = ""
    reconstructed: float | None = None
    power: int = 0
    entry: str = ""

    def __post_init__(self) -> None:
        doubted = self.status is not CellStatus.OK
        if doubted != bool(self.reason):
            raise ValueError(
                f"{self.quantity} on line {self.line}: a reason belongs to every doubt, and only there"
            )
        if (self.status is CellStatus.RECONSTRUCTED) and self.reconstructed is None:
            raise ValueError(f"{self.quantity} on line {self.line}: a reconstructed cell needs the value")
        if self.status in (CellStatus.OK, CellStatus.DAMAGED) and self.reconstructed is not None:
            raise ValueError(f"{self.quantity} on line {self.line}: nothing to reconstruct from, or no need")

    @property
    def value(self) -> float:
        """The printed number [unit], whatever its status."""
        return float(f"{self.printed}e{self.power}")

    @property
    def sound(self) -> bool:
        """True where the printed number can be used."""
        return self.status is CellStatus.OK

    @property
    def resolution(self) -> float:
        """One unit of the last printed digit [unit]."""
        _, _, decimals = self.printed.partition(".")
        return float(10.0 ** (self.power - len(decimals)))


@dataclass(frozen=True, slots=True)
class PrintedTable:
    """One printed table."""

    number: int
    title: str
    cells: tuple[PrintedCell, ...]

    def columns(self) -> dict[tuple[str, Branch | None], dict[str, PrintedCell]]:
        """Cells of each condition and branch, by quantity."""
        found: dict[tuple[str, Branch | None], dict[str, PrintedCell]] = {}
        for c in self.cells:
            found.setdefault((c.condition, c.branch), {})[c.quantity] = c
        return found

    def select(self, condition: str, branch: Branch | None) -> dict[str, PrintedCell]:
        """Cells of one condition and branch, by quantity.

        Raises
        ------
        UnknownNameError
            If the table has no such condition and branch.
        """
        found = self.columns().get((condition, branch))
        if found is None:
            known = sorted({c.condition for c in self.cells})
            raise UnknownNameError(
                f"table {self.number} has no {condition!r}, {branch}", expected=", ".join(known)
            )
        return found


CONDITIONS: Final[Mapping[str, Condition]] = MappingProxyType(
    {
        c.id: c
        for c in (
            Condition("1A-10mHz", current=1.0, frequency=0.010),
            Condition("1.5A-10mHz", current=1.5, frequency=0.010),
            Condition("2A-10mHz-table3", current=2.0, frequency=0.010),
            Condition("100g-10mHz", load=0.100 * STANDARD_GRAVITY, frequency=0.010),
            Condition("150g-10mHz", load=0.150 * STANDARD_GRAVITY, frequency=0.010),
            Condition("200g-10mHz", load=0.200 * STANDARD_GRAVITY, frequency=0.010),
            Condition("2A-10mHz-table5", current=2.0, frequency=0.010),
            Condition("2A-30mHz", current=2.0, frequency=0.030),
            Condition("2A-50mHz", current=2.0, frequency=0.050),
        )
    }
)
"""Conditions of Tables 3 to 8. Tables 3 and 5 both print 2 A at 10 mHz, with parameters that differ two- to
threefold: two test runs, kept apart by name. Table 4 prints no current."""


@cache
def _printed() -> dict[str, Any]:
    """What ``printed.toml`` holds: each table, and doubts about their cells."""
    return tomllib.loads(files("sma_bayes.paper").joinpath("printed.toml").read_text(encoding="utf-8"))


@cache
def _doubts() -> dict[str, dict[str, Any]]:
    """What a cell that can't be believed has beside its digits, by its address."""
    return {
        cell: {
            "status": CellStatus(doubt["status"]),
            "reason": doubt["reason"],
            "reconstructed": doubt.get("reconstructed"),
        }
        for doubt in _printed()["doubt"]
        for cell in doubt["cells"]
    }


def address_of(number: int, condition: str, branch: Branch | None, quantity: str) -> str:
    """Address of a cell: ``table/condition/branch/quantity``, with a dash for what it has not.

    Examples
    --------
    >>> address_of(1, "", None, "resistivity")
    '1/-/-/resistivity'
    """
    return f"{number}/{condition or '-'}/{'-' if branch is None else branch.value}/{quantity}"


def read_table(number: int, cells: Callable[[Mapping[str, Any]], Iterable[PrintedCell]]) -> PrintedTable:
    """A table of ``printed.toml``, with what is doubted of its cells.

    Parameters
    ----------
    number : int
    cells : callable
        Makes cells of the table as parsed, in the form that its rows have.
    """
    (found,) = (t for t in _printed()["table"] if t["number"] == number)
    doubts = _doubts()
    return PrintedTable(
        number,
        found["title"],
        tuple(
            replace(c, **doubts.get(address_of(number, c.condition, c.branch, c.quantity), {}))
            for c in cells(found)
        ),
    )


def _parameters(found: Mapping[str, Any]) -> Iterator[PrintedCell]:
    """Rows of line, condition, branch, and printed A1 A2 A3 B1 B2 B3."""
    for line, condition, branch, text in found["rows"]:
        for (name, unit), printed in zip(PARAMETER_UNITS.items(), text.split(), strict=True):
            yield PrintedCell(name, unit, printed, line, condition, Branch(branch))


def _statistics(found: Mapping[str, Any]) -> Iterator[PrintedCell]:
    """Rows of line, statistic, and six printed values: heating and cooling of each condition, by position.

    Position decides, since the column headings are damaged: Table 6 heads its columns "1.0", nothing, "1",
    "1.5", nothing, "2.0"; Tables 7 and 8 heading, cooling, heating twice over.
    """
    columns = [(condition, branch) for condition in found["conditions"] for branch in Branch]
    for line, statistic, text in found["rows"]:
        for (condition, branch), printed in zip(columns, text.split(), strict=True):
            yield PrintedCell(statistic, STATISTIC_UNITS[statistic], printed, line, condition, branch)


TABLE_3, TABLE_4, TABLE_5 = PARAMETER_TABLES = tuple(read_table(n, _parameters) for n in (3, 4, 5))
"""Printed parameters."""

TABLE_6, TABLE_7, TABLE_8 = STATISTICS_TABLES = tuple(read_table(n, _statistics) for n in (6, 7, 8))
"""Printed quality of the fits, each table of the parameter table in the same place."""
