"""Writing where the disk may be full or the folder locked: one message, and no half-written file passed for a whole."""

from __future__ import annotations

import errno
import os
import re
import shutil
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sma_bayes.errors import OutputError

FREE_BYTES = 2**22
"""Room that must be left besides the numbers in a file: for its own structure, and for what other processes write
meanwhile [byte]. Worth more than it costs, because HDF5 may bring the process down where the disk runs full."""

NEEDED = "room and permission"


def quoted(path: str | Path) -> str:
    """Path as an argument of a command that is shown, to be copied to a shell.

    Examples
    --------
    >>> print(quoted("bench/2A.csv"), quoted("bench rig (new)"))
    bench/2A.csv "bench rig (new)"
    """
    text = str(path)
    return text if re.fullmatch(r"[\w@%+=:,./~\\-]+", text) else f'"{text}"'


@contextmanager
def writing(path: Path, *, nbytes: int = 0) -> Iterator[None]:
    """Turn every failure to write a file into one `OutputError`.

    HDF5 can't close a file that it can't finish, and complains again whenever one of its objects is disposed of.
    So the room is looked up before it begins, and what it says afterwards is kept off the screen.

    Parameters
    ----------
    path : Path
        File, or place of the file, in a folder that exists.
    nbytes : int
        Bytes that will be written at most, if known.

    Raises
    ------
    OutputError
        If the disk has less room than that, or anything goes wrong on the way.
    """
    hook = sys.unraisablehook
    try:
        free = shutil.disk_usage(path.parent).free
        if nbytes and free < nbytes + FREE_BYTES:
            lacking = f"{free / 1e6:.3g} MB are free, {(nbytes + FREE_BYTES) / 1e6:.3g} MB needed"
            raise unwritable(path, lacking, NEEDED)
        sys.unraisablehook = lambda _: None
        yield
    except (OSError, RuntimeError) as error:
        traceback.clear_frames(error.__traceback__)
        raise unwritable(path, reason(error), NEEDED) from None
    finally:
        sys.unraisablehook = hook


def reason(error: OSError | RuntimeError) -> str:
    """Why a file can't be written, without what HDF5 tells of addresses and buffers.

    Examples
    --------
    >>> reason(RuntimeError("Can't decrement id ref count (errno = 28, buf = 0x55)"))
    'No space left on device'
    """
    number: int | None = getattr(error, "errno", None)
    if number is None:
        told = re.search(r"errno = (\d+)", str(error))
        number = int(told[1]) if told else None
    if number is not None:
        return os.strerror(number)
    return f"HDF5 can't finish the file, the disk may be full ({str(error).splitlines()[0][:100]})"


def unwritable(path: Path, why: str, what: str) -> OutputError:
    """Error about a file that can't be written; of a folder that is gone it says so, as no room would bring it back."""
    if why == os.strerror(errno.ENOENT):
        return OutputError(
            f"can't be written: the folder {str(path.parent)!r} is not there any more",
            file=path,
            expected="a folder that stays where it is until the run has ended",
            remedy="repeat the command; move or remove results only after the end of the run",
        )
    return OutputError(
        f"can't be written: {why}",
        file=path,
        expected=what,
        remedy="free the disk or choose another --out; then repeat with --resume",
    )
