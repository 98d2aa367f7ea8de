"""A folder watched for files of new cycles, as the system tells of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Final

from sma_bayes.errors import MeasurementError, SmaBayesError
from sma_bayes.interruption import interrupted
from sma_bayes.studies.watch.workflow import Watch

SETTLED_MS: Final = 1000
"""How long a file has to rest before it is read [ms]."""
LONGEST_MS: Final = 10_000
"""After which one that is written without a rest is read all the same [ms]."""
TICK_MS: Final = 500
"""How often it is looked whether there is a reason to end [ms]."""
HIDDEN: Final = (".", "~")

Tell = Callable[[str], None]


def watch_folder(
    opening: Callable[[], AbstractContextManager[Watch]],
    folder: Path,
    files: Sequence[Path],
    out: Path | None,
    idle: float | None,
    tell: Tell | None,
) -> dict[str, Any]:
    """Take the files that a folder holds, then those that come, until there is an alarm or nothing more comes.

    A file that can't be used is told of and left, and read again when it changes; one that grows is read again, too.

    Parameters
    ----------
    opening : callable
        Opens the watch.
    folder : Path
    files : sequence of Path
        Taken before.
    out : Path or None
    idle : float or None
        Seconds without a new file after which it ends; None for never.
    tell : callable or None
        Told a line for each file.

    Returns
    -------
    dict
        What `watch.json` holds.

    Raises
    ------
    MeasurementError
        If there is no such folder.
    SmaBayesError
        If there is no `out`.
    """
    if not folder.is_dir():
        raise MeasurementError(
            "is not a folder", file=folder, expected="a folder of new cycles", remedy="check the path"
        )
    if out is None:
        raise SmaBayesError("--folder without --out", expected="a folder in which to keep what was counted")
    if folder.resolve() == out.resolve() or folder.resolve().is_relative_to(out.resolve()):
        raise SmaBayesError(
            f"--folder {folder} is that of the results", expected="a folder of new cycles alone"
        )
    with opening() as watch:
        found = watch.take(list(files))
        taken = _Folder(watch, tell)
        for paths in _arrivals(folder, idle):
            found = taken.take(paths, found)
            if watch.alarmed:
                break
        return found


class _Folder:
    """Takes files one by one, and goes on where one can't be used."""

    def __init__(self, watch: Watch, tell: Tell | None) -> None:
        self.watch, self.tell = watch, tell or (lambda text: None)

    def take(self, paths: Sequence[Path], found: dict[str, Any]) -> dict[str, Any]:
        for path in paths:
            before = len(self.watch.state.cycles)
            try:
                found = self.watch.take([path])
            except SmaBayesError as error:
                self.tell(f"{path.name}: left out: {'; '.join(str(error).splitlines())}")
                continue
            new = found["cycles"][before:]
            partial = [text for text in found["partial"] if text.startswith(path.name)]
            evidence = f", log10 e = {new[-1]['log10_e']:.2f}" if new else ""
            self.tell(f"{path.name}: {len(new)} new{evidence}" + "".join(f"; partial: {p}" for p in partial))
            if self.watch.alarmed:
                break
        return found


def _arrivals(folder: Path, idle: float | None) -> Iterator[list[Path]]:
    """Files that are there, then those that have come or changed and rest since, until nothing comes for so long.

    What is there is listed once the system tells of changes, so that nothing that comes meanwhile is missed.
    """
    from watchfiles import watch

    told: dict[Path, tuple[int, int]] = {}
    begun, listed = time.monotonic(), False
    for changes in watch(
        folder, recursive=False, debounce=LONGEST_MS, step=SETTLED_MS, rust_timeout=TICK_MS,
        yield_on_timeout=True, raise_interrupt=True,
    ):  # fmt: skip
        if interrupted():
            return
        paths = {Path(path) for _, path in changes} if listed else set(folder.iterdir())
        listed = True
        fresh = [path for path in paths if _is_meant(path) and told.get(path) != _stamp(path)]
        if fresh:
            told |= {path: _stamp(path) for path in fresh}
            yield sorted(fresh, key=lambda path: (*told[path], path.name))
            begun = time.monotonic()
        elif idle is not None and time.monotonic() - begun >= idle:
            return


def _stamp(path: Path) -> tuple[int, int]:
    """When a file was written, and how long it is."""
    seen = path.stat()
    return seen.st_mtime_ns, seen.st_size


def _is_meant(path: Path) -> bool:
    return (
        path.is_file()
        and not path.name.startswith(HIDDEN)
        and path.suffix.lower() not in (".toml", ".tmp", ".part")
    )
