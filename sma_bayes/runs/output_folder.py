"""The folder that a run writes to: claimed by a mark before anything else, and given back if nothing came of it."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from sma_bayes.errors import OutputError, ResumeError
from sma_bayes.runs.documents import RUN_MARKER, read_mark
from sma_bayes.runs.store import nothing_unfinished, sweep_unfinished, write_json

if sys.platform != "win32":
    import fcntl


@contextmanager
def claimed_folder(folder: Path, identity: dict[str, Any], resume: bool) -> Iterator[None]:
    """Work in a folder that is ours alone, and leave none behind if nothing came of it; see `claim_folder`."""
    made = claim_folder(folder, identity, resume)
    with only_one_process(folder):
        try:
            sweep_unfinished(folder)
            with nothing_unfinished(folder):
                yield
        except BaseException:
            release(folder, made)
            raise


@contextmanager
def only_one_process(folder: Path) -> Iterator[None]:
    """Hold a claimed folder against other processes, as long as this one lives.

    The system releases it with the process, however that ends. Where it has no such locks, as on Windows and on some
    network disks, nothing is held.

    Raises
    ------
    OutputError
        If another process works there.
    """
    if sys.platform == "win32":
        yield
        return
    with (folder / RUN_MARKER).open("rb") as mark:
        try:
            fcntl.flock(mark, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise OutputError(
                "another process is at work on this run", file=folder, expected="one process a folder",
                remedy="wait until that one ends, or choose another --out",
            ) from None  # fmt: skip
        except OSError:
            pass
        yield


def release(folder: Path, made: Sequence[Path]) -> None:
    """Undo a claim, unless files besides its mark have been written.

    Parameters
    ----------
    folder : Path
    made : sequence of Path
        Folders that the claim made, the innermost first.
    """
    inside = sorted(folder.rglob("*"), reverse=True)
    if any(p.is_file() and p != folder / RUN_MARKER for p in inside):
        return
    with suppress(OSError):  # what can't be removed does no harm; the reason why we are here is what counts
        (folder / RUN_MARKER).unlink(missing_ok=True)
        for place in (*(p for p in inside if p.is_dir()), *made):
            place.rmdir()


def claim_folder(folder: Path, identity: dict[str, Any], resume: bool) -> tuple[Path, ...]:
    """Make a folder ours, or check that it already is.

    Returns
    -------
    tuple of Path
        Folders that were made for it, the innermost first.

    Raises
    ------
    OutputError
        If it can't be made, is not empty, or holds another run and `resume` was not asked for.
    ResumeError
        If it holds a run of other data, priors, options or versions.
    """
    try:
        if (folder / RUN_MARKER).is_file():
            _check_mark(folder, identity, resume)
            return ()
        if folder.exists() and not folder.is_dir():
            raise OutputError("is a file", file=folder, expected="a folder", remedy="choose another --out")
        if folder.exists() and any(folder.iterdir()):
            raise OutputError(
                "is not empty and holds no run of sma_bayes",
                file=folder,
                expected="a new or empty folder",
                remedy="choose another --out",
            )
        made = tuple(p for p in (folder, *folder.parents) if not p.exists())
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"can't be used: {error.strerror or error}", file=folder, expected="a folder that can be written",
            remedy="choose another --out",
        ) from None  # fmt: skip
    try:
        write_json(folder / RUN_MARKER, identity)
    except OutputError:
        release(folder, made)
        raise
    return made


def _check_mark(folder: Path, identity: dict[str, Any], resume: bool) -> None:
    found = read_mark(folder)
    if found is None:
        raise OutputError(
            "does not say which run the folder holds",
            file=folder / RUN_MARKER,
            expected="what `fit` wrote there",
            remedy="choose another --out",
        )
    different = [k for k in {**identity, **found} if k != "schema" and found.get(k) != identity.get(k)]
    if not resume:
        raise OutputError(
            "holds another run" if different else "holds this run already",
            file=folder,
            expected="a new or empty folder",
            remedy="choose another --out" + ("" if different else ", or add --resume to go on with that run"),
        )
    if different:
        raise ResumeError(
            "holds what another command has written"
            if "kind" in different
            else f"holds a run that differs in {', '.join(different)}",
            file=folder,
            expected="the same data, priors, options and versions",
            remedy="resume with what the run was started with, or choose another --out",
        )
