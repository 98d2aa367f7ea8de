"""New cycles, read as the campaign of the fit declares its files."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.checksum import file_checksum
from sma_bayes.errors import (
    CampaignError,
    MeasurementError,
    SmaBayesError,
    UnknownNameError,
    many,
    near_matches,
)
from sma_bayes.quantities import unit_text
from sma_bayes.records.campaign import DEFAULT_SETTINGS
from sma_bayes.records.declaration import CAMPAIGN_FILE, DeclaredCondition, declared_for_file
from sma_bayes.records.formats import recognise
from sma_bayes.records.mapping import read_run as read_columns
from sma_bayes.records.plausibility import require_possible
from sma_bayes.records.run import Run
from sma_bayes.records.split import split_run
from sma_bayes.records.types import Record
from sma_bayes.studies.cycles.sweeps import LEAST_SAMPLES, sweeps_of

LEAST_COVERED_SHARE: Final = 0.9
"""Share of the temperatures of the fitted sweeps that a whole sweep covers."""
TEXT: Final = ("delimited", "lvm")
"""Formats of lines, the last of which may not be whole."""
UNREDUCED: Final = 10**9


@dataclass(frozen=True, slots=True, eq=False)
class FittedSweeps:
    """What whole sweeps of one branch are.

    Attributes
    ----------
    record : Record
        As it was fitted.
    """

    record: Record

    @property
    def ends(self) -> tuple[float, float]:
        """Lowest and highest temperature."""
        return float(self.record.temperature.min()), float(self.record.temperature.max())

    def covered(self, temperature: Floats) -> float:
        """Share of these temperatures that others cover."""
        low, high = self.ends
        common = min(high, float(temperature.max())) - max(low, float(temperature.min()))
        return max(common, 0.0) / (high - low)


@dataclass(frozen=True, slots=True, eq=False)
class NewCycle:
    """One whole cycle of a file.

    Attributes
    ----------
    cycle : float
        Its number in the file.
    sha256 : str
        Of its first samples, by which it is known again where the file has grown.
    sweeps : mapping of str to Record
        One sweep of each branch.
    """

    cycle: float
    sha256: str
    sweeps: Mapping[str, Record]


@dataclass(frozen=True, slots=True, eq=False)
class NewFile:
    """What a file of new cycles holds.

    Attributes
    ----------
    path : Path
    sha256 : str
    cycles : tuple of NewCycle
    partial : tuple of str
        Cycles that are not whole, in words.
    remarks : tuple of str
    """

    path: Path
    sha256: str
    cycles: tuple[NewCycle, ...]
    partial: tuple[str, ...]
    remarks: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class NewFileReader:
    """Reads files of one condition.

    Attributes
    ----------
    declaration : bytes
        Content of the campaign file; empty for columns with default names.
    declared_in : Path
    condition : str
    fitted : mapping of str to FittedSweeps
        By branch.
    """

    declaration: bytes
    declared_in: Path
    condition: str
    fitted: Mapping[str, FittedSweeps]

    def read(self, path: Path) -> NewFile:
        """Read a file.

        Raises
        ------
        MeasurementError, CampaignError, QuantityError
            If it can't be used, or is not of this campaign.
        """
        if not path.is_file():
            raise MeasurementError(
                "there is no such file", file=path, expected="a file of new cycles", remedy="check the path"
            )
        sha256 = file_checksum(path)
        declared = declared_for_file(
            self.declaration, self.declared_in, self.condition, path, DEFAULT_SETTINGS
        )
        declared, cut = _without_last_line(declared)
        try:
            run, _ = read_columns(declared)
        except CampaignError as error:
            raise MeasurementError(
                f"is not of this campaign: {error.found}",
                file=path,
                expected=f"the columns that {self.condition!r} was fitted with; {error.expected or ''}".rstrip(
                    "; "
                ),
                remedy="name files of this campaign; --campaign FILE says how other files are to be read",
            ) from None
        self._require_same(run, path)
        require_possible(run)
        try:
            records = self._split(run, declared)
        except MeasurementError:
            share = max(f.covered(_finite(run)) for f in self.fitted.values())
            if share >= LEAST_COVERED_SHARE:
                raise
            return NewFile(path, sha256, (), (f"{path.name}: {self._extent(run)}",), cut)
        cycles, partial = self._cycles(records, path)
        fresh = tuple(c for c in cycles if c.sha256 not in self._heads)
        if len(fresh) < len(cycles):
            known = len(cycles) - len(fresh)
            was, does = ("was", "doesn't") if known == 1 else ("were", "don't")
            held = f"{path.name}: {many(known, 'cycle')} of it {was} fitted, and {does} count as new"
            cut = (*cut, held)
        return NewFile(path, sha256, fresh, tuple(partial), cut)

    @cached_property
    def _heads(self) -> frozenset[str]:
        """Checksums by which cycles that were fitted are known again."""
        found: dict[float, dict[str, Record]] = {}
        for branch, fitted in self.fitted.items():
            for cycle, sweep in _sweeps(fitted.record):
                found.setdefault(cycle, {})[branch] = sweep
        return frozenset(map(_head, found.values()))

    def _require_same(self, run: Run, path: Path) -> None:
        """Refuse what is not of this campaign."""
        record = next(iter(self.fitted.values())).record
        lacking = [c for c in ("temperature", *record.channels) if c not in run.columns]
        if lacking:
            raise MeasurementError(
                f"has {', '.join(run.columns)}, and no {' and no '.join(map(record.quantity, lacking))}",
                file=path,
                expected=f"the columns that {self.condition!r} was fitted with",
                remedy="name files of this campaign; --campaign FILE says how other files are to be read",
            )
        for name in ("temperature", *record.channels):
            if run.units[name] != record.units[name]:
                raise MeasurementError(
                    f"{name} is in {run.units[name]!r}",
                    file=path,
                    column=name,
                    expected=f"{record.units[name]!r}, as it was fitted",
                    remedy="declare units as the campaign of the fit did",
                )
        t = _finite(run)
        if t.size and max(f.covered(t) for f in self.fitted.values()) == 0.0:
            low, high = next(iter(self.fitted.values())).ends
            unit = unit_text(record.units["temperature"])
            raise MeasurementError(
                f"temperatures from {t.min():.4g} to {t.max():.4g} {unit}",
                file=path,
                expected=f"some of {low:.4g} to {high:.4g} {unit}, over which the spring was fitted",
                remedy="name files of this campaign; check the unit of the temperature",
            )

    def _split(self, run: Run, declared: DeclaredCondition) -> tuple[Record, ...]:
        """Records of the branches, averaged over as many rows as those that were fitted."""
        first = next(iter(self.fitted.values())).record
        settings = replace(declared.settings, fit_channels=first.channels, max_samples=UNREDUCED)
        records, _ = split_run(run, settings)
        averaged = max(f.record.rows_averaged for f in self.fitted.values())
        if averaged == 1:
            return records
        wanted = max(r.n for r in records) // averaged
        records, _ = split_run(run, replace(settings, max_samples=max(wanted, 2 * LEAST_SAMPLES)))
        return records

    def _cycles(self, records: Sequence[Record], path: Path) -> tuple[list[NewCycle], list[str]]:
        """Whole cycles in their order, and in words those that are not."""
        found: dict[float, dict[str, Record]] = {}
        short: dict[float, list[str]] = {}
        for branch, fitted in self.fitted.items():
            record = next((r for r in records if r.branch.value == branch), None)
            if record is None:
                continue
            for cycle, sweep in _sweeps(record):
                found.setdefault(cycle, {})[branch] = sweep
                if fitted.covered(sweep.temperature) < LEAST_COVERED_SHARE:
                    short.setdefault(cycle, []).append(self._span(branch, sweep.temperature))
        cycles, partial = [], []
        for cycle in sorted(found):
            told = short.get(cycle, [])
            told += [f"no {branch} sweep" for branch in self.fitted if branch not in found[cycle]]
            if told:
                partial.append(f"{path.name}, cycle {cycle:g}: {'; '.join(told)}")
            else:
                cycles.append(NewCycle(cycle, _head(found[cycle]), found[cycle]))
        return cycles, partial

    def _span(self, branch: str, t: Floats) -> str:
        low, high = self.fitted[branch].ends
        unit = unit_text(self.fitted[branch].record.units["temperature"])
        return f"{branch} covers {t.min():.4g} to {t.max():.4g} of {low:.4g} to {high:.4g} {unit}"

    def _extent(self, run: Run) -> str:
        t = _finite(run)
        return self._span(next(iter(self.fitted)), t) if t.size else "no readings yet"


def _finite(run: Run) -> Floats:
    t = run.columns["temperature"]
    return np.asarray(t[np.isfinite(t)])


def _sweeps(record: Record) -> list[tuple[float, Record]]:
    """Sweeps with all channels, by their cycle."""
    rows: dict[float, Floats] = {}
    sweeps, cycle, _ = sweeps_of(record, record.channels[0])
    numbers = sweeps.inputs.get("cycle", np.ones(sweeps.n))
    for c in cycle:
        rows[float(c)] = sweeps.row[numbers == c]
    return [(c, _rows_of(record, np.isin(record.row, own))) for c, own in rows.items()]


def _rows_of(record: Record, kept: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> Record:
    return replace(
        record,
        inputs={k: v[kept] for k, v in record.inputs.items()},
        observed={k: v[kept] for k, v in record.observed.items()},
        row=record.row[kept],
    )


def _head(sweeps: Mapping[str, Record]) -> str:
    """Checksum of the first samples of the sweep that came first."""
    first = min(sweeps.values(), key=lambda r: int(r.row.min()))
    order = np.argsort(first.row, kind="stable")[:LEAST_SAMPLES]
    columns = [first.temperature, *first.observed.values()]
    if "time" in first.inputs:
        columns.append(first.inputs["time"])
    held = np.column_stack([c[order] for c in columns])
    return hashlib.sha256(first.branch.value.encode() + np.ascontiguousarray(held).tobytes()).hexdigest()


def _without_last_line(declared: DeclaredCondition) -> tuple[DeclaredCondition, tuple[str, ...]]:
    """The file but for a last line without an end, which may still be written."""
    path = declared.path
    content = path.read_bytes()
    if (
        not content
        or content.endswith((b"\n", b"\r"))
        or (declared.reading.format or recognise(path)) not in TEXT
    ):
        return declared, ()
    lines = len(content.splitlines())
    if lines < 2:
        return declared, ()
    reading = declared.reading.model_copy(update={"last_row": lines - 1})
    return replace(declared, reading=reading), (
        f"{path.name}: line {lines} has no end and was left out, as it may still be written",
    )


def stored_declaration(folder: Path, source: str, campaign: Path | None) -> tuple[bytes, Path]:
    """Content and name of the campaign file by which new files are read.

    Parameters
    ----------
    folder : Path
        Of the fit.
    source : str
        What the fit says it was made from.
    campaign : Path or None
        Another campaign file, or a folder with one.

    Raises
    ------
    SmaBayesError
        If there is none although the fit was made from one.
    """
    path = campaign if campaign is not None else folder / CAMPAIGN_FILE
    if path.is_dir():
        path = path / CAMPAIGN_FILE
    if path.is_file():
        return path.read_bytes(), path
    if campaign is None and not source.endswith(".toml"):
        return b"", Path(source or folder)
    raise SmaBayesError(
        "there is no such campaign file",
        file=path,
        expected="how new files are to be read: columns, units",
        remedy="name the campaign file with --campaign; fits of this version keep a copy of it",
    )


def chosen_condition(conditions: Sequence[str], asked: str | None, folder: Path) -> str:
    """The condition that is watched.

    Raises
    ------
    UnknownNameError
        If it is not in the fit, or none was named where there are several.
    """
    if asked is None and len(set(conditions)) == 1:
        return conditions[0]
    if asked in conditions:
        return str(asked)
    raise UnknownNameError(
        "no condition was named" if asked is None else f"unknown condition {asked!r}",
        file=folder,
        expected=near_matches(asked or "", conditions),
        remedy="name the one that the new cycles belong to with --condition",
    )
