"""What an output folder of a simulation holds, read back: the document, and bands in time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from sma_bayes.arrays import Floats
from sma_bayes.runs.documents import SIMULATION
from sma_bayes.runs.outputs import read_columns
from sma_bayes.runs.schema import read_document
from sma_bayes.studies.simulate.schema import SimulationDocument


@dataclass(frozen=True, slots=True, eq=False)
class StoredSimulation:
    """A finished simulation.

    Attributes
    ----------
    folder : Path
    found : SimulationDocument
        What ``simulate.json`` holds.
    bands : mapping of str to mapping of str to ndarray
        Columns of the files in ``bands/``, by the path that the document states.
    """

    folder: Path
    found: SimulationDocument
    bands: Mapping[str, Mapping[str, Floats]]


def read_simulation(folder: Path) -> StoredSimulation:
    """Read a simulation.

    Raises
    ------
    OutputError
        If it is not finished, of another version, or a file can't be read.
    """
    found, again = read_document(SIMULATION, SimulationDocument, folder), SIMULATION.anew(folder)
    return StoredSimulation(folder, found, {r.file: read_columns(folder / r.file, again) for r in found.runs})
