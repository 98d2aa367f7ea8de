"""What an output folder of a card holds, read back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.errors import OutputError
from sma_bayes.runs.documents import CARD
from sma_bayes.runs.outputs import read_cells, read_columns
from sma_bayes.runs.schema import read_document
from sma_bayes.studies.card.schema import CardDocument


@dataclass(frozen=True, slots=True, eq=False)
class StoredCard:
    """A card.

    Attributes
    ----------
    folder : Path
    found : CardDocument
        What ``card.json`` holds.
    draws : mapping of str to ndarray, shape (S,)
        Constants by name; empty where there are none.
    curves, stiffness : mapping of str to tuple of str
        Columns of ``constitutive-curves.csv`` and of ``stiffness.csv``; empty where there is none.
    """

    folder: Path
    found: CardDocument
    draws: Mapping[str, Floats]
    curves: Mapping[str, tuple[str, ...]]
    stiffness: Mapping[str, tuple[str, ...]]


def read_card(folder: Path) -> StoredCard:
    """Read a card.

    Raises
    ------
    OutputError
        If it is not finished, of another version, or a file can't be read.
    """
    found, again = read_document(CARD, CardDocument, folder), CARD.anew(folder)
    draws: dict[str, Floats] = {}
    if found.constitutive is not None:
        columns = read_columns(folder / "constitutive-draws.csv", again)
        draws = {name.partition(" [")[0]: np.asarray(values) for name, values in columns.items()}
    return StoredCard(
        folder,
        found,
        draws,
        _cells(folder / "constitutive-curves.csv", again) if found.constitutive is not None else {},
        _cells(folder / "stiffness.csv", again) if found.stiffness else {},
    )


def _cells(path: Path, again: str) -> dict[str, tuple[str, ...]]:
    try:
        return read_cells(path)
    except (OSError, ValueError) as error:
        raise OutputError(
            f"can't be read: {error}", file=path, expected="columns as they were written", remedy=again
        ) from None
