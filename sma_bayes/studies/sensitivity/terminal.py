"""A study of sensitivity on the screen: a row for each number, and what follows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.table import Column, Table

from sma_bayes.report.notation import interval_text, unit_label
from sma_bayes.report.screen import ENTRIES_SHOWN, NOT_CONVERGED, numbers, screen, show_end, titled
from sma_bayes.studies.sensitivity.schema import (
    NONE,
    QuantitySensitivity,
    RecordSensitivity,
    SensitivityFindings,
)
from sma_bayes.studies.sensitivity.shown import in_declared_units
from sma_bayes.studies.sensitivity.words import reported, worst_sweep


def show_sensitivity(found: dict[str, Any], out: Path | None) -> None:
    """Tell what `sensitivity.json` says."""
    document = in_declared_units(SensitivityFindings.model_validate(found))
    console = screen()
    console.tell(
        f"{document.campaign}: what moves each number. Sensitive from {document.thresholds.sensitivity:g}; changes in "
        "posterior standard deviations"
    )
    for record in document.records[:ENTRIES_SHOWN]:
        console.print()
        console.print(_table(record))
    if len(document.records) > ENTRIES_SHOWN:
        console.print(f"and {len(document.records) - ENTRIES_SHOWN} records more: see --json or --out")
    console.print()
    if not document.converged:
        console.tell(NOT_CONVERGED)
    console.tell(*(f"remark: {text}" for text in document.declared_differently))
    console.tell(document.conclusion)
    show_end(console, found, out)


def _table(record: RecordSensitivity) -> Table:
    swept = any(q.sweeps for q in record.quantities)
    doubled = any(q.bootstrap for q in record.quantities)
    table = titled(
        f"{record.key}, {record.n} readings",
        Column("number", no_wrap=True),
        *map(numbers, ("median, 90 % interval", "prior", "data", "without prior")),
        "diagnosis",
        *map(numbers, ["without sweep"] * swept + ["without row"] + ["bootstrap"] * doubled),
    )
    for q in reported(record):
        table.add_row(*_cells(q, swept, doubled))
    return table


def _cells(q: QuantitySensitivity, swept: bool, doubled: bool) -> list[str]:
    unit = unit_label(q.unit)
    diagnosis: str = "-" if q.diagnosis == NONE else q.diagnosis
    if q.leading_prior is not None:
        diagnosis += f" ({q.leading_prior.parameter})"
    sweep = worst_sweep(q)
    width = None if q.bootstrap is None else q.bootstrap.width
    return [
        q.name,
        f"{interval_text(q.median, q.q05, q.q95)} {unit}".rstrip(),
        _number(q.prior),
        _number(q.likelihood),
        "-" if q.without_prior is None else _moved(q.without_prior),
        diagnosis,
        *(["-" if sweep is None else f"{sweep[0]}: {_moved(sweep[1])}"] if swept else []),
        "-" if q.reading is None else f"{q.reading.row}: {_moved(q.reading.change or 0.0)}",
        *(["-" if width is None else f"× {width:.2f}"] if doubled else []),
    ]


def _moved(sds: float) -> str:
    """By how many standard deviations a number moves; what rounds to nought has no sign."""
    return f"{sds:+.2f}" if abs(sds) >= 0.005 else "0.00"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"
