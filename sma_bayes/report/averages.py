"""Average correlation factors as a document states them, for tables and figures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sma_bayes.assess.correlation import FACTORS
from sma_bayes.report.content import AverageFactor, Estimate


def average_factors(entry: Mapping[str, Any], data: str) -> tuple[AverageFactor, ...]:
    """Averages of one channel and branch, one for each rule.

    Parameters
    ----------
    entry : mapping
        As `sma_bayes.assess.correlation_average.averages` states it.
    data : str
        See `AverageFactor`.
    """
    found = {name: entry[name] for name in FACTORS if name in entry}
    units = {"rmse": entry["unit"]}
    return tuple(
        AverageFactor(
            channel=entry["channel"],
            name=entry["quantity"],
            unit=entry["unit"],
            branch=entry["branch"] or "both",
            data=data,
            rule=rule,
            factors={n: _estimate(by[rule], units.get(n, "1")) for n, by in found.items() if rule in by},
            above=found["r"][rule]["above"],
            undefined=found["r"][rule]["undefined"],
            records=tuple(entry["records"]),
            left_out=tuple(entry["left_out"]),
            draws=entry["draws"],
        )
        for rule in found.get("r", ())
    )


def _estimate(values: Mapping[str, float | None], unit: str) -> Estimate:
    return Estimate(values.get("median"), values.get("q05"), values.get("q95"), unit)
