"""Writing: a full or locked disk is one message, whoever complains."""

from __future__ import annotations

import errno
import sys
from pathlib import Path

import pytest

from sma_bayes.disk import reason, unwritable, writing
from sma_bayes.errors import OutputError


@pytest.mark.parametrize(
    "error",
    [
        OSError(errno.ENOSPC, "No space left on device"),
        OSError(errno.ENOSPC, "Can't synchronously write data (file write failed: buf = 0x55)"),
        RuntimeError("Can't decrement id ref count (file write failed: errno = 28, buf = 0x55)"),
        RuntimeError("Can't decrement id ref count (file write failed\n, errno = 28)"),
    ],
)
def test_the_reason_is_told_without_addresses(error: OSError | RuntimeError, tmp_path: Path) -> None:
    assert reason(error) == "No space left on device"
    with pytest.raises(OutputError) as caught, writing(tmp_path / "f"):
        raise error
    assert str(caught.value).splitlines()[0] == f"{tmp_path / 'f'}: can't be written: No space left on device"


def test_what_hdf5_can_not_explain_is_said_to_be_so() -> None:
    assert reason(RuntimeError("Slist already enabled\nmore")).startswith("HDF5 can't finish the file")
    assert "more" not in reason(RuntimeError("Slist already enabled\nmore"))


def test_too_little_room_is_seen_beforehand(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"MB are free, 1e\+12 MB needed"), writing(tmp_path, nbytes=10**18):
        pytest.fail("begun all the same")


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="is not there any more") as caught, writing(tmp_path / "a" / "b"):
        pytest.fail("begun all the same")
    assert "free the disk" not in str(caught.value), "room would not bring it back"


def test_other_errors_pass_and_the_hook_comes_back(tmp_path: Path) -> None:
    hook = sys.unraisablehook
    with pytest.raises(KeyError), writing(tmp_path / "f"):
        raise KeyError("a bug")
    assert sys.unraisablehook is hook


def test_the_message_says_how_to_go_on(tmp_path: Path) -> None:
    text = str(unwritable(tmp_path / "f", "why", "room"))
    assert text.splitlines() == [
        f"{tmp_path / 'f'}: can't be written: why",
        "expected: room",
        "what to do: free the disk or choose another --out; then repeat with --resume",
    ]
