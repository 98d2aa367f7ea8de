"""What an output folder of a study of moduli holds, read back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from sma_bayes.arrays import Floats
from sma_bayes.runs.documents import MODULUS
from sma_bayes.runs.outputs import read_columns
from sma_bayes.runs.schema import read_document
from sma_bayes.studies.modulus.schema import ModulusDocument


@dataclass(frozen=True, slots=True, eq=False)
class StoredModulus:
    """A finished study of moduli.

    Attributes
    ----------
    folder : Path
    found : ModulusDocument
        What ``modulus.json`` holds.
    """

    folder: Path
    found: ModulusDocument

    def bands(self, sweep: str) -> Mapping[str, Floats]:
        """Columns of the bands of a sweep.

        Raises
        ------
        OutputError
            If they can't be read.
        """
        return read_columns(self.folder / "bands" / f"{sweep}.csv", MODULUS.anew(self.folder))

    def samples(self, sweep: str) -> Mapping[str, Floats]:
        """Columns of the samples of a sweep that were fitted; the loss modulus has temperatures of its own."""
        return read_columns(self.folder / "samples" / f"{sweep}.csv", MODULUS.anew(self.folder))


def read_modulus(folder: Path) -> StoredModulus:
    """Read a study of moduli.

    Raises
    ------
    OutputError
        If it is not finished, of another version, or can't be read.
    """
    return StoredModulus(folder, read_document(MODULUS, ModulusDocument, folder))
