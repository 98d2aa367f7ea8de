"""What an output folder of a study of conditions holds, read back: effects, predictions, what was left out."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from sma_bayes.conditions.document import SCHEMA
from sma_bayes.errors import OutputError
from sma_bayes.quantities import Floats
from sma_bayes.report.outputs import kind_of, read_columns

AGAIN: Final = "study the conditions again into another folder"
FILE: Final = "conditions.json"


@dataclass(frozen=True, slots=True, eq=False)
class StoredConditions:
    """A finished study of conditions.

    Attributes
    ----------
    folder : Path
    found : mapping
        What ``conditions.json`` holds.
    """

    folder: Path
    found: Mapping[str, Any]

    def columns(self, file: str) -> dict[str, Floats]:
        """Columns of one of its series, named as in ``conditions.json``.

        Raises
        ------
        OutputError
            If it can't be read.
        """
        return read_columns(self.folder / file, AGAIN)

    def samples(self, file: str) -> dict[str, Floats]:
        """Measured samples beside the series of a condition that was left out; empty where there are none."""
        path = Path(file).with_suffix("")
        name = f"{path}-samples.csv"
        return self.columns(name) if (self.folder / name).is_file() else {}


def is_condition_study(folder: Path) -> bool:
    """Whether a folder holds a study of conditions, finished or not."""
    return (folder / FILE).is_file() or kind_of(folder) == "conditions"


def read_conditions(folder: Path) -> StoredConditions:
    """Read a study of conditions.

    Raises
    ------
    OutputError
        If it is not finished, of another version, or can't be read.
    """
    path = folder / FILE
    if not path.is_file():
        raise OutputError(
            "holds a study of conditions that is not finished",
            file=folder,
            expected=f"a folder with a {FILE}",
            remedy="give the command that started it once more, with --resume",
        )
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise OutputError(
            f"can't be read: {error}", file=path, expected="JSON as conditions writes it", remedy=AGAIN
        ) from None
    if not isinstance(found, dict) or found.get("schema") != SCHEMA:
        raise OutputError("is of another version", file=path, expected=f"the schema {SCHEMA!r}", remedy=AGAIN)
    return StoredConditions(folder, found)
