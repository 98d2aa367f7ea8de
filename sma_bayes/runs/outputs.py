"""What an output folder of a `fit` run holds, read back: summary, priors, bands, posteriors, measurements."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.checksum import KEY, netcdf_checksum
from sma_bayes.errors import OutputError, first_of
from sma_bayes.fitting.discrepancy import DiscrepancyBasis
from sma_bayes.fitting.sweep_functions import SweepFunctions
from sma_bayes.runs.documents import (
    CARD,
    COMPARISON,
    CONDITIONS,
    FINISH_HINT,
    FIT,
    GAP,
    RUN_MARKER,
    SENSITIVITY,
    SIMULATION,
    STUDY,
    refuse_another,
)
from sma_bayes.runs.fit_document import FitSummary, read_fit
from sma_bayes.runs.store import FUNCTIONS, MEASURED_SWEEPS, NODE, OF_SWEEPS, WEIGHTS, unguarded_text

BAND_COLUMNS: Final = ("q05", "q25", "q50", "q75", "q95", "pred_q05", "pred_q95")
"""Quantiles of a band that figures show."""


_DAMAGED: Final = (
    OSError,
    KeyError,
    ValueError,
    TypeError,
    RuntimeError,
    AttributeError,
    IndexError,
    MemoryError,
)
"""What HDF5 and its readers raise of a damaged file."""


@dataclass(frozen=True, slots=True, eq=False)
class StoredRun:
    """A finished run.

    Attributes
    ----------
    folder : Path
    summary : FitSummary
        What ``summary.json`` holds.
    priors : str
        Text of ``priors.toml``; empty where there is none.
    """

    folder: Path
    summary: FitSummary
    priors: str


@dataclass(frozen=True, slots=True, eq=False)
class StoredBand:
    """Bands of one channel of one record.

    Attributes
    ----------
    temperature : ndarray, shape (m,)
        [unit of temperature].
    quantiles : mapping of str to ndarray, shape (m,)
        By the names in `BAND_COLUMNS` [unit of the channel]; NaN where there is no such quantile.
    extrapolated : ndarray of bool, shape (m,)
        True beyond the observed temperatures.
    """

    temperature: Floats
    quantiles: Mapping[str, Floats]
    extrapolated: np.ndarray[tuple[int], np.dtype[np.bool_]]


@dataclass(frozen=True, slots=True, eq=False)
class StoredRecord:
    """One record's measurements and draws.

    Attributes
    ----------
    key : str
        Condition and branch, as `Record.key` has them.
    model, noise : str
        Names of the response model and of the noise model.
    observed : mapping of str to ndarray, shape (n,)
        Channels [unit of the channel].
    inputs : mapping of str to ndarray, shape (n,)
        Temperature, and time, cycle, segment where there are any.
    row : ndarray of int, shape (n,)
        Source line of each sample.
    draws : mapping of str to ndarray, shape (G, N)
        Parameters; G ensembles of N draws.
    prior_curves : mapping of str to ndarray, shape (S, m)
        Curves of draws from the prior.
    prior_temperature : ndarray, shape (m,)
    discrepancy : mapping of str to tuple of ndarray
        Channel to nodes (k,), values of the functions there (k, f), and weights (G N, f) of what the curve misses.
    sweep_functions : mapping of str to ndarray
        Channel to values at these nodes of the functions of what a sweep has of its own (k, q).
    measured_sweeps : mapping of str to ndarray, shape (G, N)
        Parameters of the curve of the measured sweeps, those that differ from the parameters of the curve of all.
    """

    key: str
    model: str
    noise: str
    observed: Mapping[str, Floats]
    inputs: Mapping[str, Floats]
    row: np.ndarray[tuple[int], np.dtype[np.int64]]
    draws: Mapping[str, Floats]
    prior_curves: Mapping[str, Floats]
    prior_temperature: Floats
    discrepancy: Mapping[str, tuple[Floats, Floats, Floats]] = field(default_factory=dict)
    sweep_functions: Mapping[str, Floats] = field(default_factory=dict)
    measured_sweeps: Mapping[str, Floats] = field(default_factory=dict)

    def bases(self) -> dict[str, DiscrepancyBasis]:
        """Basis of what each curve misses, by channel."""
        at = self.inputs["temperature"]
        found = {}
        for c, (nodes, values, _) in self.discrepancy.items():
            own = self.sweep_functions.get(c)
            apart = None if own is None else SweepFunctions.tabulated(nodes, own, self.inputs)
            found[c] = replace(DiscrepancyBasis.tabulated(nodes, values, at), sweep_functions=apart)
        return found


def posterior_path(folder: Path, key: str) -> Path:
    """Where the posterior of a record is."""
    return folder / "posterior" / f"{key}.nc"


def band_path(folder: Path, key: str, channel: str) -> Path:
    """Where the bands of a channel of a record are."""
    return folder / "bands" / f"{key}-{channel}.csv"


def read_run(folder: Path) -> StoredRun:
    """Read the summary of a run and check that all of its files are there.

    Raises
    ------
    OutputError
        If the folder holds no run, an unfinished one, or one of another version.
    """
    if not folder.is_dir():
        raise OutputError(
            "is not a folder", file=folder, expected="the output folder of a fit", remedy="check the path"
        )
    if not (folder / FIT.file).is_file():
        others = (GAP, CARD, COMPARISON, CONDITIONS, SENSITIVITY, SIMULATION, STUDY)
        other = next((d for d in others if (folder / d.file).is_file()), None)
        if other:
            raise OutputError(
                f"holds {other.what}, no fit",
                file=folder,
                expected="a folder with a summary.json",
                remedy="name the folder that was given to fit as --out; of a study the one called fit",
            )
        begun = (folder / RUN_MARKER).is_file()
        raise OutputError(
            "holds a run that is not finished" if begun else "holds no run of sma_bayes",
            file=folder,
            expected="a folder with a summary.json",
            remedy=FINISH_HINT if begun else "name the folder that was given to fit as --out",
        )
    summary = read_fit(folder)
    missing = _missing(folder, summary)
    if missing:
        raise OutputError(
            f"lacks {first_of(missing, 3)}",
            file=folder,
            expected="a posterior and bands for each record of summary.json",
            remedy=FINISH_HINT,
        )
    priors = folder / "priors.toml"
    return StoredRun(folder, summary, priors.read_text(encoding="utf-8") if priors.is_file() else "")


def read_columns(path: Path, again: str) -> dict[str, Floats]:
    """Read a CSV of numbers and of true or false, as 1 and 0.

    Parameters
    ----------
    path : Path
    again : str
        What to do if it can't be read.

    Raises
    ------
    OutputError
        If it can't.
    """
    truth = {"true": "1", "false": "0"}
    try:
        return {
            name: floats(tuple(truth.get(cell, cell) for cell in column))
            for name, column in read_cells(path).items()
        }
    except (OSError, ValueError) as error:
        raise OutputError(
            f"can't be read: {error}", file=path, expected="columns as they were written", remedy=again
        ) from None


def _missing(folder: Path, summary: FitSummary) -> list[str]:
    wanted = [
        path
        for record in summary.records
        for path in (
            posterior_path(folder, record.key),
            *(band_path(folder, record.key, channel) for channel in record.quantities),
        )
    ]
    return [str(path.relative_to(folder)) for path in wanted if not path.is_file()]


def band_of(folder: Path, key: str, channel: str, checksum: str | None) -> StoredBand:
    """Read the bands of a channel that belong to an entry of ``summary.json``, by its key and checksum.

    Raises
    ------
    OutputError
        If the file is not, byte by byte, the one that the run wrote; and as `read_band`.
    """
    path = band_path(folder, key, channel)
    refuse_another(path, checksum, "band that summary.json tells of", "fit again into another folder")
    return read_band(path)


def read_band(path: Path) -> StoredBand:
    """Read a band.

    Raises
    ------
    OutputError
        If the file is not one that `fit` wrote.
    """
    try:
        columns = read_cells(path)
        temperature = next(values for name, values in columns.items() if name.startswith("temperature_"))
        return StoredBand(
            floats(temperature),
            {name: floats(columns[name]) for name in BAND_COLUMNS},
            np.array([value == "true" for value in columns["extrapolated"]], dtype=np.bool_),
        )
    except (OSError, ValueError, KeyError, StopIteration) as error:
        raise OutputError(
            f"can't be read as a band: {error}",
            file=path,
            expected="a band as fit writes it",
            remedy=FINISH_HINT,
        ) from None


def read_cells(path: Path) -> dict[str, tuple[str, ...]]:
    """Read a CSV as text, column by column.

    Raises
    ------
    OSError, ValueError
        If it can't be read, or its rows are of different lengths.
    """
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    columns = [tuple(map(unguarded_text, column)) for column in zip(*rows, strict=True)]
    return dict(zip(map(unguarded_text, header), columns, strict=True))


def floats(cells: tuple[str, ...]) -> Floats:
    """Numbers of a column; NaN where a cell is empty."""
    return np.array([float(cell) if cell else np.nan for cell in cells])


def read_record(path: Path, *, whole: bool = False) -> StoredRecord:
    """Read a record's measurements and draws from its NetCDF file.

    Parameters
    ----------
    path : Path
    whole : bool
        Whether the file is known to be the one that was written, byte by byte; its content is not looked at again then.

    Raises
    ------
    OutputError
        If the file is not one that `fit` wrote, was changed since, or is that of another record.
    """
    stored = _read_record(path, whole=whole)
    if stored.key != path.stem:
        raise OutputError(
            f"holds the posterior of {stored.key!r}",
            file=path,
            expected=f"that of {path.stem!r}",
            remedy="take the file from a copy; or fit again into another folder",
        )
    return stored


def posterior_of(folder: Path, key: str, checksum: str | None) -> StoredRecord:
    """Read the posterior that belongs to an entry of ``summary.json``, by its key and checksum.

    Raises
    ------
    OutputError
        If the file is not, byte by byte, the one that the run wrote; and as `read_record`.
    """
    path = posterior_path(folder, key)
    refuse_another(path, checksum, "posterior that summary.json tells of", "fit again into another folder")
    return read_record(path, whole=True)


def _read_record(path: Path, *, whole: bool) -> StoredRecord:
    try:
        with h5py.File(path, "r") as file:
            if not whole and netcdf_checksum(file) != file.attrs[KEY]:
                raise OSError("its content does not have the checksum that it states")
            constant, prior = file["constant_data"], file["prior_predictive"]
            return StoredRecord(
                key=f"{file.attrs['condition']}-{file.attrs['branch']}",
                model=str(file.attrs["model"]),
                noise=str(file.attrs["noise"]),
                observed=_variables(file["observed_data"], skip={"obs", *constant}),
                inputs=_variables(
                    constant, skip={"obs", "row", *(name for name in constant if "_discrepancy_" in name)}
                ),
                row=np.asarray(constant["row"][:], dtype=np.int64),
                draws=_variables(file["posterior"], skip={"chain", "draw"}),
                prior_curves={
                    name: curves[0] for name, curves in
                    _variables(prior, skip={"chain", "draw", "temperature"}).items()
                },
                prior_temperature=np.asarray(prior["temperature"][:], dtype=float),
                discrepancy=_discrepancy(constant, file["sample_stats"]),
                sweep_functions={
                    name.removesuffix(OF_SWEEPS): np.asarray(constant[name][:], dtype=float)
                    for name in constant
                    if name.endswith(OF_SWEEPS)
                },
                measured_sweeps={
                    name.removesuffix(MEASURED_SWEEPS): np.asarray(values[:], dtype=float)
                    for name, values in file["sample_stats"].items()
                    if name.endswith(MEASURED_SWEEPS)
                },
            )  # fmt: skip
    except _DAMAGED as error:
        raise OutputError(
            f"can't be read as a posterior: {error}",
            file=path,
            expected="NetCDF as fit wrote it",
            remedy=FINISH_HINT,
        ) from None


def _discrepancy(constant: Any, stats: Any) -> dict[str, tuple[Floats, Floats, Floats]]:
    """What each curve misses, by channel."""
    found = {}
    for name in constant:
        if name.endswith(FUNCTIONS):
            channel = name.removesuffix(FUNCTIONS)
            weights = np.asarray(stats[f"{channel}{WEIGHTS}"][:], dtype=float)
            found[channel] = (
                np.asarray(constant[f"{channel}{NODE}"][:], dtype=float),
                np.asarray(constant[name][:], dtype=float),
                weights.reshape(-1, weights.shape[-1]),
            )
    return found


def _variables(group: Any, skip: set[str]) -> dict[str, Floats]:
    return {name: np.asarray(group[name][:], dtype=float) for name in group if name not in skip}
