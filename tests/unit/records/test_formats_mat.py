"""MATLAB files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.io

from sma_bayes.errors import MeasurementError
from sma_bayes.records.formats import RawTable, Reading, read_table, recognise


def columns(table: RawTable) -> dict[str, list[object]]:
    assert table.names is not None
    return {name: list(cells) for name, cells in zip(table.names, table.columns, strict=True)}


@pytest.mark.parametrize("version", ["4", "5"])
@pytest.mark.parametrize("orientation", ["row", "column"])
def test_plain_variables(tmp_path: Path, version: str, orientation: str) -> None:
    path = tmp_path / "a.mat"
    content = {
        "T": np.arange(4.0),
        "F": np.arange(4.0) / 3,
        "M": np.arange(8.0).reshape(4, 2),
        "note": "hello",
    }
    scipy.io.savemat(path, content, format=version, oned_as=orientation)  # type: ignore[arg-type]
    assert recognise(path) == "mat"
    read = columns(read_table(path, Reading()))
    assert read.keys() == {"T", "F", "M[1]", "M[2]"}
    assert read["F"] == [0, 1 / 3, 2 / 3, 1]
    assert read["M[2]"] == [1, 3, 5, 7]


def test_structures_and_parameters(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    run = {"T": np.arange(3.0), "deep": {"F": np.array([1, 2, 3], dtype=np.int16)}, "rate": 100.0}
    scipy.io.savemat(path, {"run": run, "gain": 2.0}, do_compression=True)
    table = read_table(path, Reading())
    assert columns(table) == {"run.T": [0, 1, 2], "run.deep.F": [1, 2, 3]}
    assert table.row.tolist() == [1, 2, 3]


def test_structure_with_time(tmp_path: Path) -> None:
    def signal(label: str, values: np.ndarray) -> dict[str, object]:
        return {"values": values, "dimensions": 1.0, "label": label}

    path = tmp_path / "a.mat"
    two = np.array([signal("force", np.ones((3, 1))), signal("", np.zeros((3, 2)))], dtype=object)
    scipy.io.savemat(path, {"log": {"time": np.arange(3.0)[:, None], "signals": two, "blockName": "m/Scope"}})
    assert columns(read_table(path, Reading())) == {
        "log.time": [0, 1, 2],
        "log.force": [1, 1, 1],
        "log.signal2[1]": [0, 0, 0],
        "log.signal2[2]": [0, 0, 0],
    }


def test_limits_count_samples_where_there_are_no_lines(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"T": np.arange(10.0), "short": np.arange(2.0)})
    table = read_table(path, Reading(first_row=2, last_row=4))
    assert columns(table) == {"T": [1, 2, 3], "short": [1]}
    assert table.row.tolist() == [2, 3, 4]
    assert [(f.kind, f.count, f.dropped) for f in table.findings] == [("cut", 7, 7)]


def test_a_newer_version_a_damaged_file_and_one_without_arrays(tmp_path: Path) -> None:
    path = tmp_path / "new.mat"
    path.write_bytes(
        b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM" + b"\x89HDF\r\n\x1a\n"
    )
    with pytest.raises(MeasurementError, match=r"version 7\.3") as caught:
        read_table(path, Reading())
    assert "'-v7'" in str(caught.value)

    whole = tmp_path / "whole.mat"
    scipy.io.savemat(whole, {"T": np.arange(1000.0)})
    for length in (100, 130, 140, 1000):
        path = tmp_path / f"cut{length}.mat"
        path.write_bytes(whole.read_bytes()[:length])
        with pytest.raises(MeasurementError):
            read_table(path, Reading())

    path = tmp_path / "text.mat"
    scipy.io.savemat(path, {"note": "hello", "gain": 2.0})
    with pytest.raises(MeasurementError, match="no array of numbers"):
        read_table(path, Reading())


def test_real_simulink_files(shared_data: Path) -> None:
    folder = shared_data / "flexinol_wire_duty_cycle"
    table = read_table(folder / "mat" / "SensorPosition_Ramp01.mat", Reading())
    assert table.names == ("SensorPosition.time", "SensorPosition")
    text = np.genfromtxt(folder / "Ramp01.csv", delimiter=",", names=True)
    np.testing.assert_allclose(np.asarray(table.columns[0], dtype=float), text["time_s"], atol=1e-9)
    np.testing.assert_allclose(np.asarray(table.columns[1], dtype=float), text["position_m"], atol=1e-9)
