"""What an output folder of a gap study holds, read back: verdict, series of every sample, draws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import h5py
import numpy as np
from numpy.typing import NDArray

from sma_bayes.arrays import Floats
from sma_bayes.checksum import has_its_checksum
from sma_bayes.errors import OutputError
from sma_bayes.runs.documents import GAP
from sma_bayes.runs.outputs import floats, read_cells
from sma_bayes.runs.schema import read_document
from sma_bayes.studies.gap.schema import AddedEffect, GapDocument, GapOfModel
from sma_bayes.studies.gap.store import POSTERIOR, POSTERIOR_OF_HEATING, SERIES

TEXT_COLUMNS: Final = ("condition", "branch", "channel")
"""Columns of the series that hold words."""

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Some of the samples of a study, column by column.

    Attributes
    ----------
    words : mapping of str to ndarray of str, shape (n,)
        ``condition``, ``branch``, ``channel``.
    numbers : mapping of str to ndarray, shape (n,)
        See `sma_bayes.studies.gap.series.series_columns`; NaN where a condition has no such input.
    """

    words: Mapping[str, NDArray[np.str_]]
    numbers: Mapping[str, Floats]

    @property
    def n(self) -> int:
        """Number of samples."""
        return int(self.words["condition"].size)

    def __getitem__(self, name: str) -> Floats:
        return self.numbers[name]

    def where(self, mask: Mask) -> Samples:
        """The samples for which a mask is true."""
        return Samples(
            {k: v[mask] for k, v in self.words.items()}, {k: v[mask] for k, v in self.numbers.items()}
        )

    def of(self, **wanted: str) -> Samples:
        """The samples of a condition, branch or channel."""
        mask = np.ones(self.n, dtype=bool)
        for name, value in wanted.items():
            mask &= self.words[name] == value
        return self.where(mask)

    def distinct(self, name: str) -> list[str]:
        """Conditions, branches or channels, in the order of the file."""
        return list(dict.fromkeys(self.words[name].tolist()))


@dataclass(frozen=True, slots=True, eq=False)
class StoredStudy:
    """A finished study.

    Attributes
    ----------
    folder : Path
    found : GapDocument
        What ``gap.json`` holds.
    part : GapOfModel
        What it holds of one model: the response, or the heat balance.
    samples : Samples
    draws, prior : mapping of str to ndarray
        Of the parameters of the effects, by ``<effect>.<parameter>``; ensembles (G, N), and (S,).
    heating : StoredStudy or None
        Where temperature is an outcome: the same for the heat balance.
    """

    folder: Path
    found: GapDocument
    part: GapOfModel
    samples: Samples
    draws: Mapping[str, Floats]
    prior: Mapping[str, Floats]
    heating: StoredStudy | None = None

    @property
    def effects(self) -> tuple[AddedEffect, ...]:
        """Effects in the final model, whether they are named as the cause or not."""
        return self.part.added


def read_study(folder: Path) -> StoredStudy:
    """Read a gap study.

    Raises
    ------
    OutputError
        If the study is not finished, of another version, or a file can't be read.
    """
    found = read_document(GAP, GapDocument, folder)
    parts: dict[Path, GapOfModel] = {POSTERIOR: found}
    if found.heating is not None:
        parts[POSTERIOR_OF_HEATING] = found.heating
    sampled = [place for place, part in parts.items() if part.added]
    lacking = [str(p) for p in (*sampled, SERIES) if not (folder / p).is_file()]
    if lacking:
        raise OutputError(
            f"lacks {' and '.join(lacking)}",
            file=folder,
            expected="what `gap` writes",
            remedy=GAP.anew(folder),
        )
    samples = _samples(folder / SERIES)
    draws = {place: _draws(folder, place) if place in sampled else ({}, {}) for place in parts}
    if found.heating is None:
        return StoredStudy(folder, found, found, samples, *draws[POSTERIOR])
    hot = samples.words["channel"] == "temperature"
    heating = StoredStudy(folder, found, found.heating, samples.where(hot), *draws[POSTERIOR_OF_HEATING])
    return StoredStudy(folder, found, found, samples.where(~hot), *draws[POSTERIOR], heating)


def _samples(path: Path) -> Samples:
    try:
        columns = read_cells(path)
        return Samples(
            {name: np.array(columns[name], dtype=np.str_) for name in TEXT_COLUMNS},
            {name: floats(cells) for name, cells in columns.items() if name not in TEXT_COLUMNS},
        )
    except (OSError, ValueError, KeyError) as error:
        raise OutputError(
            f"can't be read as series: {error}",
            file=path,
            expected="series as gap writes them",
            remedy=GAP.anew(path.parent),
        ) from None


def _draws(folder: Path, place: Path) -> tuple[dict[str, Floats], dict[str, Floats]]:
    path = folder / place
    try:
        if not has_its_checksum(path):
            raise OSError("its content does not have the checksum that it states")
        with h5py.File(path, "r") as file:
            names = [n for n in file["prior"] if "." in n] if "prior" in file else []
            draws = {n: np.asarray(file["posterior"][n][:], dtype=float) for n in names}
            return draws, {n: np.asarray(file["prior"][n][:], dtype=float).ravel() for n in names}
    except (OSError, KeyError) as error:
        raise OutputError(
            f"can't be read as a posterior: {error}",
            file=path,
            expected="NetCDF as gap writes it",
            remedy=GAP.anew(folder),
        ) from None
