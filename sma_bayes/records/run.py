"""One run of the rig as it came out of a file, before it is split into branches."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from sma_bayes.arrays import Floats, Ints
from sma_bayes.records.types import Calibration, Condition


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """Columns of one file for one condition, in canonical units, in the order of the file.

    Attributes
    ----------
    condition : Condition
    file : str
        Name of the file, for messages.
    row : ndarray of int, shape (n,)
        Source line of each sample, counted from 1.
    columns : mapping of str to ndarray, shape (n,)
        Keys are names of `quantities.QUANTITIES`, with stress, strain and modulus already under force,
        displacement and stiffness. NaN marks a value that is missing. ``branch`` is +1 heating, -1 cooling.
    units : mapping of str to str
        Unit of each column.
    specimen : bool
        True where stress, strain and modulus were recorded.
    temperature_sd : float
        Error of a temperature reading [unit of temperature].
    calibration : mapping of str to Calibration
        Channels whose scale or offset is uncertain.
    declared_units : mapping of str to str
        Unit of temperature and of each channel and setting as it was declared, in which people see it.
    """

    condition: Condition
    file: str
    row: Ints
    columns: Mapping[str, Floats]
    units: Mapping[str, str]
    specimen: bool = False
    temperature_sd: float = 0.0
    calibration: Mapping[str, Calibration] = field(default_factory=dict)
    declared_units: Mapping[str, str] = field(default_factory=dict)

    @property
    def n(self) -> int:
        """Number of rows."""
        return int(self.row.size)

    def take(self, keep: NDArray[np.bool_] | Ints) -> Run:
        """Keep only the rows that a mask or an index selects."""
        return replace(self, row=self.row[keep], columns={k: v[keep] for k, v in self.columns.items()})
