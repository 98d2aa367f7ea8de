"""The current that heats, against time: a file whose columns are known by their names, or the columns themselves."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from sma_bayes.arrays import Floats
from sma_bayes.errors import CampaignError, MeasurementError, without_campaign
from sma_bayes.limits import DEGREES, PROFILE_ROWS, SETTING
from sma_bayes.quantities import QUANTITIES, convert
from sma_bayes.records.default_names import recognised
from sma_bayes.records.formats import read_table
from sma_bayes.records.formats.numbers import numbers
from sma_bayes.records.formats.table import RawTable, Reading
from sma_bayes.records.plausibility import ABSOLUTE_ZERO

Columns = Mapping[str, npt.ArrayLike]
NEEDED: Final = ("time", "current")
KNOWN: Final = (*NEEDED, "ambient_temperature")
IN_MEMORY: Final = "profile"
"""How messages call a profile that is in no file."""


@dataclass(frozen=True, slots=True, eq=False)
class CurrentProfile:
    """A current in time; each value holds until the next row.

    Attributes
    ----------
    name : str
        Of its file, or `IN_MEMORY`.
    time : ndarray, shape (n,)
        [s], rising from the start of the simulation; the last row is the end.
    current : ndarray, shape (n,)
        [A].
    ambient : ndarray, shape (n,), or None
        Temperature of the surroundings [degC], where the profile has it.
    ignored : tuple of str
        Columns that are of no use here.
    """

    name: str
    time: Floats
    current: Floats
    ambient: Floats | None
    ignored: tuple[str, ...] = ()

    @property
    def duration(self) -> float:
        """From the first row to the last [s]."""
        return float(self.time[-1] - self.time[0])

    @property
    def sha256(self) -> str:
        """Digest of what it holds."""
        digest = hashlib.sha256()
        for values in (self.time, self.current, self.ambient):
            digest.update(b"none" if values is None else np.ascontiguousarray(values).tobytes())
        return digest.hexdigest()

    def held(self, values: Floats, at: Floats) -> Floats:
        """What a column of the profile is at instants within it [that of the column]."""
        place = np.searchsorted(self.time, at, side="right") - 1
        return np.asarray(values[np.clip(place, 0, self.time.size - 1)])


@without_campaign()
def read_profile(source: str | Path | Columns) -> CurrentProfile:
    """Read a profile.

    Parameters
    ----------
    source : str, Path or mapping of str to array
        A file of any format that measurements may have, or its columns. Columns are known by their names, quantity and
        unit: ``time_s``, ``current_A`` and, if there is one, ``ambient_temperature_C``; any other unit may stand there.

    Raises
    ------
    CampaignError
        If a column is missing, or occurs twice.
    MeasurementError
        If the file or a value can't be used: no number, a gap, a time that is negative or does not rise, a current or
        temperature that can't be.
    """
    if isinstance(source, Mapping):
        return _profile(_in_memory(source), Path(IN_MEMORY))
    path = Path(source)
    return _profile(read_table(path, Reading()), path)


def _in_memory(columns: Columns) -> RawTable:
    values = [np.asarray(v, dtype=float) for v in columns.values()]
    if len({v.shape for v in values}) != 1 or any(v.ndim != 1 for v in values):
        raise MeasurementError(
            f"columns of the shapes {', '.join(str(v.shape) for v in values) or 'of none'}",
            file=IN_MEMORY,
            expected="columns of one length, such as {'time_s': [0, 60], 'current_A': [1.2, 0]}",
        )
    return RawTable(tuple(columns), tuple(values), np.arange(1, values[0].size + 1))


def _profile(table: RawTable, path: Path) -> CurrentProfile:
    places, ignored = _places(table, path)
    found = {quantity: _values(table, i, quantity, unit, path) for quantity, (i, unit) in places.items()}
    if table.row.size < 2:
        raise MeasurementError(
            "a single row",
            file=path,
            row=int(table.row[0]),
            expected="at least two: each current holds until the next row, and the last one is the end",
        )
    if table.row.size > PROFILE_ROWS.value:
        raise MeasurementError(
            f"{table.row.size} rows",
            file=path,
            expected=f"at most {PROFILE_ROWS.value:g}",
            remedy="thin it out",
        )
    names = {quantity: table.shown_names[i] for quantity, (i, _) in places.items()}
    _require_rising(found["time"], table, path, names["time"])
    _require_possible(found, table, path, names)
    return CurrentProfile(
        path.name, found["time"], found["current"], found.get("ambient_temperature"), ignored
    )


def _places(table: RawTable, path: Path) -> tuple[dict[str, tuple[int, str]], tuple[str, ...]]:
    """Place and unit of each quantity, and the names of all other columns."""
    places: dict[str, tuple[int, str]] = {}
    ignored = []
    for i, header in enumerate(table.names or ()):
        known = recognised(header)
        if known is None or known[0] not in KNOWN:
            ignored.append(header)
            continue
        quantity, unit = known
        if quantity in places:
            raise CampaignError(
                f"the columns {table.shown_names[places[quantity][0]]!r} and {header!r} are both a {quantity}",
                file=path,
                expected=f"one {quantity}",
                remedy="rename or remove one of them",
            )
        places[quantity] = (i, unit)
    lacking = [quantity for quantity in NEEDED if quantity not in places]
    if lacking:
        there = (
            ", ".join(map(repr, table.names))
            if table.names
            else f"no header but {len(table.columns)} columns"
        )
        raise CampaignError(
            f"no {' and no '.join(lacking)} among the columns",
            file=path,
            expected=f"a header such as time_s,current_A, with any unit of time and current; the file has {there}",
            remedy="name the columns by quantity and unit",
        )
    return places, tuple(name for name in ignored if name)


def _values(table: RawTable, i: int, quantity: str, unit: str, path: Path) -> Floats:
    name, cells = table.shown_names[i], table.columns[i]
    row = table.row[: len(cells)]
    values, _ = numbers(cells, row, file=path, column=name, decimal=table.decimal or ".")
    missing = np.flatnonzero(~np.isfinite(values))
    short = len(cells) < table.row.size
    if missing.size or short:
        at = int(row[missing[0]]) if missing.size else int(table.row[len(cells)])
        raise MeasurementError(
            "no value",
            file=path,
            row=at,
            column=name,
            expected="a value in every row: what the current does in a gap can't be guessed",
            remedy="fill it in, or remove the row; each value holds until the next row",
        )
    return np.asarray(convert(values, unit, QUANTITIES[quantity].unit, what=quantity))


def _require_rising(time: Floats, table: RawTable, path: Path, column: str) -> None:
    negative = np.flatnonzero(time < 0.0)
    if negative.size:
        raise MeasurementError(
            f"the time {time[negative[0]]:g} s",
            file=path,
            row=int(table.row[negative[0]]),
            column=column,
            expected="times from 0 on",
            remedy="count time from the start of the simulation",
        )
    back = np.flatnonzero(np.diff(time) <= 0.0)
    if back.size:
        at = int(back[0]) + 1
        raise MeasurementError(
            f"the time {time[at]:g} s after {time[at - 1]:g} s",
            file=path,
            row=int(table.row[at]),
            column=column,
            expected="times that rise from row to row",
            remedy="sort the rows; a current that is switched takes one row, from which on it holds",
        )


def _require_possible(
    found: Mapping[str, Floats], table: RawTable, path: Path, names: Mapping[str, str]
) -> None:
    """Refuse what no rig does."""
    impossible: dict[str, tuple[NDArray[np.bool_], str]] = {
        "current": (np.abs(found["current"]) > SETTING.value, f"at most {SETTING.value:g} A"),
    }
    if "ambient_temperature" in found:
        room = found["ambient_temperature"]
        impossible["ambient_temperature"] = (
            (room < ABSOLUTE_ZERO) | (room > DEGREES.value),
            f"above absolute zero and at most {DEGREES.value:g} degC",
        )
    for quantity, (wrong, expected) in impossible.items():
        if wrong.any():
            at = int(np.argmax(wrong))
            value, unit = found[quantity][at], QUANTITIES[quantity].unit
            raise MeasurementError(
                f"{value:g} {unit}",
                file=path,
                row=int(table.row[at]),
                column=names[quantity],
                expected=expected,
            )
