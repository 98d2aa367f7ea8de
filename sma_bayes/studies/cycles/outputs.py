"""What an output folder of a study of cycles holds, read back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from sma_bayes.arrays import Floats
from sma_bayes.quantities import quantity_of
from sma_bayes.runs.declared_units import shown_columns, units_of
from sma_bayes.runs.documents import CYCLES
from sma_bayes.runs.outputs import read_columns
from sma_bayes.runs.schema import read_document
from sma_bayes.studies.cycles.schema import CyclesDocument
from sma_bayes.studies.cycles.shown import in_declared_units


@dataclass(frozen=True, slots=True, eq=False)
class StoredCycles:
    """A finished study of cycles.

    Attributes
    ----------
    folder : Path
    found : CyclesDocument
        What ``cycles.json`` holds, in declared units.
    """

    folder: Path
    found: CyclesDocument

    def curves(self, condition: str, branch: str, channel: str) -> Mapping[str, Floats]:
        """Columns of the curves of a channel, cycle by cycle, in declared units.

        Raises
        ------
        OutputError
            If they can't be read.
        """
        path = self.folder / "curves" / f"{condition}-{branch}-{channel}.csv"
        columns = read_columns(path, CYCLES.anew(self.folder))
        specimen = self.found.specimen
        quantity = quantity_of(channel, specimen=specimen)
        return shown_columns(columns, units_of(self.found, specimen=specimen), quantity, kept=("cycle",))


def read_cycles(folder: Path) -> StoredCycles:
    """Read a study of cycles.

    Raises
    ------
    OutputError
        If it is not finished, of another version, or can't be read.
    """
    return StoredCycles(folder, in_declared_units(read_document(CYCLES, CyclesDocument, folder)))
