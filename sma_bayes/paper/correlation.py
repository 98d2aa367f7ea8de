"""What the printed statistics of Tables 6 to 8 imply for the correlation factor, beside the 0.95 that the text claims.

Of any curve ``r**2 >= R2``, since the best straight line through curve and data, whose share of variance is r squared,
misses the data by no more than the curve itself. So each printed R2 is a floor of r, and so is the R2 that a printed
adjusted R2 implies for the printed degrees of freedom.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from pydantic import Field

from sma_bayes.document_part import DocumentPart, Number
from sma_bayes.paper.specifications import TEXT_VALUES, specification
from sma_bayes.paper.tables import STATISTICS_TABLES, CellStatus, PrintedCell
from sma_bayes.paper.twin import FITTED_PARAMETERS
from sma_bayes.records.types import Branch

CLAIMED: Final = specification(TEXT_VALUES, "correlation_factor", "1")
"""Average correlation factor that the text states [1]."""


@dataclass(frozen=True, slots=True)
class ImpliedCorrelation:
    """Correlation factor that one column of Tables 6 to 8 implies; None where its numbers are lost [1].

    Attributes
    ----------
    table : int
    condition : str
    branch : Branch
    status : CellStatus
        Of the printed R2.
    r2, adj_r2 : float or None
        As printed.
    dof : float or None
        Residual degrees of freedom, ``SSE/RMSE**2`` of the printed values.
    r : float or None
        Least correlation that the printed R2 allows, ``sqrt(R2)``.
    r_rounded : float or None
        The same for the least R2 that rounds to the printed one.
    r_adjusted : float or None
        Least correlation that the printed adjusted R2 allows, for 6 parameters.
    """

    table: int
    condition: str
    branch: Branch
    status: CellStatus
    r2: float | None
    adj_r2: float | None
    dof: float | None
    r: float | None
    r_rounded: float | None
    r_adjusted: float | None


def implied_correlations() -> tuple[ImpliedCorrelation, ...]:
    """Every column of Tables 6 to 8, in their order.

    Examples
    --------
    >>> first = implied_correlations()[0]
    >>> first.condition, first.r2, round(first.r, 4)
    ('1A-10mHz', 0.998, 0.999)
    """
    return tuple(
        _implied(table.number, condition, branch, table.select(condition, branch))
        for table in STATISTICS_TABLES
        for condition, branch in dict.fromkeys((c.condition, c.branch) for c in table.cells)
        if branch is not None
    )


def _implied(
    table: int, condition: str, branch: Branch, column: dict[str, PrintedCell]
) -> ImpliedCorrelation:
    r2, adjusted, sse, rmse = (column[name] for name in ("r2", "adj_r2", "sse", "rmse"))
    if r2.status is CellStatus.DAMAGED:
        return ImpliedCorrelation(table, condition, branch, r2.status, *[None] * 6)
    dof = sse.value / rmse.value**2
    whole = 1.0 - (1.0 - adjusted.value) * dof / (dof + FITTED_PARAMETERS - 1.0)
    return ImpliedCorrelation(
        table=table,
        condition=condition,
        branch=branch,
        status=r2.status,
        r2=r2.value,
        adj_r2=adjusted.value,
        dof=dof,
        r=float(np.sqrt(r2.value)),
        r_rounded=float(np.sqrt(r2.value - 0.5 * r2.resolution)),
        r_adjusted=float(np.sqrt(whole)),
    )


class ImpliedAverage(DocumentPart):
    """What the printed R² that can be read say of the average correlation factor that the text claims [1]."""

    columns: int = Field(description="columns of Tables 6 to 8 that can be read")
    lost: int = Field(description="those that can't")
    least: Number = Field(description="least r that any of the former allows")
    plain: Number = Field(description="mean of what they allow at least")
    fisher: Number = Field(description="the same by Fisher's transformation")
    lost_needed: Number = Field(
        description="mean of the lost ones at which that of all is no more than the claim"
    )
    claimed: Number = Field(description="the claim")
    r2_claimed: Number = Field(description="R² that goes with it at most")


def implied_average() -> ImpliedAverage:
    """Average of the correlations that the readable columns allow at least.

    Examples
    --------
    >>> found = implied_average()
    >>> found.columns, round(found.plain, 4), round(found.lost_needed, 2)
    (12, 0.999, 0.85)
    """
    columns = implied_correlations()
    r = np.array([c.r for c in columns if c.r is not None])
    lost = len(columns) - r.size
    return ImpliedAverage(
        columns=int(r.size),
        lost=lost,
        least=float(r.min()),
        plain=float(r.mean()),
        fisher=float(np.tanh(np.arctanh(r).mean())),
        lost_needed=float((CLAIMED * len(columns) - r.sum()) / lost),
        claimed=CLAIMED,
        r2_claimed=CLAIMED**2,
    )
