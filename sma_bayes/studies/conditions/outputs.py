"""What an output folder of a study of conditions holds, read back: effects, predictions, what was left out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from sma_bayes.arrays import Floats
from sma_bayes.quantities import quantity_of
from sma_bayes.runs.declared_units import Shown, shown_columns, units_of
from sma_bayes.runs.documents import CONDITIONS
from sma_bayes.runs.outputs import read_columns
from sma_bayes.runs.schema import read_document
from sma_bayes.studies.conditions.schema import ConditionsDocument
from sma_bayes.studies.conditions.shown import in_declared_units


@dataclass(frozen=True, slots=True, eq=False)
class StoredConditions:
    """A finished study of conditions.

    Attributes
    ----------
    folder : Path
    found : ConditionsDocument
        What ``conditions.json`` holds, in declared units.
    units : mapping of str to ShownUnit
        How each quantity and setting is shown.
    """

    folder: Path
    found: ConditionsDocument
    units: Shown

    def columns(self, file: str, channel: str) -> dict[str, Floats]:
        """Columns of one of its series, named as in ``conditions.json``, in declared units.

        Parameters
        ----------
        file : str
        channel : str
            Whose series it is.

        Raises
        ------
        OutputError
            If it can't be read.
        """
        columns = read_columns(self.folder / file, CONDITIONS.anew(self.folder))
        quantity = quantity_of(channel, specimen=self.found.specimen)
        return shown_columns(columns, self.units, quantity, kept=("row", "extrapolated"))

    def samples(self, file: str, channel: str) -> dict[str, Floats]:
        """Measured samples beside the series of a condition that was left out; empty where there are none."""
        path = Path(file).with_suffix("")
        name = f"{path}-samples.csv"
        return self.columns(name, channel) if (self.folder / name).is_file() else {}


def read_conditions(folder: Path) -> StoredConditions:
    """Read a study of conditions.

    Raises
    ------
    OutputError
        If it is not finished, of another version, or can't be read.
    """
    found = read_document(CONDITIONS, ConditionsDocument, folder)
    units = units_of(found, specimen=found.specimen)
    return StoredConditions(folder, in_declared_units(found), units)
