"""What a measurement is once it has been read: conditions, records, findings, campaigns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from enum import StrEnum
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from sma_bayes.arrays import Floats, Ints
from sma_bayes.errors import MeasurementError
from sma_bayes.quantities import CHANNELS, QUANTITIES, SPECIMEN_QUANTITY
from sma_bayes.records.severity import Severity, severity

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


class Branch(StrEnum):
    """Direction of the temperature sweep."""

    HEATING = "heating"
    COOLING = "cooling"


@dataclass(frozen=True, slots=True)
class Condition:
    """What was set on the rig.

    Attributes
    ----------
    id : str
        Unique name; becomes part of file names.
    current : float or None
        Heating current [A].
    load : float or None
        Load [N] of a spring (a mass is turned into its weight), or stress [Pa] of a specimen.
    frequency : float or None
        Frequency of the drive [Hz].
    duty_cycle : float or None
        Share of the drive period that heats [1].
    """

    id: str
    current: float | None = None
    load: float | None = None
    frequency: float | None = None
    duty_cycle: float | None = None


SETTING_UNITS = {"current": "A", "load": "N", "frequency": "Hz", "duty_cycle": "1"}
"""Settings of a `Condition` with their canonical units; the load of a specimen is a stress."""


def setting_unit(setting: str, *, specimen: bool) -> str:
    """Unit of a setting.

    Examples
    --------
    >>> setting_unit("load", specimen=False), setting_unit("load", specimen=True)
    ('N', 'Pa')
    """
    return "Pa" if setting == "load" and specimen else SETTING_UNITS.get(setting, "1")


@dataclass(frozen=True, slots=True)
class Calibration:
    """Uncertainty of the calibration of a channel or of the thermometer, common to all its samples.

    A channel is ``offset + scale * raw``. The errors of scale and offset move the whole curve, so no
    amount of data along the curve reduces them; they are carried on top of the posterior.

    Attributes
    ----------
    relative_scale_sd : float
        Standard deviation of the scale over the scale [1].
    offset : float
        The offset itself [unit of the channel].
    offset_sd : float
        Its standard deviation [unit of the channel].
    """

    relative_scale_sd: float
    offset: float
    offset_sd: float

    @property
    def is_uncertain(self) -> bool:
        """Whether it has an error at all."""
        return self.relative_scale_sd > 0.0 or self.offset_sd > 0.0


@dataclass(frozen=True, slots=True)
class HeldChannel:
    """A channel that the rig kept constant, so that there is no curve to fit.

    Attributes
    ----------
    mean, sd : float
        Over the record [unit of the channel].
    """

    mean: float
    sd: float


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """One condition and branch: what was applied, what was observed, and where each sample came from.

    Attributes
    ----------
    condition : Condition
    branch : Branch
    inputs : mapping of str to ndarray, shape (n,)
        ``temperature`` always; ``time``, ``current``, ``ambient_temperature``, ``cycle`` where there are any;
        ``segment`` always: samples of one uninterrupted sweep share a number.
    observed : mapping of str to ndarray, shape (n,)
        Channels among force, displacement, stiffness.
    row : ndarray of int, shape (n,)
        Source line, counted from 1; of the first of the averaged lines where samples were averaged.
    units : mapping of str to str
        Unit of each input and channel, also of held ones.
    specimen : bool
        True where stress, strain and modulus stand in for force, displacement and stiffness.
    temperature_sd : float
        Standard deviation of the error of a temperature reading [unit of temperature].
    calibration : mapping of str to Calibration
        Channels whose scale or offset is uncertain, and ``temperature`` where that of the thermometer is.
    held : mapping of str to HeldChannel
        Channels that the rig kept constant.
    rows_averaged : int
        How many source rows a sample stands for, at most; 1 where nothing was averaged.
    source : str
        Name of the file.
    declared_units : mapping of str to str
        Unit of temperature and of each channel and setting as it was declared, in which people see it; a load in g is
        a mass that was hung on the spring. What is missing is seen in its canonical unit.
    """

    condition: Condition
    branch: Branch
    inputs: Mapping[str, Floats]
    observed: Mapping[str, Floats]
    row: Ints
    units: Mapping[str, str]
    specimen: bool = False
    temperature_sd: float = 0.0
    calibration: Mapping[str, Calibration] = field(default_factory=dict)
    held: Mapping[str, HeldChannel] = field(default_factory=dict)
    rows_averaged: int = 1
    source: str = ""
    declared_units: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = np.shape(self.inputs["temperature"])
        if len(n) != 1 or not self.observed:
            raise MeasurementError("a record needs one temperature a sample and at least one channel")
        inputs = dict(self.inputs)
        inputs.setdefault("segment", np.zeros(n))
        frozen = {k: _read_only(v) for k, v in inputs.items()}
        channels = {c: _read_only(self.observed[c]) for c in CHANNELS if c in self.observed}
        if len(channels) != len(self.observed):
            raise MeasurementError(
                f"unknown channel among {sorted(self.observed)}", expected=", ".join(CHANNELS)
            )
        for name, values in (*frozen.items(), *channels.items()):
            if values.shape != n:
                raise MeasurementError(f"{name} has shape {values.shape}, temperature has {n}")
            if not np.all(np.isfinite(values)):
                raise MeasurementError(f"{name} has values that are not finite")
        row = np.array(self.row, dtype=np.int64)
        row.setflags(write=False)
        object.__setattr__(self, "inputs", MappingProxyType(frozen))
        object.__setattr__(self, "observed", MappingProxyType(channels))
        object.__setattr__(self, "row", row)
        for name in ("units", "calibration", "held", "declared_units"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    def __reduce__(self) -> tuple[object, ...]:
        return Record, plain_fields(self)

    @property
    def n(self) -> int:
        """Number of samples."""
        return int(self.row.size)

    @property
    def key(self) -> str:
        """Name in files: ``<condition>-<branch>``."""
        return f"{self.condition.id}-{self.branch.value}"

    @property
    def channels(self) -> tuple[str, ...]:
        """Observed channels, in canonical order."""
        return tuple(self.observed)

    @property
    def temperature(self) -> Floats:
        """Temperature of each sample [unit of temperature], shape (n,)."""
        return self.inputs["temperature"]

    def quantity(self, channel: str) -> str:
        """Name of the quantity behind a channel: ``strain`` for the displacement of a specimen."""
        return SPECIMEN_QUANTITY[channel] if self.specimen and channel in SPECIMEN_QUANTITY else channel

    def symbol(self, channel: str) -> str:
        """Symbol of the quantity behind a channel or input."""
        return QUANTITIES[self.quantity(channel)].symbol


@dataclass(frozen=True, slots=True)
class Finding:
    """Something that the quality checks saw.

    Attributes
    ----------
    kind : str
        ``drop-out``, ``spike``, ``clipped``, ``quantised``, ``time-reversal``, ``gap``, ``duplicate``,
        ``no-transformation``, ``part-cycle``, ``reduced`` and so on.
    message : str
        One sentence: what, where, how much, and what was done about it.
    file : str
    rows : tuple of int
        Source lines (the first few where there are many), counted from 1.
    count : int
        Rows concerned.
    dropped : int
        Rows kept out of the records because of it.
    condition, branch, column : str
        Where that is known.
    """

    kind: str
    message: str
    file: str = ""
    rows: tuple[int, ...] = ()
    count: int = 0
    dropped: int = 0
    condition: str = ""
    branch: str = ""
    column: str = ""

    @property
    def severity(self) -> Severity:
        """How much it matters."""
        return severity(self.kind)


@dataclass(frozen=True, slots=True)
class Campaign:
    """Records that belong together.

    Attributes
    ----------
    name : str
    source : str
        Folder or file that was read.
    sha256 : str
        Digest of the declaration and of all data files.
    records : tuple of Record
    findings : tuple of Finding
    data_dir : str
        Folder of the data files that was named beside the source; empty where none was.
    declaration : bytes
        Content of the campaign file; empty where there is none, and columns have default names.
    """

    name: str
    source: str
    sha256: str
    records: tuple[Record, ...]
    findings: tuple[Finding, ...] = ()
    data_dir: str = ""
    declaration: bytes = b""

    def record(self, key: str) -> Record:
        """Look up a record by its key.

        Raises
        ------
        MeasurementError
            If there is no such record.
        """
        for record in self.records:
            if record.key == key:
                return record
        raise MeasurementError(f"no record {key!r}", expected=", ".join(r.key for r in self.records))


def plain_fields(of: DataclassInstance) -> tuple[object, ...]:
    """Values of the fields of a dataclass to make it anew from; read-only mappings, which do not pickle, as dicts."""
    values = (getattr(of, f.name) for f in fields(of))
    return tuple(dict(v) if isinstance(v, MappingProxyType) else v for v in values)


def _read_only(values: Floats) -> Floats:
    array = np.array(values, dtype=float)
    array.setflags(write=False)
    return array
