"""Writing groups of arrays as NetCDF-4, straight by h5py.

`DataTree.to_netcdf` looks up dimensions through new HDF5 objects for each of the 70 variables of a posterior, which
took more processor time than sampling it; and to import xarray takes a third of a second. The layout is that of
NetCDF-4: an HDF5 dimension scale for each dimension of a group, attached to the variables that have it; the CF
attribute ``coordinates`` names what else belongs to a variable.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from sma_bayes.checksum import KEY, netcdf_checksum

PACKED = {"compression": "gzip", "compression_opts": 1, "shuffle": True}


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
    packed : collection of str
        Names of groups whose variables are compressed, such as ``log_likelihood``.
    """
    with h5py.File(path, "w", track_order=True) as file:
        for name, group in groups.items():
            place = file if name == "/" else file.require_group(name)
            _write_attributes(place, group.attributes)
            _write_group(place, group, PACKED if name in packed else {})
        file.attrs[KEY] = netcdf_checksum(file)


def _write_group(place: Any, group: VariableGroup, options: dict[str, Any]) -> None:
    scales = {}
    for name, variable in group.coords.items():
        if variable.dims == (name,):
            scales[name] = place.create_dataset(name, data=variable.values)
            scales[name].make_scale(name)
            _write_attributes(scales[name], variable.attributes)
    others = {name: v for name, v in group.coords.items() if name not in scales}
    for name, variable in others.items():
        _write_variable(place, name, variable, scales, {})
    for name, variable in group.variables.items():
        written = _write_variable(place, name, variable, scales, options)
        near = [c for c, v in others.items() if set(v.dims) <= set(variable.dims)]
        if near:
            written.attrs["coordinates"] = " ".join(sorted(near))


def _write_variable(
    place: Any, name: str, variable: Variable, scales: Mapping[str, Any], options: dict[str, Any]
) -> Any:
    written = place.create_dataset(name, data=variable.values, **options)
    for number, dimension in enumerate(variable.dims):
        written.dims[number].attach_scale(scales[dimension])
    _write_attributes(written, variable.attributes)
    return written


def _write_attributes(place: Any, attributes: Mapping[str, Any]) -> None:
    for name, value in attributes.items():
        place.attrs[name] = value if isinstance(value, str) else np.atleast_1d(value)
