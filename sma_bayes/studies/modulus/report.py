"""The report of a study of moduli: which figures it has."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from sma_bayes.report.assembly import assemble
from sma_bayes.report.choice import MANY, REPORT, Drawn, ReportOptions
from sma_bayes.report.figures.sheet import Drawing
from sma_bayes.runs.documents import MODULUS
from sma_bayes.runs.finished_run import read_finished
from sma_bayes.studies.modulus.figures.modulus import moduli_figure, shift_figure
from sma_bayes.studies.modulus.page import page_words
from sma_bayes.studies.modulus.schema import ModulusDocument, StoredModulus
from sma_bayes.studies.modulus.shown import in_declared_units
from sma_bayes.studies.modulus.tables import modulus_tables


def build_report(folder: Path, wanted: ReportOptions) -> None:
    """Write the report of a study of moduli; see `sma_bayes.report.choice.ReportBuilder`."""
    stored = read_finished(MODULUS, ModulusDocument, folder, in_declared_units)
    assemble(__package__, stored, wanted, _drawings(stored, wanted.drawn), modulus_tables, page_words)


def _drawings(stored: StoredModulus, drawn: Drawn) -> list[Callable[[StoredModulus], Drawing]]:
    tests = list(dict.fromkeys(s.test for s in stored.found.sweeps))
    if not (drawn == "all" or (drawn == REPORT and len(tests) <= MANY)):
        return []
    drawings: list[Callable[[StoredModulus], Drawing]] = [
        partial(moduli_figure, number=n) for n in range(1, len(tests) + 1)
    ]
    if any(s.shift is not None for s in stored.found.shifts):
        drawings.append(shift_figure)
    return drawings
