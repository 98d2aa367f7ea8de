"""Writing a tree of xarray as NetCDF-4, straight by h5py.

`DataTree.to_netcdf` looks up dimensions through new HDF5 objects for each of the 70 variables of a posterior, which
took more processor time than sampling it. The layout is that of NetCDF-4: an HDF5 dimension scale for each dimension of
a group, attached to the variables that have it; the CF attribute ``coordinates`` names what else belongs to a variable.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import h5py
import numpy as np

PACKED = {"compression": "gzip", "compression_opts": 1}


def write_tree(path: Path, tree: Any, packed: Collection[str] = ()) -> None:
    """Write every node of a tree as a group.

    Every dimension of a node needs its coordinate there.

    Parameters
    ----------
    path : Path
        File, written over where it exists.
    tree : xarray.DataTree
    packed : collection of str
        Paths of nodes whose variables are compressed, such as ``/log_likelihood``.
    """
    with h5py.File(path, "w", track_order=True) as file:
        for node in tree.subtree:
            group = file if node.path == "/" else file.require_group(node.path)
            _write_attributes(group, node.attrs)
            _write_node(group, node, PACKED if node.path in packed else {})


def _write_node(group: Any, node: Any, options: dict[str, Any]) -> None:
    data = node.to_dataset(inherit=False)
    scales = {}
    for name in data.dims:
        scales[name] = group.create_dataset(name, data=data[name].variable.values)
        scales[name].make_scale(name)
        _write_attributes(scales[name], data[name].attrs)
    others = [name for name in data.coords if name not in scales]
    for name, variable in data.variables.items():
        if name in scales:
            continue
        written = group.create_dataset(
            name, data=variable.values, **(options if name in data.data_vars else {})
        )
        for place, dimension in enumerate(variable.dims):
            written.dims[place].attach_scale(scales[dimension])
        _write_attributes(written, variable.attrs)
        near = [c for c in others if set(data[c].dims) <= set(variable.dims)]
        if name in data.data_vars and near:
            written.attrs["coordinates"] = " ".join(sorted(near))


def _write_attributes(place: Any, attributes: dict[str, Any]) -> None:
    for name, value in attributes.items():
        place.attrs[name] = value if isinstance(value, str) else np.atleast_1d(value)
