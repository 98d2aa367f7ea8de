"""One condition from several files: one after the other where they hold the same columns, else joined on time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats, Ints
from sma_bayes.errors import MeasurementError, many
from sma_bayes.quantities import CHANNELS
from sma_bayes.records.declaration import CHANNEL_OF, ColumnDeclaration
from sma_bayes.records.types import Finding

GAP_STEPS: Final = 10.0
"""Between readings that are further apart than so many usual steps nothing is interpolated."""

STEPWISE: Final = ("drive", "cycle", "branch", "load", "frequency", "duty_cycle")
"""What keeps its last value until the next reading; other inputs are interpolated linearly."""


@dataclass(frozen=True, slots=True, eq=False)
class FileColumns:
    """What one file of a condition holds.

    Attributes
    ----------
    path : Path
    name : str
        As the campaign names it.
    row : ndarray of int, shape (n,)
        Source lines.
    columns : mapping of str to ColumnDeclaration
    values : mapping of str to ndarray, shape (n,)
        In canonical units.
    clock : bool
        Whether time is a clock, counted from midnight or from a day long ago.
    findings : tuple of Finding
    """

    path: Path
    name: str
    row: Ints
    columns: Mapping[str, ColumnDeclaration]
    values: Mapping[str, Floats]
    clock: bool = False
    findings: tuple[Finding, ...] = ()


def joined(files: Sequence[FileColumns]) -> tuple[FileColumns, tuple[Finding, ...]]:
    """Columns of all files of a condition.

    Files with the same columns follow one another, as where heating and cooling were logged apart; a clock that begins
    again goes on where the file before ended. Files with different columns need time: rows are those of the file with
    a channel that has the fewest; to their times inputs are interpolated linearly (`STEPWISE` ones keep their last
    value), and a channel is its nearest reading within half a usual step of the slower of the two.

    Returns
    -------
    FileColumns
        NaN where another file has nothing for a row.
    tuple of Finding
        How they were joined.

    Raises
    ------
    MeasurementError
        If files with different columns have no time, or times that don't overlap.
    """
    if len(files) == 1:
        return files[0], ()
    if all(f.values.keys() == files[0].values.keys() for f in files):
        return _one_after_the_other(files)
    return _on_time(files)


def _one_after_the_other(files: Sequence[FileColumns]) -> tuple[FileColumns, tuple[Finding, ...]]:
    parts = [dict(f.values) for f in files]
    again = 0
    for before, part in pairwise(parts):
        if "time" in part and _ends(part["time"])[0] <= _ends(before["time"])[1]:
            step = np.nanmedian(np.diff(before["time"])) if before["time"].size > 1 else 1.0
            part["time"] = part["time"] + (_ends(before["time"])[1] + step - _ends(part["time"])[0])
            again += 1
    message = f"{len(files)} files, one after the other: {', '.join(f.name for f in files)}"
    message += f"; the time of {many(again, 'file')} goes on where the one before ended" if again else ""
    whole = replace(
        files[0],
        row=np.concatenate([f.row for f in files]),
        values={q: np.concatenate([p[q] for p in parts]) for q in parts[0]},
    )
    return whole, (Finding("joined", message, count=whole.row.size),)


def _ends(time: Floats) -> tuple[float, float]:
    """First and last time."""
    there = time[np.isfinite(time)]
    return (float(there[0]), float(there[-1])) if there.size else (np.inf, -np.inf)


def _on_time(files: Sequence[FileColumns]) -> tuple[FileColumns, tuple[Finding, ...]]:
    for f in files:
        _require_time(f)
    with_channel = [f for f in files if _channels(f)] or list(files)
    base = min(with_channel, key=lambda f: f.row.size)
    time = base.values["time"]
    values, columns = dict(base.values), dict(base.columns)
    told = []
    for other in files:
        if other is base:
            continue
        names = [q for q in other.values if q not in values]
        for name in names:
            values[name] = _at(time, other, name)
            columns[name] = other.columns[name]
        there = int(np.sum(np.isfinite(np.array([values[n] for n in names])).all(axis=0))) if names else 0
        if names and not there:
            raise _no_overlap(base, other)
        told.append(f"{', '.join(names) or 'nothing new'} of {other.name} at {there} of them")
    message = f"{len(files)} files, joined at the {time.size} times of {base.name}: {'; '.join(told)}"
    whole = replace(base, values=values, columns=columns)
    return whole, (Finding("joined", message, count=time.size),)


def _channels(file: FileColumns) -> list[str]:
    return [q for q in file.values if q in CHANNELS or q in CHANNEL_OF]


def _require_time(file: FileColumns) -> None:
    time = file.values.get("time")
    if time is None:
        raise MeasurementError(
            "has no time, and not the columns of the other files of its condition",
            file=file.path,
            expected="the same columns in all files of a condition, or a time in each by which they are joined",
            remedy="declare the column of time; where files call it differently, as a list of tables with `file`",
        )
    back = np.flatnonzero(np.diff(time[np.isfinite(time)]) < 0)
    if back.size:
        raise MeasurementError(
            f"time steps back in {many(back.size, 'row')}, so that the file can't be joined to others",
            file=file.path,
            row=int(file.row[np.isfinite(time)][back[0] + 1]),
            expected="a time that does not decrease",
            remedy="cut the file by first_row and last_row, or make a condition of each stretch",
        )


def _at(time: Floats, file: FileColumns, name: str) -> Floats:
    """Readings of a column of another file at given times, NaN where there is none."""
    good = np.isfinite(file.values["time"]) & np.isfinite(file.values[name])
    at, values = file.values["time"][good], file.values[name][good]
    found = np.full(time.shape, np.nan)
    if at.size < 2:
        return found
    after = np.clip(np.searchsorted(at, time, side="right"), 1, at.size - 1)
    before = after - 1
    if name in _channels(file):
        step = max(_usual_step(at), _usual_step(time))
        nearest = np.where(np.abs(at[after] - time) < np.abs(at[before] - time), after, before)
        near = np.abs(at[nearest] - time) <= 0.5 * step
        found[near] = values[nearest[near]]
        return found
    inside = (time >= at[0]) & (time <= at[-1]) & (at[after] - at[before] <= GAP_STEPS * _usual_step(at))
    if name in STEPWISE:
        last = np.clip(np.searchsorted(at, time, side="right") - 1, 0, None)
        found[inside] = values[last[inside]]
    else:
        found[inside] = np.interp(time[inside], at, values)
    return found


def _usual_step(time: Floats) -> float:
    step = np.diff(time[np.isfinite(time)])
    return float(np.median(step[step > 0])) if np.any(step > 0) else 0.0


def _no_overlap(base: FileColumns, other: FileColumns) -> MeasurementError:
    (a, b), (c, d) = _ends(base.values["time"]), _ends(other.values["time"])
    return MeasurementError(
        f"times from {c:.6g} to {d:.6g} s, where {base.name} has {a:.6g} to {b:.6g} s: nothing to join",
        file=other.path,
        expected="two logs of the same time",
        remedy="where the clocks began apart, shift one by `offset` in a list of tables for time, each with its `file`",
    )
