"""LabVIEW measurement files in binary form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter

from sma_bayes.errors import MeasurementError
from sma_bayes.records.formats import RawTable, Reading, read_table, recognise
from sma_bayes.records.formats.tdms import WAVEFORM_TIME


def write(folder: Path, *channels: ChannelObject) -> Path:
    path = folder / "run.tdms"
    with TdmsWriter(path) as writer:
        writer.write_segment(channels)
    return path


def columns(table: RawTable) -> dict[str, list[object]]:
    assert table.names is not None
    return {name: list(cells) for name, cells in zip(table.names, table.columns, strict=True)}


def test_one_group(tmp_path: Path) -> None:
    path = write(
        tmp_path,
        ChannelObject("run", "T", np.array([20.5, 21.5, 22.5])),
        ChannelObject("run", "counts", np.array([1, 2, 3], dtype=np.int16)),
        ChannelObject("run", "note", ["a", "b", "c"]),
    )
    assert recognise(path) == "tdms"
    table = read_table(path, Reading())
    assert columns(table) == {"T": [20.5, 21.5, 22.5], "counts": [1, 2, 3], "note": ["a", "b", "c"]}
    assert table.row.tolist() == [1, 2, 3]


def test_segments_written_one_after_the_other_are_one_column(tmp_path: Path) -> None:
    path = tmp_path / "run.tdms"
    with TdmsWriter(path) as writer:
        for i in range(3):
            writer.write_segment([ChannelObject("run", "T", np.array([float(i), i + 0.5]))])
    assert columns(read_table(path, Reading())) == {"T": [0, 0.5, 1, 1.5, 2, 2.5]}


def test_several_groups_are_told_apart(tmp_path: Path) -> None:
    path = write(
        tmp_path, ChannelObject("hot", "T", np.arange(3.0)), ChannelObject("cold", "T", np.arange(2.0))
    )
    assert columns(read_table(path, Reading())) == {"hot/T": [0, 1, 2], "cold/T": [0, 1]}
    assert columns(read_table(path, Reading(group="cold"))) == {"T": [0, 1]}
    with pytest.raises(MeasurementError, match="no group 'cool'") as caught:
        read_table(path, Reading(group="cool"))
    assert "'cold'" in str(caught.value)


def test_a_waveform_brings_its_clock(tmp_path: Path) -> None:
    clock = {"wf_start_offset": 1.0, "wf_increment": 0.25, "wf_samples": 3}
    path = write(
        tmp_path,
        ChannelObject("run", "T", np.arange(3.0), properties=clock),
        ChannelObject("run", "F", np.arange(3.0), properties=clock),
    )
    assert columns(read_table(path, Reading()))[WAVEFORM_TIME] == [1, 1.25, 1.5]
    other = {**clock, "wf_increment": 0.5}
    path = write(
        tmp_path,
        ChannelObject("run", "T", np.arange(3.0), properties=clock),
        ChannelObject("run", "F", np.arange(3.0), properties=other),
    )
    assert WAVEFORM_TIME not in columns(read_table(path, Reading()))


def test_time_stamps_become_seconds(tmp_path: Path) -> None:
    stamps = np.array(
        ["2024-01-01T00:00:00", "2024-01-01T00:00:00.250", "2024-01-01T00:01:00"], "datetime64[us]"
    )
    table = read_table(write(tmp_path, ChannelObject("run", "t", stamps)), Reading())
    np.testing.assert_allclose(np.asarray(table.columns[0], dtype=float), [0, 0.25, 60], atol=1e-6)


def test_a_file_that_breaks_off_is_read_as_far_as_it_goes_and_said(tmp_path: Path) -> None:
    whole = write(tmp_path, ChannelObject("run", "T", np.arange(100.0))).read_bytes()
    path = tmp_path / "cut.tdms"
    path.write_bytes(whole[: -8 * 40])
    table = read_table(path, Reading())
    assert columns(table)["T"] == list(range(60))
    assert [f.kind for f in table.findings] == ["truncated"]
    assert "60 of 100 samples" in table.findings[0].message


def test_a_damaged_file_and_one_without_data(tmp_path: Path) -> None:
    whole = write(tmp_path, ChannelObject("run", "T", np.arange(100.0))).read_bytes()
    path = tmp_path / "cut.tdms"
    path.write_bytes(whole[:20])
    with pytest.raises(MeasurementError):
        read_table(path, Reading())
    with pytest.raises(MeasurementError, match="no channel with data"):
        read_table(write(tmp_path, ChannelObject("run", "T", np.array([], dtype=float))), Reading())
