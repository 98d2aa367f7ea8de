"""What an output folder of a comparison holds, read back: verdicts, curves, every sample."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from sma_bayes.assess.comparison_document import SCHEMA
from sma_bayes.errors import OutputError
from sma_bayes.quantities import Floats

AGAIN: Final = "compare again into another folder"


@dataclass(frozen=True, slots=True, eq=False)
class StoredComparison:
    """A finished comparison.

    Attributes
    ----------
    folder : Path
    found : mapping
        What ``comparison.json`` holds.
    curves, samples : mapping of str to mapping of str to ndarray
        Columns of the files in ``curves/`` and ``samples/``, by the key of the record.
    """

    folder: Path
    found: Mapping[str, Any]
    curves: Mapping[str, Mapping[str, Floats]]
    samples: Mapping[str, Mapping[str, Floats]]


def is_comparison(folder: Path) -> bool:
    """Whether a folder holds a comparison, finished or not."""
    if (folder / "comparison.json").is_file():
        return True
    try:
        mark = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(mark, dict) and mark.get("kind") == "compare"


def read_comparison(folder: Path) -> StoredComparison:
    """Read a comparison.

    Raises
    ------
    OutputError
        If it is not finished, of another version, or a file can't be read.
    """
    path = folder / "comparison.json"
    if not path.is_file():
        raise OutputError(
            "holds a comparison that is not finished",
            file=folder,
            expected="a folder with a comparison.json",
            remedy="give the command that started it once more, with --resume",
        )
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise OutputError(
            f"can't be read: {error}", file=path, expected="JSON as compare writes it", remedy=AGAIN
        ) from None
    if not isinstance(found, dict) or found.get("schema") != SCHEMA:
        raise OutputError("is of another version", file=path, expected=f"the schema {SCHEMA!r}", remedy=AGAIN)
    keys = [r["key"] for r in found["records"]]
    return StoredComparison(
        folder,
        found,
        {k: _columns(folder / "curves" / f"{k}.csv") for k in keys},
        {k: _columns(folder / "samples" / f"{k}.csv") for k in keys},
    )


def _columns(path: Path) -> dict[str, Floats]:
    try:
        with path.open(encoding="utf-8", newline="") as file:
            header, *rows = csv.reader(file)
        cells = zip(*rows, strict=True)
        return {
            name: np.array([float(c) if c else np.nan for c in column])
            for name, column in zip(header, cells, strict=True)
        }
    except (OSError, ValueError) as error:
        raise OutputError(
            f"can't be read: {error}", file=path, expected="columns as compare writes them", remedy=AGAIN
        ) from None
