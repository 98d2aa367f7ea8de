"""Published tables, cell by cell: what is printed, on which line, and whether it can be believed.

Reference: "Modified sigmoid based model and experimental analysis of shape memory alloy spring as variable
stiffness actuator", Smart Structures and Systems (2019). Lines are those of the plain text from which the
numbers were read; the printed page may differ from that text.

A printed value is never edited. Where other cells of the table say what it should have been, that value
stands beside it as `PrintedCell.reconstructed`, and nothing uses it unless it is asked for by that name.

The tables print no units for the parameters. Force in N and displacement in cm are inferred: with them
Eq. (7) gives N/cm, and a hundredfold the 15 to 190 N/m of Tables 9 and 10. The unit of temperature can't be
recovered (the largest B3 is 4.1 where Tables 9 to 12 print up to 159 °C), so it is ``arbitrary``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import Final

from sma_bayes.errors import UnknownNameError
from sma_bayes.quantities import ARBITRARY, STANDARD_GRAVITY, per
from sma_bayes.records.types import Branch, Condition

HEATING, COOLING = Branch.HEATING, Branch.COOLING

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
    """One printed table.

    Attributes
    ----------
    number : int
    title : str
    cells : tuple of PrintedCell
    """

    number: int
    title: str
    cells: tuple[PrintedCell, ...]

    def select(self, condition: str, branch: Branch | None) -> dict[str, PrintedCell]:
        """Cells of one condition and branch, by quantity.

        Raises
        ------
        UnknownNameError
            If the table has no such condition and branch.
        """
        found = {c.quantity: c for c in self.cells if (c.condition, c.branch) == (condition, branch)}
        if not found:
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


@dataclass(frozen=True, slots=True)
class _Doubt:
    status: CellStatus
    reason: str
    reconstructed: float | None = None


_Place = tuple[str, Branch, str]  # condition, branch, quantity

_NEARLY_A_STEP = _Doubt(
    CellStatus.IMPLAUSIBLE,
    "more than twice the next largest rate of Tables 3 to 5 and 5 times that of heating at the same current; "
    "Eq. (7) then stays below 0.97 N/cm at every temperature, where Table 9 (line 394) prints a maximum of "
    "146.54 N/m for 1 A",
)
_LOST_COLUMN = _Doubt(
    CellStatus.DAMAGED,
    "columns 4 to 6 of this table repeat headings and values of columns 1 to 3; the values of this "
    "condition and branch are lost",
)
_FACTOR_TEN = _Doubt(
    CellStatus.RECONSTRUCTED,
    "SSE/RMSE**2 = 189 residual degrees of freedom, where R2 and adjusted R2 of this column allow 15 to 23 "
    "for 6 parameters; with the decimal point moved one place it is 19",
    0.0058,
)


def _adjusted(reason: str, expected: float) -> _Doubt:
    return _Doubt(
        CellStatus.IMPLAUSIBLE, f"{reason}; R2, SSE and RMSE of its column give {expected:.4f}", expected
    )


_DOUBTS: Final[Mapping[_Place, _Doubt]] = MappingProxyType(
    {
        ("1A-10mHz", COOLING, "A2"): _NEARLY_A_STEP,
        ("1A-10mHz", COOLING, "B2"): _NEARLY_A_STEP,
        ("1A-10mHz", HEATING, "adj_r2"): _adjusted(
            "too far below R2: it needs over 400 parameters at 85 residual degrees of freedom", 0.9979
        ),
        ("1A-10mHz", COOLING, "adj_r2"): _adjusted(
            "too near R2: it allows at most 4 parameters, and Eq. (7) has 6", 0.9971
        ),
        ("2A-10mHz-table3", COOLING, "adj_r2"): _adjusted("greater than R2, which is impossible", 0.9976),
        ("150g-10mHz", HEATING, "sse"): _FACTOR_TEN,
        **{
            (condition, branch, statistic): _LOST_COLUMN
            for condition, branch in (
                ("150g-10mHz", COOLING),
                ("200g-10mHz", HEATING),
                ("200g-10mHz", COOLING),
                ("2A-30mHz", COOLING),
                ("2A-50mHz", HEATING),
                ("2A-50mHz", COOLING),
            )
            for statistic in STATISTIC_UNITS
        },
    }
)


def _cell(quantity: str, unit: str, printed: str, line: int, condition: str, branch: Branch) -> PrintedCell:
    doubt = _DOUBTS.get((condition, branch, quantity))
    if doubt is None:
        return PrintedCell(quantity, unit, printed, line, condition, branch)
    return PrintedCell(
        quantity, unit, printed, line, condition, branch, doubt.status, doubt.reason, doubt.reconstructed
    )


def _parameter_table(number: int, title: str, rows: Iterable[tuple[int, str, Branch, str]]) -> PrintedTable:
    """Read rows of (line, condition, branch, printed A1 A2 A3 B1 B2 B3)."""
    cells = tuple(
        _cell(name, unit, printed, line, condition, branch)
        for line, condition, branch, text in rows
        for (name, unit), printed in zip(PARAMETER_UNITS.items(), text.split(), strict=True)
    )
    return PrintedTable(number, title, cells)


def _statistics_table(
    number: int, title: str, conditions: tuple[str, str, str], rows: Iterable[tuple[int, str]]
) -> PrintedTable:
    """Read rows of (line, six printed values): heating and cooling of each condition, by position.

    Position decides, since the column headings are damaged: Table 6 heads its columns "1.0", nothing, "1",
    "1.5", nothing, "2.0"; Tables 7 and 8 heading, cooling, heating twice over.
    """
    columns = [(condition, branch) for condition in conditions for branch in (HEATING, COOLING)]
    cells = tuple(
        _cell(statistic, unit, printed, line, condition, branch)
        for (statistic, unit), (line, text) in zip(STATISTIC_UNITS.items(), rows, strict=True)
        for (condition, branch), printed in zip(columns, text.split(), strict=True)
    )
    return PrintedTable(number, title, cells)


TABLE_3: Final = _parameter_table(
    3,
    "parameters by heating current, 10 mHz",
    (
        (225, "1A-10mHz", HEATING, "0.7226 4.5500 2.0000 0.5411 4.769 2.5380"),
        (226, "1.5A-10mHz", HEATING, "0.7870 2.4730 2.4900 0.6307 2.6761 3.0040"),
        (227, "2A-10mHz-table3", HEATING, "0.9778 1.1350 2.7540 1.0730 1.0940 3.7330"),
        (229, "1A-10mHz", COOLING, "0.6515 23.2500 2.7090 0.5031 23.7700 2.7210"),
        (230, "1.5A-10mHz", COOLING, "1.2250 1.8290 2.0730 0.9400 2.0660 2.5280"),
        (231, "2A-10mHz-table3", COOLING, "0.4069 2.6930 2.2230 0.4126 2.4880 2.6490"),
    ),
)

TABLE_4: Final = _parameter_table(
    4,
    "parameters by load, 10 mHz",
    (
        (238, "100g-10mHz", HEATING, "0.6590 3.0290 3.390 0.5196 3.2510 3.5260"),
        (239, "150g-10mHz", HEATING, "0.7096 2.1240 3.1430 0.6893 2.2130 3.5590"),
        (240, "200g-10mHz", HEATING, "0.3156 2.0740 2.5720 0.3409 1.9810 3.1600"),
        (242, "100g-10mHz", COOLING, "0.9557 2.0950 3.4870 0.7279 2.2940 3.6950"),
        (243, "150g-10mHz", COOLING, "1.3810 1.4950 3.5890 1.3070 1.5740 4.1420"),
        (244, "200g-10mHz", COOLING, "0.6976 1.8010 3.0450 0.7277 1.8040 3.6190"),
    ),
)

TABLE_5: Final = _parameter_table(
    5,
    "parameters by frequency, 2 A",
    (
        (259, "2A-10mHz-table5", HEATING, "0.4415 2.9600 2.7100 0.3995 3.0550 2.9520"),
        (260, "2A-30mHz", HEATING, "0.4187 10.0800 3.0550 0.4096 10.4900 3.0920"),
        (261, "2A-50mHz", HEATING, "0.2222 5.7580 2.2850 0.2107 5.8630 2.4340"),
        (263, "2A-10mHz-table5", COOLING, "0.8171 1.2270 2.9350 0.7851 1.2280 3.7020"),
        (264, "2A-30mHz", COOLING, "0.3599 2.1780 2.7650 0.3578 2.2530 3.1750"),
        (265, "2A-50mHz", COOLING, "1.4930 2.9890 2.5090 1.4170 3.2350 2.7540"),
    ),
)

TABLE_6: Final = _statistics_table(
    6,
    "quality of the fits of Table 3",
    ("1A-10mHz", "1.5A-10mHz", "2A-10mHz-table3"),
    (
        (273, "0.0536 0.0087 0.0118 0.0159 0.0059 0.0073"),
        (274, "0.9980 0.9973 0.9980 0.9987 0.9980 0.9978"),
        (275, "0.0251 0.0103 0.0133 0.0114 0.0164 0.0108"),
        (276, "0.9880 0.9973 0.9979 0.9986 0.9976 0.9986"),
    ),
)

TABLE_7: Final = _statistics_table(
    7,
    "quality of the fits of Table 4",
    ("100g-10mHz", "150g-10mHz", "200g-10mHz"),
    (
        (298, "0.0016 0.0023 0.0580 0.0016 0.0023 0.0580"),
        (299, "0.9992 0.9989 0.9982 0.9992 0.9989 0.9982"),
        (300, "0.0089 0.0095 0.0175 0.0089 0.0095 0.0175"),
        (301, "0.9990 0.9987 0.9977 0.9990 0.9987 0.9977"),
    ),
)

TABLE_8: Final = _statistics_table(
    8,
    "quality of the fits of Table 5",
    ("2A-10mHz-table5", "2A-30mHz", "2A-50mHz"),
    (
        (307, "0.0067 0.0041 0.0218 0.0067 0.0041 0.0218"),
        (308, "0.9986 0.9981 0.9950 0.9986 0.9981 0.9950"),
        (309, "0.0138 0.0065 0.0289 0.0138 0.0065 0.0289"),
        (310, "0.9984 0.9980 0.9940 0.9984 0.9980 0.9940"),
    ),
)

PARAMETER_TABLES: Final = (TABLE_3, TABLE_4, TABLE_5)
"""Printed parameters."""

STATISTICS_TABLES: Final = (TABLE_6, TABLE_7, TABLE_8)
"""Printed quality of the fits, each table of the parameter table in the same place."""
