"""The report of a study of sensitivity: which figures it has."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from sma_bayes.report.assembly import assemble
from sma_bayes.report.choice import CAMPAIGN_REPORT_ABOVE, REPORT, Drawn, ReportOptions
from sma_bayes.report.figures.sheet import Drawing
from sma_bayes.runs.documents import SENSITIVITY
from sma_bayes.runs.finished_run import read_finished
from sma_bayes.studies.sensitivity.figures.sensitivity import powers_figure, readings_figure
from sma_bayes.studies.sensitivity.schema import SensitivityDocument, StoredSensitivity
from sma_bayes.studies.sensitivity.shown import in_declared_units
from sma_bayes.studies.sensitivity.tables import sensitivity_tables
from sma_bayes.studies.sensitivity.words import reported


def build_report(folder: Path, wanted: ReportOptions) -> None:
    """Write the report of a study of sensitivity; see `sma_bayes.report.choice.ReportBuilder`."""
    stored = read_finished(SENSITIVITY, SensitivityDocument, folder, in_declared_units)
    found = stored.found
    at = "".join(f' --at "{t}"' for t in found.at)
    command = f'sma-bayes sensitivity "{found.source}" --out DIR --seed {found.seed}{at}'
    assemble(
        __package__, stored, wanted, _drawings(stored, wanted.drawn), sensitivity_tables, command=command
    )


def _drawings(stored: StoredSensitivity, drawn: Drawn) -> list[Callable[[StoredSensitivity], Drawing]]:
    records = stored.found.records
    if drawn == "none" or (drawn == REPORT and len(records) > CAMPAIGN_REPORT_ABOVE):
        return []
    drawings: list[Callable[[StoredSensitivity], Drawing]] = [
        partial(powers_figure, record=r) for r in records
    ]
    told = [r for r in records if any(q.reading is not None for q in reported(r))]
    return drawings + [partial(readings_figure, record=r) for r in told]
