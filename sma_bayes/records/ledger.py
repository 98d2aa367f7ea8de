"""The accounts of a run while it is split: which rows are still in, and why the others are not."""

from __future__ import annotations

from typing import Final

import numpy as np

from sma_bayes.arrays import Floats, Ints
from sma_bayes.errors import MeasurementError, many
from sma_bayes.quantities import SPECIMEN_QUANTITY, convert, unit_text
from sma_bayes.records.run import Run
from sma_bayes.records.types import Finding

ROWS_SHOWN: Final = 5
"""Source lines that a finding lists."""


class Ledger:
    """Which rows of a run are still in, and a finding for each reason why others are not.

    A row is kept out once, for the first reason that applies, so the rows that are in and the rows that the
    findings say were dropped add up to the rows of the run.

    Attributes
    ----------
    run : Run
    kept : ndarray of bool, shape (n,)
        Rows that are still in.
    findings : list of Finding
        In the order in which they were made.
    """

    def __init__(self, run: Run) -> None:
        self.run = run
        self.kept = np.ones(run.n, dtype=bool)
        self.findings: list[Finding] = []

    @property
    def rows(self) -> Ints:
        """Index of the rows that are still in."""
        return np.flatnonzero(self.kept)

    def column(self, name: str) -> Floats:
        """Values of a column in the rows that are still in."""
        return self.run.columns[name][self.kept]

    def quantity(self, column: str) -> str:
        """Name of a column for people: strain for the displacement of a specimen."""
        return SPECIMEN_QUANTITY.get(column, column) if self.run.specimen else column

    def amount(self, column: str, value: float, *, difference: bool = False, digits: int = 6) -> str:
        """A value of a column with its unit, for people: as the measurements declare it.

        Parameters
        ----------
        column : str
        value : float
            In the unit of the run.
        difference : bool
            Whether it is the difference of two; a step of 1 degC is one of 1.8 degF.
        digits : int
            Significant digits at most.
        """
        unit = self.run.units.get(column, "")
        declared = self.run.declared_units.get(column, unit) if unit else unit
        zero, shown = (float(v) for v in convert(np.array([0.0, value]), unit, declared, what=column))
        return f"{shown - zero if difference else shown:.{digits}g} {unit_text(declared)}".rstrip()

    def keep_out(self, index: Ints, kind: str, why: str, *, column: str = "", branch: str = "") -> None:
        """Keep rows out, and say why; rows that are out already are not counted again.

        Parameters
        ----------
        index : ndarray of int
            Positions in the run.
        kind, why : str
            Kind of finding, and the reason as the end of a sentence.
        column, branch : str
            Where that is known.
        """
        index = index[self.kept[index]]
        self.kept[index] = False
        if index.size:
            self._add(index, kind, f"{many(index.size, 'row')} kept out: {why}", index.size, column, branch)

    def note(self, index: Ints, kind: str, message: str, *, column: str = "", branch: str = "") -> None:
        """Report something about rows (or about none in particular) without keeping them out."""
        self._add(index, kind, message, 0, column, branch)

    def _add(self, index: Ints, kind: str, message: str, dropped: int, column: str, branch: str) -> None:
        run = self.run
        rows = tuple(int(r) for r in run.row[index[:ROWS_SHOWN]])
        self.findings.append(
            Finding(kind, message, run.file, rows, int(index.size), dropped, run.condition.id, branch, column)
        )

    def error(self, found: str, *, expected: str, remedy: str, column: str | None = None) -> MeasurementError:
        """Error about this run, with what had been kept out before."""
        before = "; ".join(f.message for f in self.findings if f.dropped)
        found = f"condition {self.run.condition.id!r}: {found}" + (f" ({before})" if before else "")
        return MeasurementError(found, file=self.run.file, column=column, expected=expected, remedy=remedy)
