"""What tests of whole runs share: runs compared to the bit, and the script that makes a test house."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import xarray as xr

from sma_bayes.checksum import file_checksum

SCRIPTS = str(Path(__file__).resolve().parents[2] / "scripts")
if SCRIPTS not in sys.path:
    sys.path.append(SCRIPTS)

TIMES = ("wall_s", "stages_s", "stages_cpu_s", "workers", "content_sha256")
TOOK = (b"wall [s]",)
CONTAINER = "posterior_sha256"
"""Of the bytes of an HDF5 file, which promises what it holds, not how: that is compared, and this checked."""


def without_times(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: without_times(v) for k, v in value.items() if k not in (*TIMES, CONTAINER)}
    return [without_times(v) for v in value] if isinstance(value, list) else value


def summary_of(folder: Path) -> Any:
    return without_times(json.loads((folder / "summary.json").read_text(encoding="utf-8")))


@pytest.fixture(scope="session")
def summary() -> Callable[[Path], Any]:
    """The summary of a run without what differs from run to run."""
    return summary_of


def left_by(folder: Path) -> dict[str, object]:
    """What documents and tables of a folder say, without times; numbers of draws stand in them."""
    found: dict[str, object] = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.suffix == ".json" and path.name != "run.json":
            found[name] = without_times(json.loads(path.read_text(encoding="utf-8")))
        elif path.suffix in {".csv", ".toml", ".h"} and path.name != "account.csv":  # which is all times
            found[name] = without_seconds(path.read_bytes()) if path.suffix == ".csv" else path.read_bytes()
    return found


def without_seconds(table: bytes) -> list[list[bytes]]:
    """Cells of a CSV file but those of columns of seconds that work took."""
    rows = [line.split(b",") for line in table.splitlines()]
    took = {i for i, name in enumerate(rows[0]) if name in TOOK} if rows else set()
    return [[cell for i, cell in enumerate(row) if i not in took] for row in rows] if took else rows


@pytest.fixture(scope="session")
def assert_same_folder() -> Callable[[Path, Path], None]:
    """Check that documents and tables of two runs of any verb agree to the bit; times differ."""

    def check(one: Path, other: Path) -> None:
        expected = left_by(one)
        assert expected
        assert left_by(other) == expected

    return check


@pytest.fixture(scope="session")
def assert_same_run() -> Callable[[Path, Path], None]:
    """Check that draws, bands and summary of two runs agree to the bit; times differ."""

    def check(one: Path, other: Path) -> None:
        assert summary_of(one) == summary_of(other)
        for path in sorted((one / "bands").iterdir()):
            assert path.read_bytes() == (other / "bands" / path.name).read_bytes(), path.name
        posteriors = sorted((one / "posterior").iterdir())
        assert [p.name for p in posteriors] == sorted(p.name for p in (other / "posterior").iterdir())
        for folder in (one, other):
            stated = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["records"]
            assert all(r[CONTAINER] == file_checksum(folder / "posterior" / f"{r['key']}.nc") for r in stated)
        for path in posteriors:
            with (
                xr.open_datatree(path, engine="h5netcdf") as a,
                xr.open_datatree(other / "posterior" / path.name, engine="h5netcdf") as b,
            ):
                xr.testing.assert_identical(a.load(), b.load())

    return check
