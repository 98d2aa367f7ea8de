"""LabVIEW measurement files, the binary form: TDMS."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.errors import MeasurementError, require_known
from sma_bayes.limits import BINARY_NUMBERS
from sma_bayes.records.formats.table import Cells, Format, RawTable, Reading, sample_rows, too_large
from sma_bayes.records.types import Finding

WAVEFORM_TIME = "waveform time"
"""Column made from the start offset and increment that a waveform channel carries [s]."""


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins with the tag of a TDMS segment."""
    return head.startswith(b"TDSm")


def read(path: Path, reading: Reading) -> RawTable:
    """Read a TDMS file.

    Parameters
    ----------
    path : Path
    reading : Reading
        ``group`` picks one group of channels.

    Returns
    -------
    RawTable
        A column is called by its channel, and by ``group/channel`` where several groups are read. Time stamps
        become seconds since the first one. Where the channels of a group are waveforms with one common
        increment, a column `WAVEFORM_TIME` is added.

    Raises
    ------
    MeasurementError
        If the file is damaged, too large, has no channels, or no such group.
    """
    groups, findings = _groups(path)
    told = f"the file has no group {reading.group!r}"
    remedy = "correct `group` in [reading] of campaign.toml"
    require_known(reading.group, groups, told, MeasurementError, file=path, remedy=remedy)
    chosen = groups if reading.group is None else {reading.group: groups[reading.group]}
    names: list[str] = []
    columns: list[Cells] = []
    for group, channels in chosen.items():
        prefix = f"{group}/" if len(chosen) > 1 else ""
        for name, values in channels.items():
            names.append(prefix + name)
            columns.append(values)
    if not any(len(column) for column in columns):
        raise MeasurementError(
            "the file has no channel with data",
            file=path,
            expected="at least one",
            remedy="check that the recording was written to its end, or export it as text",
        )
    return RawTable(tuple(names), tuple(columns), sample_rows(max(map(len, columns))), findings)


def _groups(path: Path) -> tuple[dict[str, dict[str, Cells]], tuple[Finding, ...]]:
    """Columns of every group, by group and channel, and whether the end of the file is lacking."""
    from nptdms import TdmsFile

    try:
        # npTDMS leaves a damaged file open that it has opened itself
        with (
            path.open("rb") as content,
            TdmsFile.open(content) as file,
        ):  # reads what it says of itself, no data
            if sum(len(c) for group in file.groups() for c in group.channels()) > BINARY_NUMBERS.value:
                raise too_large(f"the file has more than {BINARY_NUMBERS.value} numbers", path)
        with path.open("rb") as content, TdmsFile.read(content) as file:
            groups = {group.name: group.channels() for group in file.groups()}
            columns: dict[str, dict[str, Cells]] = {
                name: {**{c.name: _cells(c[:]) for c in channels}, **_waveform_time(channels)}
                for name, channels in groups.items()
                if channels
            }
            return columns, _incomplete(file.file_status)
    except MeasurementError:
        raise
    except Exception as error:  # on a damaged file the parser raises whatever its fields lead to
        raise MeasurementError(
            f"the file is damaged: {error}",
            file=path,
            expected="a TDMS file that LabVIEW opens",
            remedy="open and save it again, or export it as text",
        ) from None


def _incomplete(status: Any) -> tuple[Finding, ...]:
    if not status.incomplete_final_segment:
        return ()
    lengths = ", ".join(
        f"{path} {part.read_length} of {part.expected_length}"
        for path, part in (status.channel_statuses or {}).items()
    )
    message = f"the last segment was not written to its end: {lengths} samples read"
    return (Finding("truncated", message, count=1),)


def _cells(values: Any) -> Cells:
    array = np.asarray(values)
    if np.issubdtype(array.dtype, np.datetime64):
        return _seconds(array)
    if np.issubdtype(array.dtype, np.number):
        return array.astype(float)
    return [str(value) for value in array]


def _seconds(stamps: Any) -> Floats:
    elapsed = stamps - stamps[:1]
    return np.asarray(elapsed / np.timedelta64(1, "ns"), dtype=float) * 1e-9


def _waveform_time(channels: Sequence[Any]) -> dict[str, Cells]:
    """Time of each sample [s], shape (n,), where all channels agree on it."""
    clocks = {
        (len(c), c.properties.get("wf_start_offset", 0.0), c.properties.get("wf_increment")) for c in channels
    }
    if len(clocks) != 1:
        return {}
    n, start, step = clocks.pop()
    return {WAVEFORM_TIME: start + step * np.arange(n)} if step else {}


FORMAT = Format("LabVIEW TDMS file", recognises, read)
