"""MATLAB files: MAT, up to version 7."""

from __future__ import annotations

import struct
import subprocess
import sys
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.errors import MeasurementError
from sma_bayes.limits import BINARY_NUMBERS, MATLAB_BYTES
from sma_bayes.records.formats.table import Format, RawTable, Reading, sample_rows, too_large


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file has a MATLAB header; version 4 has none and is known by its suffix and its zeros."""
    return head.startswith(b"MATLAB ") or (path.suffix.lower() == ".mat" and b"\0" in head[:4])


def read(path: Path, reading: Reading) -> RawTable:
    """Read the numeric arrays of a MATLAB file.

    Parameters
    ----------
    path : Path
    reading : Reading
        Not used: the format leaves nothing open.

    Returns
    -------
    RawTable
        A vector is a column under its name, a matrix ``M`` gives the columns ``M[1]``, ``M[2]``, ..., counted
        from 1. The fields of a structure are ``S.field``; a Simulink structure with time gives ``S.time`` and
        its signals ``S.<label>``, or ``S`` where the only signal has no label. Single numbers are parameters,
        not columns.

    Raises
    ------
    MeasurementError
        If the file is of version 7.3, damaged, too large, or holds no array of numbers.
    """
    _require_bytes(path)
    columns: dict[str, Floats] = {}
    numbers = 0
    for key, value in _variables(path).items():
        if key.startswith("__"):
            continue
        for name, array in _columns(key, value):
            columns[name] = array
            numbers += array.size
            if numbers > BINARY_NUMBERS.value:
                raise too_large(f"the file has more than {BINARY_NUMBERS.value} numbers", path)
    if not columns:
        raise MeasurementError(
            "no array of numbers",
            file=path,
            expected="vectors, matrices, structures of them, or a Simulink structure with time",
            remedy="save the measurements as plain arrays; a timeseries object can't be read",
        )
    return RawTable(
        tuple(columns), tuple(columns.values()), sample_rows(max(len(values) for values in columns.values()))
    )


_COMPRESSED, _CHUNK = 15, 1 << 20
"""Type of a compressed element, and bytes that are unpacked at a time."""


def _require_bytes(path: Path) -> None:
    """Refuse a file that unpacks to more than the limit, without keeping what it unpacks to."""
    left = int(MATLAB_BYTES.value)
    with path.open("rb") as file:
        head = file.read(128)
        order = {b"IM": "<", b"MI": ">"}.get(head[126:])
        if order is None:  # version 4, which has no compression
            left -= path.stat().st_size
        while left >= 0 and order and len(tag := file.read(8)) == 8:
            kind, size = struct.unpack(f"{order}II", tag)
            if kind == _COMPRESSED:
                left = _left_after(zlib.decompressobj(), file.read(size), left)
            else:
                left -= size
                file.seek(size, 1)
    if left < 0:
        raise too_large(f"the file has more than {MATLAB_BYTES.value} bytes when unpacked", path)


def _left_after(unpacker: Any, packed: bytes, left: int) -> int:
    while packed and left >= 0:
        try:
            left -= len(unpacker.decompress(packed, _CHUNK))
        except zlib.error:  # damaged, of which the parser tells
            break
        packed = unpacker.unconsumed_tail
    return left


PROBE = "import sys, scipy.io; scipy.io.loadmat(sys.argv[1], squeeze_me=True, struct_as_record=False)"


def _variables(path: Path) -> dict[str, Any]:
    """Variables of the file, read by another process first: damaged ones can end the process that parses them."""
    import scipy.io

    probe = subprocess.run([sys.executable, "-c", PROBE, str(path)], capture_output=True, check=False)
    if probe.returncode < 0:
        raise MeasurementError(
            "the file is damaged: its parser was ended by the system",
            file=path,
            expected="a file that MATLAB loads",
            remedy="save it again with save(file, '-v7')",
        )
    try:
        return scipy.io.loadmat(path, squeeze_me=True, struct_as_record=False)
    except NotImplementedError:
        raise MeasurementError(
            "the file is of MATLAB version 7.3",
            file=path,
            expected="version 7 or older",
            remedy="save it again in MATLAB with: save(file, '-v7')",
        ) from None
    except Exception as error:  # on a damaged file the parser raises whatever its fields lead to
        raise MeasurementError(
            f"the file is damaged: {error}",
            file=path,
            expected="a file that MATLAB loads",
            remedy="save it again with save(file, '-v7')",
        ) from None


def _columns(name: str, value: Any) -> Iterator[tuple[str, Floats]]:
    """Columns in a variable, with their names."""
    if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
        if value.ndim == 1:
            yield name, value.astype(float)
        elif value.ndim == 2:
            yield from ((f"{name}[{i}]", column.astype(float)) for i, column in enumerate(value.T, start=1))
    elif isinstance(value, np.ndarray) and value.dtype == object:
        for i, part in enumerate(value.flat, start=1):
            yield from _columns(f"{name}[{i}]", part)
    elif hasattr(value, "_fieldnames"):
        fields = {field: getattr(value, field) for field in value._fieldnames}
        if {"time", "signals"} <= set(fields):
            yield from _structure_with_time(name, fields["time"], fields["signals"])
        else:
            for field, part in fields.items():
                yield from _columns(f"{name}.{field}", part)


def _structure_with_time(name: str, time: Any, signals: Any) -> Iterator[tuple[str, Floats]]:
    yield from _columns(f"{name}.time", time)
    several = np.atleast_1d(signals)
    for i, signal in enumerate(several, start=1):
        label = getattr(signal, "label", "")
        if isinstance(label, str) and label:
            title = f"{name}.{label}"
        else:
            title = name if several.size == 1 else f"{name}.signal{i}"
        yield from _columns(title, getattr(signal, "values", None))


FORMAT = Format("MATLAB file", recognises, read)
