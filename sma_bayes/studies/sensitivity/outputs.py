"""What an output folder of a study of sensitivity holds, read back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from sma_bayes.errors import OutputError
from sma_bayes.runs.declared_units import shown_as, units_of
from sma_bayes.runs.documents import SENSITIVITY
from sma_bayes.runs.outputs import floats, read_cells
from sma_bayes.runs.schema import read_document
from sma_bayes.studies.sensitivity.schema import SensitivityDocument
from sma_bayes.studies.sensitivity.shown import in_declared_units, name_shown


@dataclass(frozen=True, slots=True, eq=False)
class StoredSensitivity:
    """A finished study.

    Attributes
    ----------
    folder : Path
    found : SensitivityDocument
        What ``sensitivity.json`` holds, in declared units.
    readings : mapping of str to mapping of str to tuple of str
        Columns of the files in ``readings/``, by the key of the record, under the names of the numbers in `found`.
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
    stored = read_document(SENSITIVITY, SensitivityDocument, folder)
    found, units = in_declared_units(stored), units_of(stored)
    readings = {}
    for record in stored.records:
        path = folder / "readings" / f"{record.key}.csv"
        try:
            names = {q.name: name_shown(q, record.temperature_unit, units) for q in record.quantities}
            cells = {names.get(name, name): column for name, column in read_cells(path).items()}
            degrees = shown_as(record.temperature_unit, units)
            warm = floats(cells.pop(f"temperature_{record.temperature_unit}"))
            cells[f"temperature_{degrees.shown}"] = tuple(map(repr, degrees.values(warm).tolist()))
            readings[record.key] = cells
        except (OSError, ValueError, KeyError) as error:
            raise OutputError(
                f"can't be read: {error}",
                file=path,
                expected="columns as they were written",
                remedy=SENSITIVITY.anew(folder),
            ) from None
    return StoredSensitivity(folder, found, readings)
