"""From a campaign folder, a campaign file or a single data file to the records of a campaign."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from sma_bayes.records.copies import Readings, copied_readings, readings_of
from sma_bayes.records.declaration import Declaration, read_declaration
from sma_bayes.records.mapping import read_run
from sma_bayes.records.plausibility import (
    named_otherwise,
    repeated_files,
    require_possible,
    split_with_doubts,
)
from sma_bayes.records.split import SplitSettings
from sma_bayes.records.types import Campaign, Finding, Record

DEFAULT_SETTINGS: Final = SplitSettings()


def read_campaign(
    path: str | Path, *, data_dir: str | Path | None = None, settings: SplitSettings = DEFAULT_SETTINGS
) -> Campaign:
    """Read a campaign: every data file it declares, split into one record per condition and branch.

    Parameters
    ----------
    path : str or Path
        Folder with a ``campaign.toml``, a campaign file, or a single data file whose columns have the default
        names (``temperature_C``, ``force_N`` and so on, see `default_names`).
    data_dir : str or Path, optional
        Folder of the data files, in place of the one that the campaign declares.
    settings : SplitSettings, optional
        How runs are split, as far as ``[segmentation]`` leaves it open.

    Returns
    -------
    Campaign
        Its findings tell what was left out or taken as missing, in reading and in splitting.

    Raises
    ------
    CampaignError
        If the declaration is wrong, or names a file or column that is not there.
    MeasurementError
        If a data file, or a value in it, can't be used.
    QuantityError
        If a unit is unknown or of the wrong kind.
    """
    declaration = read_declaration(Path(path), None if data_dir is None else Path(data_dir), settings)
    records: list[Record] = []
    findings: list[Finding] = []
    readings: list[Readings] = []
    for condition in declaration.conditions:
        run, seen_reading = read_run(condition)
        require_possible(run)
        parts, seen_splitting = split_with_doubts(run, condition.settings)
        records += parts
        findings += (*named_otherwise(condition), *seen_reading, *seen_splitting)
        readings += readings_of(run)
    repeated = repeated_files(declaration.conditions)
    findings += (*repeated, *copied_readings(readings, repeated))
    return Campaign(
        name=declaration.name,
        source=str(declaration.source),
        sha256=digest(declaration),
        records=tuple(records),
        findings=tuple(findings),
        data_dir="" if data_dir is None else str(data_dir),
        declaration=declaration.content,
    )


def digest(declaration: Declaration) -> str:
    """SHA-256 over the campaign file and its data files, in the order of the conditions.

    Depends on what the files hold, not on where they are.
    """
    total = hashlib.sha256(declaration.content)
    for path in _unique(path for condition in declaration.conditions for path in condition.paths):
        with path.open("rb") as file:
            total.update(hashlib.file_digest(file, "sha256").digest())
    return total.hexdigest()


def _unique(paths: Iterable[Path]) -> Iterable[Path]:
    return dict.fromkeys(paths)
