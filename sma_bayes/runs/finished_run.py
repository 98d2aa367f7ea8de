"""A finished run of any verb, as its folder holds it: the document, and the series beside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from sma_bayes.arrays import Floats
from sma_bayes.errors import OutputError
from sma_bayes.runs.documents import Document
from sma_bayes.runs.outputs import read_cells, read_columns
from sma_bayes.runs.schema import DocumentPart, read_document

M = TypeVar("M", bound=DocumentPart)


@dataclass(frozen=True, slots=True, eq=False)
class FinishedRun(Generic[M]):
    """A finished run.

    Attributes
    ----------
    folder : Path
    document : Document
        Which file holds what it found.
    found : DocumentPart
        What that holds.
    """

    folder: Path
    document: Document
    found: M

    def columns(self, file: str) -> dict[str, Floats]:
        """Columns of a CSV of numbers, by its path in the folder.

        Raises
        ------
        OutputError
            If it can't be read.
        """
        return read_columns(self.folder / file, self.document.anew(self.folder))

    def cells(self, file: str) -> dict[str, tuple[str, ...]]:
        """Columns of any CSV as text, by its path in the folder.

        Raises
        ------
        OutputError
            If it can't be read.
        """
        path = self.folder / file
        try:
            return read_cells(path)
        except (OSError, ValueError) as error:
            raise OutputError(
                f"can't be read: {error}",
                file=path,
                expected="columns as they were written",
                remedy=self.document.anew(self.folder),
            ) from None


def read_finished(
    document: Document, model: type[M], folder: Path, shown: Callable[[M], M] | None = None
) -> FinishedRun[M]:
    """Read the document of a finished run.

    Parameters
    ----------
    document : Document
    model : type of DocumentPart
        What it holds.
    folder : Path
    shown : callable, optional
        Puts what was found in the units in which people see it.

    Raises
    ------
    OutputError
        If the run is not finished, or its document can't be read, was changed or is of another version.
    """
    found = read_document(document, model, folder)
    return FinishedRun(folder, document, found if shown is None else shown(found))
