"""The JSON documents of an output folder: the mark of its run, and what the run found, by the verb that writes it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from sma_bayes.checksum import KEY, document_checksum, file_checksum
from sma_bayes.document_part import plain
from sma_bayes.errors import OutputError
from sma_bayes.limits import DOCUMENT_BYTES

RUN_MARKER: Final = "run.json"
"""File that tells to which run a folder belongs."""
FILES: Final = "files_sha256"
"""Key of the checksums of the files beside a document."""
RERUN_HINT: Final = "give the command that started it once more, with --resume"
FINISH_HINT: Final = f"finish it: {RERUN_HINT}"


def read_mark(folder: Path) -> dict[str, Any] | None:
    """What the mark of a folder says; None where there is none, or none that says anything."""
    try:
        mark = json.loads((folder / RUN_MARKER).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    return mark if isinstance(mark, dict) else None


def sealed(document: Mapping[str, Any]) -> dict[str, Any]:
    """Document as it is written: values that JSON knows, and a checksum of all of them."""
    stated: dict[str, Any] = plain(document)
    return {**stated, KEY: document_checksum(stated)}


def files_beside(folder: Path) -> dict[str, str]:
    """SHA-256 of each CSV of results in a folder, tables and data of figures left out, by its path there."""
    made_anew = {"tables", "figures"}
    paths = (p.relative_to(folder) for p in sorted(folder.rglob("*.csv")))
    return {p.as_posix(): file_checksum(folder / p) for p in paths if p.parts[0] not in made_anew}


def refuse_another(path: Path, checksum: str | None, what: str, anew: str) -> None:
    """Refuse a file that is not, byte by byte, the one whose checksum a document states.

    One that is not there is left to its reader, who misses it.

    Parameters
    ----------
    path : Path
    checksum : str or None
        As stated.
    what : str
        What it should be: ``band that summary.json tells of``.
    anew : str
        What else to do than to take both from one run.

    Raises
    ------
    OutputError
        If it is another.
    """
    if path.is_file() and file_checksum(path) != checksum:
        raise OutputError(
            f"is not the {what}, or was changed since",
            file=path,
            expected="the file that the same run wrote",
            remedy=f"take both from one run; or {anew}",
        )


@dataclass(frozen=True, slots=True)
class Document:
    """What a verb writes of what it found.

    Attributes
    ----------
    verb : str
        ``gap``; the mark of a folder names it as its kind.
    file : str
        ``gap.json``. It is written last, so it tells that the run came to its end.
    schema : str
    what : str
        What a folder with it holds: ``a gap study``.
    keys : tuple of str
        What it must hold.
    """

    verb: str
    file: str
    schema: str
    what: str
    keys: tuple[str, ...] = ()

    def is_in(self, folder: Path) -> bool:
        """Whether a folder holds such a run, finished or not."""
        return (folder / self.file).is_file() or (read_mark(folder) or {}).get("kind") == self.verb

    def anew(self, folder: Path) -> str:
        """What to do where something beside the document can't be used."""
        return f"remove {folder / self.file} and {RERUN_HINT}"

    def read(self, folder: Path) -> dict[str, Any]:
        """What a finished run found.

        Raises
        ------
        OutputError
            If the run is not finished, or its document can't be read or is of another version.
        """
        path = folder / self.file
        if not path.is_file():
            raise OutputError(
                f"holds {self.what} that is not finished",
                file=folder,
                expected=f"a folder with a {self.file}",
                remedy=FINISH_HINT,
            )
        try:
            if path.stat().st_size > DOCUMENT_BYTES.value:
                raise ValueError(f"it has more than {DOCUMENT_BYTES.value} bytes")
            found = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError) as error:
            why = "values too deep inside each other" if isinstance(error, RecursionError) else error
            raise OutputError(
                f"can't be read: {why}",
                file=path,
                expected=f"JSON as {self.verb} writes it",
                remedy=f"remove it and {RERUN_HINT}",
            ) from None
        schema = found.get("schema") if isinstance(found, dict) else None
        if schema != self.schema:
            raise OutputError(
                f"has the schema {schema!r}",
                file=path,
                expected=f"the schema {self.schema!r}",
                remedy=self.in_another_folder,
            )
        lacking = [key for key in self.keys if key not in found]
        if lacking:
            raise OutputError(
                f"lacks {' and '.join(map(repr, lacking))}",
                file=path,
                expected=self.as_declared,
                remedy=self.in_another_folder,
            )
        if found.get(KEY) != document_checksum(found):
            raise OutputError(
                "is not as it was written: its content does not have the checksum that it states",
                file=path,
                expected=f"what {self.verb} wrote, unchanged",
                remedy=f"take it from a copy; or remove it and {RERUN_HINT}",
            )
        for name, checksum in found.get(FILES, {}).items():
            refuse_another(folder / name, checksum, f"file that {self.file} tells of", self.anew(folder))
        return dict(found)

    @property
    def as_declared(self) -> str:
        """What is expected of its keys."""
        return f"what this version of sma_bayes writes under the schema {self.schema!r}"

    @property
    def in_another_folder(self) -> str:
        """What to do where it is of another version."""
        return f"{self.verb} again into another folder, with this version of sma_bayes"


FIT: Final = Document("fit", "summary.json", "sma-bayes/fit/1", "a fit", ("records",))
CARD: Final = Document("card", "card.json", "sma-bayes/card/1", "a card", ("constitutive", "stiffness"))
COMPARISON: Final = Document(
    "compare",
    "comparison.json",
    "sma-bayes/comparison/1",
    "a comparison of models",
    ("records", "overall"),
)
GAP: Final = Document(
    "gap", "gap.json", "sma-bayes/gap/1", "a gap study", ("effects", "partial", "thresholds", "gap")
)
CONDITIONS: Final = Document(
    "conditions",
    "conditions.json",
    "sma-bayes/conditions/1",
    "a study of conditions",
    ("groups", "features", "effects", "predictions", "held_out"),
)
CYCLES: Final = Document(
    "cycles", "cycles.json", "sma-bayes/cycles/1", "a study of cycles", ("conditions", "options")
)
SENSITIVITY: Final = Document(
    "sensitivity",
    "sensitivity.json",
    "sma-bayes/sensitivity/1",
    "a study of sensitivity",
    ("records", "conclusion"),
)
SIMULATION: Final = Document(
    "simulate",
    "simulate.json",
    "sma-bayes/simulation/1",
    "a simulation",
    ("balance", "runs", "reach"),
)
MODULUS: Final = Document(
    "modulus",
    "modulus.json",
    "sma-bayes/modulus/1",
    "a study of moduli",
    ("sweeps", "shifts", "options"),
)
WATCH: Final = Document(
    "watch", "watch.json", "sma-bayes/watch/1", "a watch", ("verdict", "cycles", "numbers")
)
PLAN: Final = Document("plan", "plan.json", "sma-bayes/plan/1", "a plan", ("candidates", "advice"))
STUDY: Final = Document("study", "study.json", "sma-bayes/study/1", "the folders of a study")
