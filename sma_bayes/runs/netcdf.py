"""Writing groups of arrays as NetCDF-4, straight by h5py.

`DataTree.to_netcdf` looks up dimensions through new HDF5 objects for each of the 70 variables of a posterior, which
took more processor time than sampling it; and to import xarray takes a third of a second. The layout is that of
NetCDF-4: an HDF5 dimension scale for each dimension of a group, attached to the variables that have it; the CF
attribute ``coordinates`` names what else belongs to a variable.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from sma_bayes.checksum import KEY, content_checksum

COMPRESSION = {"compression": "gzip", "compression_opts": 2, "shuffle": True}
CHUNK_LENGTH = 100
"""Places along the last dimension that are packed together; with all others, a tenth less room than by h5py's guess."""

Part = tuple[str, Mapping[str, Any], Any]
"""Name, attributes and values of what was written, as `content_checksum` takes it; a group has no values."""


@dataclass(frozen=True, slots=True, eq=False)
class Variable:
    """An array with named dimensions."""

    dims: tuple[str, ...]
    values: Any
    attributes: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class VariableGroup:
    """Variables that share dimensions.

    Attributes
    ----------
    variables, coords : mapping of str to Variable
        Each dimension has a coordinate of its own name.
    attributes : mapping of str to str or number
    """

    variables: Mapping[str, Variable] = field(default_factory=dict)
    coords: Mapping[str, Variable] = field(default_factory=dict)
    attributes: Mapping[str, Any] = field(default_factory=dict)

    @property
    def nbytes(self) -> int:
        """Size of all arrays [byte]."""
        return sum(np.asarray(v.values).nbytes for v in (*self.variables.values(), *self.coords.values()))


def axes(**lengths: Any) -> dict[str, Variable]:
    """Coordinates of dimensions, from their values.

    Examples
    --------
    >>> axes(chain=[0, 1])["chain"].dims
    ('chain',)
    """
    return {name: Variable((name,), np.asarray(values)) for name, values in lengths.items()}


def write_groups(path: Path, groups: Mapping[str, VariableGroup], packed: Collection[str] = ()) -> None:
    """Write groups, what stands under ``/`` at the root, and the checksum of all of it.

    Parameters
    ----------
    path : Path
        File, written over where it exists.
    groups : mapping of str to VariableGroup
        By names without a slash, besides that of the root.
    packed : collection of str
        Names of groups whose variables are compressed, such as ``log_likelihood``.
    """
    parts: list[Part] = []
    with h5py.File(path, "w", track_order=True) as file:
        for name, group in groups.items():
            place = file if name == "/" else file.create_group(name)
            parts.append((name, _write_attributes(place, group.attributes), None))
            parts += _write_group(place, group, packed=name in packed)
        if "/" not in groups:
            parts.append(("/", {}, None))
        file.attrs[KEY] = content_checksum(parts)


def _write_group(place: Any, group: VariableGroup, *, packed: bool) -> Iterator[Part]:
    scales: dict[str, Any] = {}
    for name, variable in group.coords.items():
        if variable.dims == (name,):
            scales[name] = place.create_dataset(name, data=variable.values)
            scales[name].make_scale(name)
            yield _path(place, name), _write_attributes(scales[name], variable.attributes), variable.values
    others = {name: v for name, v in group.coords.items() if name not in scales}
    for name, variable in others.items():
        yield _write_variable(place, name, variable, variable.attributes, scales, {})
    for name, variable in group.variables.items():
        near = [c for c, v in others.items() if set(v.dims) <= set(variable.dims)]
        attributes = {**variable.attributes, **({"coordinates": " ".join(sorted(near))} if near else {})}
        options = _packing(variable) if packed else {}
        yield _write_variable(place, name, variable, attributes, scales, options)


def _packing(variable: Variable) -> dict[str, Any]:
    """How a variable is compressed, a chunk to so many places along its last dimension."""
    *others, last = np.shape(variable.values)
    return {**COMPRESSION, "chunks": (*others, min(last, CHUNK_LENGTH))}


def _write_variable(
    place: Any,
    name: str,
    variable: Variable,
    attributes: Mapping[str, Any],
    scales: Mapping[str, Any],
    options: Mapping[str, Any],
) -> Part:
    written = place.create_dataset(name, data=variable.values, **options)
    for number, dimension in enumerate(variable.dims):
        written.dims[number].attach_scale(scales[dimension])
    return _path(place, name), _write_attributes(written, attributes), variable.values


def _path(place: Any, name: str) -> str:
    return f"{place.name}/{name}".strip("/")


def _write_attributes(place: Any, attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Write attributes, and return them as they are read again: numbers as arrays."""
    written = {k: v if isinstance(v, str) else np.atleast_1d(v) for k, v in attributes.items()}
    for name, value in written.items():
        place.attrs[name] = value
    return written
