"""A comparison in the units in which the measurements were declared, for people."""

from __future__ import annotations

from sma_bayes.arrays import Floats
from sma_bayes.runs.declared_units import (
    Shown,
    ShownUnit,
    in_unit,
    shown_as,
    shown_average,
    shown_columns,
    units_of,
)
from sma_bayes.runs.schema import CorrelationFactors
from sma_bayes.studies.compare.schema import (
    ComparedModel,
    ComparedRecord,
    ComparisonDocument,
    ModelFactors,
    Overall,
    OverallModel,
    StoredComparison,
)

DENSITIES = ("_ln_density", "_loo", "_k")
"""Ends of the names of columns that are no values of the channel."""


def in_declared_units(found: ComparisonDocument) -> ComparisonDocument:
    """What was found, with numbers and units as people see them; parameters, which nobody is shown, stay."""
    units = units_of(found)
    if not units:
        return found
    return found.but(
        records=tuple(_record(r, units) for r in found.records),
        overall=tuple(_overall(g, units) for g in found.overall),
    )


def series_columns(stored: StoredComparison, place: str, record: ComparedRecord) -> dict[str, Floats]:
    """Columns of ``curves`` or ``samples`` of a record, as people see them."""
    columns = stored.columns(f"{place}/{record.key}.csv")
    kept = ["row", "fold", *(n for n in columns if n.endswith(DENSITIES))]
    return shown_columns(columns, units_of(stored.found), record.quantity, kept)


def _record(r: ComparedRecord, units: Shown) -> ComparedRecord:
    u = shown_as(r.unit, units, r.quantity)
    return r.but(
        unit=u.shown,
        temperature_unit=shown_as(r.temperature_unit, units).shown,
        models={name: _model(m, u) for name, m in r.models.items()},
    )


def _model(m: ComparedModel, u: ShownUnit) -> ComparedModel:
    factors = None if m.correlation is None else _model_factors(m.correlation, u)
    return in_unit(m, u, "rmse_held_out", correlation=factors)


def _model_factors(c: ModelFactors, u: ShownUnit) -> ModelFactors:
    return c.but(
        in_sample=_factors(c.in_sample, u),
        held_out=_factors(c.held_out, u),
        by_fold=tuple(_factors(f, u) for f in c.by_fold),
    )


def _factors(c: CorrelationFactors, u: ShownUnit) -> CorrelationFactors:
    return c.but(rmse=in_unit(c.rmse, u))


def _overall(g: Overall, units: Shown) -> Overall:
    models = {name: _overall_model(m, units) for name, m in g.models.items()}
    return g.but(unit=shown_as(g.unit, units, g.quantity).shown, models=models)


def _overall_model(m: OverallModel, units: Shown) -> OverallModel:
    averages = m.correlation_average
    shown = averages.but(
        in_sample=tuple(shown_average(a, units) for a in averages.in_sample),
        held_out=tuple(shown_average(a, units) for a in averages.held_out),
    )
    return m.but(correlation_average=shown)
