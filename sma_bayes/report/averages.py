"""Average correlation factors as a document states them, for tables and figures."""

from __future__ import annotations

from sma_bayes.report.content import AverageFactor
from sma_bayes.runs.schema import CorrelationAverage


def average_factors(entry: CorrelationAverage, data: str) -> tuple[AverageFactor, ...]:
    """Averages of one channel and branch, one for each rule.

    Parameters
    ----------
    entry : CorrelationAverage
    data : str
        See `AverageFactor`.
    """
    return tuple(AverageFactor(entry, data, rule) for rule in entry.r or {})
