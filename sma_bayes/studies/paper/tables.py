"""Every printed cell of Tables 1 to 12 beside what is recomputed from other cells or from the fits of the twin."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Final

import numpy as np

from sma_bayes.fitting.warm_start import GoodnessOfFit
from sma_bayes.paper.errata import PRINTED_TABLES
from sma_bayes.paper.extremes import EXTREME_TABLES
from sma_bayes.paper.physics import PUBLISHED_HELIX
from sma_bayes.paper.specifications import TABLE_1, specification
from sma_bayes.paper.tables import PARAMETER_TABLES, STATISTICS_TABLES, CellStatus, PrintedCell, PrintedTable
from sma_bayes.paper.twin import FITTED_PARAMETERS
from sma_bayes.quantities import convert
from sma_bayes.runs.schema import IntervalDocument, interval_document
from sma_bayes.studies.conditions.features import BOTH
from sma_bayes.studies.paper.export import printed_entry
from sma_bayes.studies.paper.schema import RecomputedValue, ReproducedEntry
from sma_bayes.studies.paper.twin_study import TwinStudy

Found = RecomputedValue | IntervalDocument | None
"""None where nothing is recomputed."""

IMPLIED: Final = "implied"
"""Status of a number that follows from several printed ones."""
FEATURES: Final[Mapping[str, str]] = {
    "stiffness_min": "least_stiffness",
    "stiffness_max": "greatest_stiffness",
}
"""Feature of a condition behind a printed column of Tables 9 to 12."""


def table_entries(study: TwinStudy) -> dict[str, list[ReproducedEntry]]:
    """Entries of every table, by its number.

    Parameters
    ----------
    study : TwinStudy
        Cells of conditions that it leaves out are left out too.
    """
    out: dict[str, list[ReproducedEntry]] = {}
    for table in PRINTED_TABLES:
        if table.number == 0:
            continue
        recompute = _recomputer(table, study)
        entries = [
            ReproducedEntry(**printed_entry(table, cell).model_dump(), recomputed=recompute(cell))
            for cell in table.cells
        ]
        out[str(table.number)] = [*entries, *_derived(table, study)]
    known = {r.condition.id for r in study.campaign.records}
    fitted = {str(t.number) for t in (*PARAMETER_TABLES, *STATISTICS_TABLES)}
    return {n: [e for e in found if n not in fitted or e.condition in known] for n, found in out.items()}


def _recomputer(table: PrintedTable, study: TwinStudy) -> Callable[[PrintedCell], Found]:
    if table is TABLE_1:
        return _specification
    if table in PARAMETER_TABLES:
        return lambda cell: _parameter(cell, study)
    if table in STATISTICS_TABLES:
        return lambda cell: _statistic(cell, study)
    if table in EXTREME_TABLES:
        return lambda cell: _extreme(cell, study)
    return lambda cell: None


def _specification(cell: PrintedCell) -> Found:
    """From other cells of Table 1."""
    found = {
        "volume": lambda: PUBLISHED_HELIX.volume,
        "resistivity": lambda: specification(TABLE_1, "resistivity_martensite", "ohm*m"),
        "specific_heat_joule": lambda: specification(TABLE_1, "specific_heat_calorie", "J/g/delta_degC"),
    }
    return RecomputedValue(value=float(found[cell.quantity]())) if cell.quantity in found else None


def _key(cell: PrintedCell) -> str:
    return f"{cell.condition}-{'' if cell.branch is None else cell.branch.value}"


def _parameter(cell: PrintedCell, study: TwinStudy) -> Found:
    """A1 and B1 from force and displacement, the others from stiffness, as the paper fitted them."""
    fits = study.parts if cell.quantity in ("A1", "B1") else study.stiffness
    fitted = fits.get(_key(cell))
    return (
        None
        if fitted is None
        else interval_document(fitted.flat[:, fitted.posterior.space.index(cell.quantity)])
    )


def _goodness(cell: PrintedCell, study: TwinStudy) -> GoodnessOfFit | None:
    fitted = study.stiffness.get(_key(cell))
    return None if fitted is None else fitted.warm_start.fit[0]["stiffness"]


def _statistic(cell: PrintedCell, study: TwinStudy) -> Found:
    found = _goodness(cell, study)
    return None if found is None else RecomputedValue(value=float(getattr(found, cell.quantity)))


def _extreme(cell: PrintedCell, study: TwinStudy) -> Found:
    name = FEATURES.get(cell.quantity)
    for f in study.features:
        if (f.name, f.branch, f.condition.id) == (name, BOTH, cell.condition):
            draws = convert(f.draws, f.unit, cell.unit, what=cell.quantity)
            return interval_document(np.asarray(draws))
    return None


def _derived(table: PrintedTable, study: TwinStudy) -> Iterator[ReproducedEntry]:
    """What follows from several printed cells: B1/A1, and the spread of the measured stiffness."""
    for (condition, branch), column in table.columns().items():
        fitted = None if branch is None else study.stiffness.get(f"{condition}-{branch.value}")
        if branch is None or fitted is None:
            continue
        place = (table.number, condition, branch.value)
        if table in PARAMETER_TABLES:
            draws = [fitted.flat[:, fitted.posterior.space.index(n)] for n in ("B1", "A1")]
            value = column["B1"].value / column["A1"].value
            yield _implied(place, "B1/A1", "N/cm", value, interval_document(draws[0] / draws[1]))
        if table in STATISTICS_TABLES:
            y = fitted.records[0].observed["stiffness"]
            lost = column["r2"].status is CellStatus.DAMAGED
            spread = None if lost else printed_spread(column)
            yield _implied(place, "spread", "N/cm", spread, RecomputedValue(value=float(np.std(y))))


def _implied(
    place: tuple[int, str, str], quantity: str, unit: str, value: float | None, recomputed: Found
) -> ReproducedEntry:
    table, condition, branch = place
    return ReproducedEntry(
        table=table,
        line=None,
        condition=condition,
        branch=branch,
        quantity=quantity,
        unit=unit,
        printed="" if value is None else f"{value:.4g}",
        published=value,
        status=IMPLIED if value is not None else CellStatus.DAMAGED.value,
        corrected=None,
        reason="",
        errata="",
        recomputed=recomputed,
    )


def printed_spread(column: Mapping[str, PrintedCell]) -> float:
    """Standard deviation of the measured stiffness that printed statistics imply, ``sqrt(SSE/(1 - R2)/n)``.

    n is ``SSE/RMSE**2`` and the 6 parameters.

    Parameters
    ----------
    column : mapping of str to PrintedCell
        One column of Tables 6 to 8.
    """
    sse, rmse, r2 = (column[name].value for name in ("sse", "rmse", "r2"))
    return float(np.sqrt(sse / (1.0 - r2) / (sse / rmse**2 + FITTED_PARAMETERS)))
