"""How much of what a user gives is taken on: sizes, nesting, lengths. What exceeds a limit is refused in one message.

The table of docs/reference/limits.md is this one. Limits keep a slip, or somebody who means harm, from minutes and
gigabytes; no measurement that is known comes near one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Limit:
    """A limit.

    Attributes
    ----------
    value : int or float
        Largest that is accepted.
    of : str
        What it limits, for people, with its unit.
    """

    value: float
    of: str


DECLARED_BYTES: Final = Limit(2_000_000, "bytes of a campaign, priors or study file")
DECLARED_DEPTH: Final = Limit(12, "tables and lists inside each other, and parts of a dotted key")
TEXT_CHARACTERS: Final = Limit(4_000, "characters of a text in such a file, names of files included")
INTEGER: Final = Limit(2**63 - 1, "the value of a whole number, either sign")
SEED: Final = Limit(2**63 - 1, "a seed")
UNIT_CHARACTERS: Final = Limit(100, "characters of a unit")
UNIT_NESTING: Final = Limit(8, "brackets inside each other in a unit")
UNIT_EXPONENT: Final = Limit(99, "an exponent in a unit; only a name or a bracket has one")
ID_CHARACTERS: Final = Limit(80, "characters of the id of a condition")
ID_BYTES: Final = Limit(120, "bytes of that id in UTF-8, because it names files")
MAGNITUDE: Final = Limit(
    1e50,
    "the magnitude of a measured value in its canonical unit, of a declared standard deviation, and of a number of a "
    "prior",
)
SETTING: Final = Limit(1e9, "a setting of the rig (current, load, frequency) in the unit of its key")
DEGREES: Final = Limit(
    1e6,
    "a difference of temperature: how far to extrapolate, how far a setting is off, the error of a reading",
)
SCATTER: Final = Limit(100.0, "the scatter between conditions, as a share of the curve")
WORKBOOK_BYTES: Final = Limit(256_000_000, "bytes of an Excel workbook when unpacked")
WORKBOOK_ROWS: Final = Limit(1_048_576, "rows of a sheet, as Excel has it")
WORKBOOK_CELLS: Final = Limit(10_000_000, "cells of a sheet, empty ones up to the last included")
MATLAB_BYTES: Final = Limit(256_000_000, "bytes of a MATLAB file when unpacked")
BINARY_NUMBERS: Final = Limit(30_000_000, "numbers in a MATLAB or TDMS file")
PROFILE_ROWS: Final = Limit(100_000, "rows of a profile of the current")
PROFILE_TIME: Final = Limit(20_000, "its length in time constants of the heat balance")
REPLICATES: Final = Limit(100_000, "replicates of a self-check")
DOCUMENT_BYTES: Final = Limit(500_000_000, "bytes of a JSON document of an output folder")

LIMITS: Final = tuple(value for value in list(globals().values()) if isinstance(value, Limit))
"""All of them, in order."""
