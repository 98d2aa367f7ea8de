"""Average correlation factors as a document states them, for tables and figures."""

from __future__ import annotations

from sma_bayes.assess.correlation import FACTORS
from sma_bayes.report.content import AverageFactor, Estimate
from sma_bayes.runs.schema import CorrelationAverage, Factor


def average_factors(entry: CorrelationAverage, data: str) -> tuple[AverageFactor, ...]:
    """Averages of one channel and branch, one for each rule.

    Parameters
    ----------
    entry : CorrelationAverage
    data : str
        See `AverageFactor`.
    """
    found = {name: by for name in FACTORS if (by := getattr(entry, name)) is not None}
    units = {"rmse": entry.unit}
    return tuple(
        AverageFactor(
            channel=entry.channel,
            name=entry.quantity,
            unit=entry.unit,
            branch=entry.branch or "both",
            data=data,
            rule=rule,
            factors={n: _estimate(by[rule], units.get(n, "1")) for n, by in found.items() if rule in by},
            above=r.above,
            undefined=r.undefined,
            records=entry.records,
            left_out=entry.left_out,
            draws=entry.draws,
        )
        for rule, r in (entry.r or {}).items()
    )


def _estimate(factor: Factor, unit: str) -> Estimate:
    return Estimate(factor.median, factor.q05, factor.q95, unit)
