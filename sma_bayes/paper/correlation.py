"""What the printed statistics of Tables 6 to 8 imply for the correlation factor, beside the 0.95 that the text claims.

Of any curve ``r**2 >= R2``, since the best straight line through curve and data, whose share of variance is r squared,
misses the data by no more than the curve itself. So each printed R2 is a floor of r, and so is the R2 that a printed
adjusted R2 implies for the printed degrees of freedom.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from pydantic import Field

from sma_bayes.document_part import DocumentPart, Number, NumberOrNull
from sma_bayes.paper.specifications import TEXT_VALUES, specification
from sma_bayes.paper.tables import STATISTICS_TABLES, CellStatus, PrintedCell
from sma_bayes.paper.twin import FITTED_PARAMETERS
from sma_bayes.records.types import Branch

CLAIMED: Final = specification(TEXT_VALUES, "correlation_factor", "1")
"""Average correlation factor that the text states [1]."""
IMPLIED: Final = ("r2", "adj_r2", "dof", "r_from_r2", "r_from_r2_rounded", "r_from_adj_r2")
"""Numbers of a row that are null where R2 is lost."""


class ImpliedCorrelationRow(DocumentPart):
    """The correlation factor that a column of Tables 6 to 8 implies [1]."""

    table: int = Field(description="number of the table")
    condition: str = Field(description="id of the condition")
    branch: str = Field(description="`heating` or `cooling`")
    status: str = Field(description="of the printed R²")
    r2: NumberOrNull = Field(description="R² as printed; null, as what follows, where it is lost")
    r_from_r2: NumberOrNull = Field(description="least r that it allows")
    r_from_r2_rounded: NumberOrNull = Field(description="the same for the least R² that rounds to it")
    adj_r2: NumberOrNull = Field(description="adjusted R² as printed")
    dof: NumberOrNull = Field(description="residual degrees of freedom that SSE and RMSE imply")
    r_from_adj_r2: NumberOrNull = Field(description="least r that the adjusted R² allows, for 6 parameters")
    claimed: Number = Field(description="average that the text claims")


def implied_correlations() -> tuple[ImpliedCorrelationRow, ...]:
    """Every column of Tables 6 to 8, in their order.

    Examples
    --------
    >>> first = implied_correlations()[0]
    >>> first.condition, first.r2, round(first.r_from_r2, 4)
    ('1A-10mHz', 0.998, 0.999)
    """
    return tuple(
        _implied(table.number, condition, branch, column)
        for table in STATISTICS_TABLES
        for (condition, branch), column in table.columns().items()
        if branch is not None
    )


def _implied(
    table: int, condition: str, branch: Branch, column: dict[str, PrintedCell]
) -> ImpliedCorrelationRow:
    r2, adjusted, sse, rmse = (column[name] for name in ("r2", "adj_r2", "sse", "rmse"))
    numbers: dict[str, float | None] = dict.fromkeys(IMPLIED)
    if r2.status is not CellStatus.DAMAGED:
        dof = sse.value / rmse.value**2
        whole = 1.0 - (1.0 - adjusted.value) * dof / (dof + FITTED_PARAMETERS - 1.0)
        least = np.sqrt([r2.value, r2.value - 0.5 * r2.resolution, whole])
        numbers = dict(zip(IMPLIED, (r2.value, adjusted.value, dof, *least), strict=True))
    return ImpliedCorrelationRow(
        table=table,
        condition=condition,
        branch=branch.value,
        status=r2.status.value,
        claimed=CLAIMED,
        **numbers,
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
    r = np.array([c.r_from_r2 for c in columns if c.r_from_r2 is not None])
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
