"""What the folder of a watch holds, read back."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from sma_bayes.runs.documents import WATCH
from sma_bayes.runs.schema import read_document
from sma_bayes.studies.watch.schema import WatchDocument
from sma_bayes.studies.watch.shown import in_declared_units


@dataclass(frozen=True, slots=True, eq=False)
class StoredWatch:
    """A watch.

    Attributes
    ----------
    folder : Path
    found : WatchDocument
        What ``watch.json`` holds, in declared units.
    """

    folder: Path
    found: WatchDocument


def read_watch(folder: Path) -> StoredWatch:
    """Read a watch.

    Raises
    ------
    OutputError
        If it is of another version, was changed, or can't be read.
    """
    return StoredWatch(folder, in_declared_units(read_document(WATCH, WatchDocument, folder)))
