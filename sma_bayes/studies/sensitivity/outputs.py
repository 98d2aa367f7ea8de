"""What an output folder of a study of sensitivity holds, read back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from sma_bayes.errors import OutputError
from sma_bayes.runs.documents import SENSITIVITY
from sma_bayes.runs.outputs import read_cells
from sma_bayes.runs.schema import read_document
from sma_bayes.studies.sensitivity.schema import SensitivityDocument


@dataclass(frozen=True, slots=True, eq=False)
class StoredSensitivity:
    """A finished study.

    Attributes
    ----------
    folder : Path
    found : SensitivityDocument
        What ``sensitivity.json`` holds.
    readings : mapping of str to mapping of str to tuple of str
        Columns of the files in ``readings/``, by the key of the record.
    """

    folder: Path
    found: SensitivityDocument
    readings: Mapping[str, Mapping[str, tuple[str, ...]]]


def read_sensitivity(folder: Path) -> StoredSensitivity:
    """Read a study of sensitivity.

    Raises
    ------
    OutputError
        If it is not finished, of another version, or a file can't be read.
    """
    found = read_document(SENSITIVITY, SensitivityDocument, folder)
    readings = {}
    for record in found.records:
        path = folder / "readings" / f"{record.key}.csv"
        try:
            readings[record.key] = read_cells(path)
        except (OSError, ValueError) as error:
            raise OutputError(
                f"can't be read: {error}",
                file=path,
                expected="columns as they were written",
                remedy=SENSITIVITY.anew(folder),
            ) from None
    return StoredSensitivity(folder, found, readings)
