"""Every data format: claims no file of another, and tells what it can't read as an error of the user's.

Formats of other installed packages are tried like those that ship; ``-k NAME`` tries one of them.
"""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import pytest

from sma_bayes.errors import MeasurementError
from sma_bayes.records.formats import FORMATS, RawTable, Reading

BEGINNINGS = {
    "delimited": b"temperature_C,force_N\n25,0.1\n26,0.2\n",
    "lvm": b"LabVIEW Measurement\nSeparator\tTab\n",
    "mat": b"MATLAB 5.0 MAT-file".ljust(128, b"\0"),
    "tdms": b"TDSm\x0e\0\0\0",
    "xlsx": b"PK\x03\x04\x14\0\0\0",
}
"""First bytes of files of the formats that ship."""
RNG = np.random.default_rng(0)
DAMAGED = (*BEGINNINGS.values(), *(RNG.bytes(size) for size in (1, 7, 300)), b"{", b"\xff\xfe\0", b"1 2\n3\n")

each = pytest.mark.parametrize("name", FORMATS)


@each
def test_it_claims_no_file_of_another(name: str, tmp_path: Path) -> None:
    form = FORMATS[name]
    assert form.title
    for other, head in BEGINNINGS.items():
        path = tmp_path / f"run.{other}"
        path.write_bytes(head)
        if other != name and FORMATS[other].plain >= form.plain:
            assert form.recognises(path, head) is False, other


@each
@pytest.mark.parametrize("content", DAMAGED, ids=range(len(DAMAGED)))
def test_what_it_can_not_read_is_an_error_with_the_file(name: str, content: bytes, tmp_path: Path) -> None:
    """Which is what a wrong `format` in a campaign file comes to."""
    path = tmp_path / "run.dat"
    path.write_bytes(content)
    with contextlib.suppress(MeasurementError):
        table = FORMATS[name].read(path, Reading(format=name))
        assert isinstance(table, RawTable)
        assert max(map(len, table.columns)) == table.row.size
        return
    with pytest.raises(MeasurementError, match=r"run\.dat"):
        FORMATS[name].read(path, Reading(format=name))


@each
def test_the_beginning_of_a_file_is_recognised_whatever_it_is(name: str, tmp_path: Path) -> None:
    for content in DAMAGED:
        path = tmp_path / "run.dat"
        path.write_bytes(content)
        assert FORMATS[name].recognises(path, content) in (True, False)
