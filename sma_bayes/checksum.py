"""Checksums of what stored results say, written with them and compared by every reader."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np

KEY: Final = "content_sha256"
"""Under which a checksum stands: in a JSON document, in the attributes of a NetCDF file."""

_OF_RUN: Final = frozenset({"figures", "stages_s", "stages_cpu_s", "workers", "wall_s", "self_check"})
"""Keys of a document that say how a run went, or hold what may be added to a finished one."""
_OF_HDF5: Final = {
    "CLASS",
    "NAME",
    "DIMENSION_LIST",
    "REFERENCE_LIST",
    "_Netcdf4Dimid",
    "_Netcdf4Coordinates",
    KEY,
}
"""Attributes that say how a file is built rather than what it holds."""


def document_checksum(document: Mapping[str, Any]) -> str:
    """SHA-256 of a document of values that JSON knows, besides its checksum and whatever the layout of the file."""
    content = {key: value for key, value in document.items() if key != KEY}
    return hashlib.sha256(json.dumps(content, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def numbers_checksum(document: Mapping[str, Any]) -> str:
    """SHA-256 of the numbers of a document, the same of a run that was made again: not of what the run took."""
    return document_checksum(_without(document, _OF_RUN))


def _without(value: Any, keys: frozenset[str]) -> Any:
    """Values that JSON knows without some keys, however deep."""
    if isinstance(value, Mapping):
        return {name: _without(held, keys) for name, held in value.items() if name not in keys}
    return [_without(held, keys) for held in value] if isinstance(value, list) else value


def file_checksum(path: Path) -> str:
    """SHA-256 of a file, byte by byte, without taking it apart: with damaged HDF5 that may last for ever."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def add_checksum(path: Path) -> str:
    """Write the checksum of a NetCDF-4 file into its attributes, and return it."""
    with h5py.File(path, "r+") as file:
        checksum = netcdf_checksum(file)
        file.attrs[KEY] = checksum
    return checksum


def has_its_checksum(path: Path) -> bool:
    """Whether a NetCDF-4 file holds what it held when it was written.

    Raises
    ------
    OSError
        If it can't be read as HDF5.
    """
    with h5py.File(path, "r") as file:
        return bool(netcdf_checksum(file) == file.attrs.get(KEY))


def netcdf_checksum(file: h5py.File) -> str:
    """SHA-256 of all variables and attributes of a file, with their names, in the order of the names.

    Raises
    ------
    OSError
        If a part of it can't be read.
    """
    names: list[str] = []
    file.visit(names.append)
    try:
        return content_checksum((name, *_held(file[name])) for name in ("/", *names))
    except (
        KeyError,
        RuntimeError,
        ValueError,
        TypeError,
    ) as error:  # HDF5 raises whatever it meets in a damaged file
        raise OSError(f"a part of the file is damaged: {error}") from None


def content_checksum(parts: Iterable[tuple[str, Mapping[str, object], object]]) -> str:
    """SHA-256 of groups and variables, as `netcdf_checksum` finds it of the file that holds them.

    Parameters
    ----------
    parts : iterable of tuple
        Name (that of the root is ``/``), attributes, and the values of a variable or None of a group; in any order.
    """
    digest = hashlib.sha256()
    for name, attributes, values in sorted(parts, key=lambda part: (part[0] != "/", part[0])):
        digest.update(name.encode())
        for key in sorted(set(attributes) - _OF_HDF5):
            _add(digest, key, attributes[key])
        if values is not None:
            _add(digest, "", values)
    return digest.hexdigest()


def _held(place: h5py.Group | h5py.Dataset) -> tuple[dict[str, object], object]:
    """Attributes of a part of a file, and the values of a variable."""
    attributes = {key: place.attrs[key] for key in set(place.attrs) - _OF_HDF5}
    return attributes, place[()] if isinstance(place, h5py.Dataset) else None


def _add(digest: Any, name: str, value: object) -> None:
    array = np.asarray(value)
    digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
    digest.update(
        repr(array.tolist()).encode() if array.dtype.hasobject else np.ascontiguousarray(array).data
    )
