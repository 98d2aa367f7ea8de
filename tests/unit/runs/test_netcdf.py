"""Our NetCDF files hold what xarray's own writer would have written."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from sma_bayes.checksum import KEY, has_its_checksum
from sma_bayes.runs.netcdf import CHUNK_LENGTH, Variable, VariableGroup, axes, write_groups


@pytest.fixture
def tree() -> xr.DataTree:
    rng = np.random.default_rng(0)
    points = {"row": ("obs", np.array([7, 8, 9])), "temperature": ("obs", rng.random(3), {"unit": "degC"})}
    dims = ("chain", "draw", "obs")
    curves = xr.Dataset(
        {"force": (dims, rng.random((2, 4, 3)).astype(np.float32), {"unit": "N"})},
        {"chain": [0, 1], "draw": [0, 2, 4, 6], "obs": [0, 1, 2], **points},
    )
    draws = rng.random((2, 4))
    draws[0, 1] = np.nan
    posterior = xr.Dataset(
        {"B1": (("chain", "draw"), draws, {"unit": "N", "long_name": "span ±"})},
        {"chain": [0, 1], "draw": np.arange(4)},
    )
    attributes = xr.Dataset(attrs={"title": "Kraft über Weg", "seed": 3, "share": 0.5})
    return xr.DataTree.from_dict({"/": attributes, "curves": curves, "posterior": posterior})


def groups(tree: xr.DataTree) -> dict[str, VariableGroup]:
    def variables(found) -> dict[str, Variable]:
        return {
            str(k): Variable(tuple(map(str, v.dims)), v.variable.values, v.attrs) for k, v in found.items()
        }

    return {
        node.path.strip("/") or "/": VariableGroup(
            variables(node.data_vars), variables(node.coords), node.attrs
        )
        for node in tree.subtree
    }


def test_xarray_reads_what_it_would_have_written_itself(tree: xr.DataTree, tmp_path: Path) -> None:
    write_groups(tmp_path / "ours.nc", groups(tree), packed=("curves",))
    with h5py.File(tmp_path / "ours.nc") as file:
        tree.attrs[KEY] = file.attrs[KEY]
    tree.to_netcdf(tmp_path / "theirs.nc", engine="h5netcdf")
    with (
        xr.open_datatree(tmp_path / "ours.nc", engine="h5netcdf") as ours,
        xr.open_datatree(tmp_path / "theirs.nc", engine="h5netcdf") as theirs,
    ):
        xr.testing.assert_identical(ours.load(), theirs.load())
        assert ours["curves/force"].dtype == np.float32
        assert set(ours["curves/force"].coords) == {"chain", "draw", "obs", "row", "temperature"}


def test_what_is_to_be_packed_is_and_nothing_else(tree: xr.DataTree, tmp_path: Path) -> None:
    write_groups(tmp_path / "ours.nc", groups(tree), packed=("curves",))
    with h5py.File(tmp_path / "ours.nc") as file:
        assert file["curves/force"].compression == "gzip"
        assert file["curves/temperature"].compression is None
        assert file["posterior/B1"].compression is None
        assert file["curves/force"].dims[2][0] == file["curves/obs"]


def test_the_checksum_is_that_of_what_can_be_read(tree: xr.DataTree, tmp_path: Path) -> None:
    write_groups(tmp_path / "ours.nc", groups(tree), packed=("curves",))
    assert has_its_checksum(tmp_path / "ours.nc")
    with h5py.File(tmp_path / "ours.nc", "r+") as file:
        file["curves/force"][0, 0, 0] += 1.0
    assert not has_its_checksum(tmp_path / "ours.nc")


def test_packed_curves_of_many_points_are_read_as_they_were(tmp_path: Path) -> None:
    points = 3 * CHUNK_LENGTH + 7
    values = np.random.default_rng(0).random((2, 4, points)).astype(np.float32)
    coords = axes(chain=range(2), draw=range(4), obs=range(points))
    curves = VariableGroup({"force": Variable(("chain", "draw", "obs"), values)}, coords)
    write_groups(tmp_path / "long.nc", {"/": VariableGroup(), "curves": curves}, packed=("curves",))
    assert has_its_checksum(tmp_path / "long.nc")
    with h5py.File(tmp_path / "long.nc") as file:
        np.testing.assert_array_equal(file["curves/force"][()], values)
        assert file["curves/force"].chunks == (2, 4, CHUNK_LENGTH)
