"""Parts of a summary: what is known of a condition once it is finished, kept until `summary.json` holds all of it."""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Final
from zipfile import BadZipFile

import numpy as np

from sma_bayes.account import Account
from sma_bayes.assess.correlation import Agreement
from sma_bayes.assess.correlation_average import Scored
from sma_bayes.assess.loops import QuantityInterval
from sma_bayes.errors import OutputError
from sma_bayes.runs.fit_document import RecordSummary
from sma_bayes.runs.store import write_file

FOLDER: Final = "parts"
_SUMS: Final = tuple(f.name for f in fields(Agreement) if f.name not in ("n", "parameters"))
_NAMES: Final = tuple(f.name for f in fields(Scored) if f.name != "agreement")


@dataclass(frozen=True, eq=False)
class Part:
    """What a summary says of some records.

    Attributes
    ----------
    records : list of RecordSummary
    loops : list of QuantityInterval
    scored : list of Scored
        Draws of the correlation factors, for their averages.
    account : Account
        Of the stages; empty for what an earlier call has finished.
    """

    records: list[RecordSummary]
    loops: list[QuantityInterval]
    scored: list[Scored]
    account: Account = field(default_factory=Account)


def part_path(folder: Path, condition: str) -> Path:
    """Where the part of a condition is kept."""
    return folder / FOLDER / f"{condition}.npz"


def write_part(folder: Path, condition: str, part: Part) -> None:
    """Write the part of a condition, whole or not at all; see `write_file`."""
    document = {
        "records": [r.as_json() for r in part.records],
        "loops": [q.as_json() for q in part.loops],
        "scored": [
            {**{name: getattr(s, name) for name in _NAMES}, "n": s.agreement.n, "p": s.agreement.parameters}
            for s in part.scored
        ],
    }
    sums = {f"{i}-{name}": getattr(s.agreement, name) for i, s in enumerate(part.scored) for name in _SUMS}
    text = np.array(json.dumps(document))
    write_file(
        part_path(folder, condition),
        lambda path: np.savez(path, allow_pickle=False, document=text, **sums),
        nbytes=text.nbytes + sum(a.nbytes for a in sums.values()),
    )


def read_part(folder: Path, condition: str) -> Part:
    """Read what `write_part` wrote.

    Raises
    ------
    OutputError
        If it can't be read.
    """
    path = part_path(folder, condition)
    try:
        with path.open("rb") as raw, np.load(raw, allow_pickle=False) as file:
            document = json.loads(str(file["document"]))
            scored = [
                Scored(
                    **{name: s[name] for name in _NAMES},
                    agreement=Agreement(s["n"], s["p"], *(file[f"{i}-{name}"] for name in _SUMS)),
                )
                for i, s in enumerate(document["scored"])
            ]
        return Part(
            [RecordSummary.model_validate(r) for r in document["records"]],
            [QuantityInterval.model_validate(q) for q in document["loops"]],
            scored,
        )
    except (OSError, EOFError, ValueError, KeyError, TypeError, BadZipFile) as error:
        raise OutputError(
            f"can't be read: {error}",
            file=path,
            expected="what fit wrote there",
            remedy="remove the file; --resume then makes it again",
        ) from None


def remove_parts(folder: Path) -> None:
    """Remove what `summary.json` holds as well, once it is there."""
    for path in (folder / FOLDER).glob("*.npz"):
        path.unlink(missing_ok=True)
    with suppress(OSError):  # somebody else's file in it does no harm
        (folder / FOLDER).rmdir()
