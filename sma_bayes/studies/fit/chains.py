"""Chains that an interrupted run goes on from; once all is told, those that are soon made again are removed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from sma_bayes.records.types import Record

FOLDER: Final = "checkpoints"
COSTLY_EVALUATIONS: Final = 100_000
"""Evaluations of the log likelihood beyond which chains are kept when all is told. Fewer take a few seconds, as
`--resume` does then; they need up to three times the room of all else that is known of a record."""


def chain_path(folder: Path, records: Sequence[Record]) -> Path:
    """Where chains of records that share a posterior are kept; its parts add their names to that of the file."""
    first = records[0]
    name = first.key if len(records) == 1 else f"all-{first.branch.value}"
    return folder / FOLDER / f"{name}.h5"


def remove_chains(folder: Path, groups: Iterable[Sequence[Record]], evaluations: Mapping[str, int]) -> None:
    """Remove chains that are soon made again, once `summary.json` tells what they said.

    Parameters
    ----------
    folder : Path
    groups : iterable of sequence of Record
        Records that share a posterior each.
    evaluations : mapping of str to int
        That the posterior of a record took, by its key.
    """
    taken = {chain_path(folder, group).stem: evaluations[group[0].key] for group in groups}
    for path in (folder / FOLDER).glob("*.h5"):
        whose = [name for name in taken if path.stem.startswith(f"{name}-")]
        if whose and taken[max(whose, key=len)] <= COSTLY_EVALUATIONS:
            path.unlink(missing_ok=True)
    with suppress(OSError):  # chains that are kept, and somebody else's files, stay
        (folder / FOLDER).rmdir()
