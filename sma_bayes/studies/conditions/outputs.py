"""What an output folder of a study of conditions holds, read back: effects, predictions, what was left out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from sma_bayes.arrays import Floats
from sma_bayes.runs.documents import CONDITIONS
from sma_bayes.runs.outputs import read_columns
from sma_bayes.runs.schema import read_document
from sma_bayes.studies.conditions.schema import ConditionsDocument


@dataclass(frozen=True, slots=True, eq=False)
class StoredConditions:
    """A finished study of conditions.

    Attributes
    ----------
    folder : Path
    found : ConditionsDocument
        What ``conditions.json`` holds.
    """

    folder: Path
    found: ConditionsDocument

    def columns(self, file: str) -> dict[str, Floats]:
        """Columns of one of its series, named as in ``conditions.json``.

        Raises
        ------
        OutputError
            If it can't be read.
        """
        return read_columns(self.folder / file, CONDITIONS.anew(self.folder))

    def samples(self, file: str) -> dict[str, Floats]:
        """Measured samples beside the series of a condition that was left out; empty where there are none."""
        path = Path(file).with_suffix("")
        name = f"{path}-samples.csv"
        return self.columns(name) if (self.folder / name).is_file() else {}


def read_conditions(folder: Path) -> StoredConditions:
    """Read a study of conditions.

    Raises
    ------
    OutputError
        If it is not finished, of another version, or can't be read.
    """
    return StoredConditions(folder, read_document(CONDITIONS, ConditionsDocument, folder))
