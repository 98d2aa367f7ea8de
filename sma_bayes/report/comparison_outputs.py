"""What an output folder of a comparison holds, read back: verdicts, curves, every sample."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from sma_bayes.assess.comparison_document import SCHEMA
from sma_bayes.errors import OutputError
from sma_bayes.quantities import Floats
from sma_bayes.report.outputs import kind_of, read_columns

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
    return (folder / "comparison.json").is_file() or kind_of(folder) == "compare"


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
        {k: read_columns(folder / "curves" / f"{k}.csv", AGAIN) for k in keys},
        {k: read_columns(folder / "samples" / f"{k}.csv", AGAIN) for k in keys},
    )
