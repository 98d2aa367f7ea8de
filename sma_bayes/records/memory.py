"""Measurements that are in memory: data frames and arrays become the records that files would give."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt
import pandas as pd

from sma_bayes.errors import MeasurementError
from sma_bayes.records.copies import Readings, copied_readings, readings_of
from sma_bayes.records.declaration import CAMPAIGN_FILE, declared_condition
from sma_bayes.records.formats.table import Cells, RawTable, sample_rows
from sma_bayes.records.mapping import run_of_tables
from sma_bayes.records.plausibility import named_otherwise, require_possible, split_with_doubts
from sma_bayes.records.split import SplitSettings
from sma_bayes.records.types import Campaign, Finding, Record


class InterchangeFrame(Protocol):
    """Anything that speaks the data frame interchange protocol."""

    def __dataframe__(self, nan_as_null: bool = False, allow_copy: bool = True) -> Any:
        """The frame, as the protocol has it."""


class ConvertibleFrame(Protocol):
    """Anything that can be made a pandas data frame."""

    def to_pandas(self) -> Any:
        """The same as a pandas data frame."""


Frame: TypeAlias = pd.DataFrame | InterchangeFrame | ConvertibleFrame | Mapping[str, npt.ArrayLike]
"""A data frame, or column names with arrays of shape (n,)."""
Measurements: TypeAlias = Frame | Mapping[str, Frame]
"""One condition, or conditions by their ids."""

DEFAULT_SETTINGS: Final = SplitSettings()
CONDITION: Final = "data"
"""Id of the condition where one frame is given without a name."""


def campaign_of(
    data: Measurements,
    *,
    columns: Mapping[str, Mapping[str, Any]] | None = None,
    conditions: Mapping[str, Mapping[str, float]] | None = None,
    name: str = CONDITION,
    settings: SplitSettings = DEFAULT_SETTINGS,
) -> Campaign:
    """Make a campaign of data frames or arrays, split into records as `read_campaign` does with files.

    Parameters
    ----------
    data : frame, or mapping of str to frame
        One condition, or conditions by their ids. A frame is a pandas data frame, anything with ``to_pandas`` or the
        data frame interchange protocol, or a mapping of column names to arrays of shape (n,). An index that has a name
        or holds times is a column, too. NaN is a missing value.
    columns : mapping, optional
        What ``[columns]`` of a campaign file says, ``{"force": {"name": "F", "unit": "mN"}}``; by default columns are
        known by their names, ``temperature_C``, ``force_N`` and so on.
    conditions : mapping, optional
        What was set on the rig, by the id of the condition: ``{"2A": {"current_A": 2.0, "load_g": 150}}``.
    name : str
        Of the campaign, and id of a condition that has none.
    settings : SplitSettings, optional
        How runs are split.

    Returns
    -------
    Campaign
        Rows are counted from 1.

    Raises
    ------
    MeasurementError
        If something is no frame, or a value can't be used.
    CampaignError
        If a column is not there, or a quantity or setting is not known.
    QuantityError
        If a unit is unknown or of the wrong kind.

    Examples
    --------
    >>> T = np.r_[np.linspace(30.0, 70.0, 50), np.linspace(70.0, 30.0, 50)]
    >>> campaign = campaign_of({"temperature_C": T, "force_N": 1.0 / (1.0 + np.exp(50.0 - T))})
    >>> [record.key for record in campaign.records]
    ['data-heating', 'data-cooling']
    """
    tables = {key: _table(frame, key) for key, frame in _by_condition(data, name).items()}
    unknown = set(conditions or {}) - set(tables)
    if unknown:
        raise MeasurementError(
            f"settings of {sorted(unknown)[0]!r}, which is no condition",
            expected=", ".join(map(repr, tables)),
        )
    records: list[Record] = []
    findings: list[Finding] = []
    readings: list[Readings] = []
    total = hashlib.sha256(repr((columns, conditions)).encode())
    for key, table in tables.items():
        declared = declared_condition(
            {"id": key, "file": key, **(conditions or {}).get(key, {})},
            columns or {},
            Path(CAMPAIGN_FILE),
            settings,
        )
        run, seen = run_of_tables(declared, [table])
        require_possible(run)
        parts, more = split_with_doubts(run, settings)
        records += parts
        findings += (*named_otherwise(declared), *seen, *more)
        readings += readings_of(run)
        total.update(_content(key, table))
    findings += copied_readings(readings)
    return Campaign(name, name, total.hexdigest(), tuple(records), tuple(findings))


def _by_condition(data: Any, name: str) -> Mapping[str, Frame]:
    """Frames by condition; one of them where columns were given."""
    if not isinstance(data, Mapping):
        return {name: data}
    if not data:
        raise MeasurementError("no data", expected="a data frame, or conditions by their ids")
    if all(_is_frame(value) for value in data.values()):
        return {str(key): frame for key, frame in data.items()}
    return {name: data}


def _is_frame(value: object) -> bool:
    is_table = isinstance(value, Mapping | pd.DataFrame)
    return is_table or (hasattr(value, "__dataframe__") and not isinstance(value, pd.Series))


def _table(frame: Frame, key: str) -> RawTable:
    named = _columns(frame, key)
    lengths = {len(values) for values in named.values()}
    if len(lengths) != 1 or not lengths.pop():
        sizes = ", ".join(f"{n} {len(v)}" for n, v in named.items())
        raise MeasurementError(
            f"columns of lengths {sizes}" if named else "no columns",
            file=key,
            expected="columns of one length, at least one row",
        )
    columns = tuple(named.values())
    return RawTable(tuple(" ".join(n.split()) for n in named), columns, sample_rows(len(columns[0])))


def _columns(frame: Any, key: str) -> dict[str, Cells]:
    if isinstance(frame, Mapping):
        return {str(name): _cells(np.asarray(values), str(name), key) for name, values in frame.items()}
    if not isinstance(frame, pd.DataFrame):
        frame = _as_pandas(frame, key)
    index = frame.index
    if index.name is not None or isinstance(index, pd.DatetimeIndex | pd.TimedeltaIndex):
        frame = frame.reset_index(names="time" if index.name is None else str(index.name))
    return {str(name): _cells(frame[name].to_numpy(), str(name), key) for name in frame.columns}


def _as_pandas(frame: Any, key: str) -> pd.DataFrame:
    if hasattr(frame, "to_pandas"):
        return pd.DataFrame(frame.to_pandas())
    if not hasattr(frame, "__dataframe__"):
        raise MeasurementError(
            f"found {type(frame).__name__}",
            file=key,
            expected="a data frame, or a mapping of column names to arrays",
            remedy="give files to read_campaign",
        )
    with warnings.catch_warnings():  # pandas says that the protocol will go; others still speak nothing else
        warnings.simplefilter("ignore")
        from pandas.api.interchange import from_dataframe

        return from_dataframe(frame)


def _cells(values: np.ndarray[Any, Any], name: str, key: str) -> Cells:
    """Numbers as they are, times as the standard library's, all else as it stands."""
    if values.ndim != 1:
        raise MeasurementError(
            f"an array of shape {values.shape}", file=key, column=name, expected="one value a row: shape (n,)"
        )
    if values.dtype.kind in "fiu":
        return values.astype(float)
    if values.dtype.kind in "mM":
        return list(
            values.astype(f"{'datetime64' if values.dtype.kind == 'M' else 'timedelta64'}[us]").tolist()
        )
    return [None if value is None or value is pd.NA or value != value else value for value in values.tolist()]


def _content(key: str, table: RawTable) -> bytes:
    """What the digest of a condition is made of: names and values."""
    parts = [key.encode(), repr(table.names).encode()]
    parts += [c.tobytes() if isinstance(c, np.ndarray) else repr(c).encode() for c in table.columns]
    return b"\n".join(parts)
