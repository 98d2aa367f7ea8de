"""What an output folder of a comparison holds, read back: verdicts, curves, every sample."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from sma_bayes.arrays import Floats
from sma_bayes.runs.documents import COMPARISON
from sma_bayes.runs.outputs import read_columns
from sma_bayes.runs.schema import read_document
from sma_bayes.studies.compare.schema import ComparisonDocument


@dataclass(frozen=True, slots=True, eq=False)
class StoredComparison:
    """A finished comparison.

    Attributes
    ----------
    folder : Path
    found : ComparisonDocument
        What ``comparison.json`` holds.
    curves, samples : mapping of str to mapping of str to ndarray
        Columns of the files in ``curves/`` and ``samples/``, by the key of the record.
    """

    folder: Path
    found: ComparisonDocument
    curves: Mapping[str, Mapping[str, Floats]]
    samples: Mapping[str, Mapping[str, Floats]]


def read_comparison(folder: Path) -> StoredComparison:
    """Read a comparison.

    Raises
    ------
    OutputError
        If it is not finished, of another version, or a file can't be read.
    """
    found, again = read_document(COMPARISON, ComparisonDocument, folder), COMPARISON.anew(folder)
    keys = [r.key for r in found.records]
    return StoredComparison(
        folder,
        found,
        {k: read_columns(folder / "curves" / f"{k}.csv", again) for k in keys},
        {k: read_columns(folder / "samples" / f"{k}.csv", again) for k in keys},
    )
