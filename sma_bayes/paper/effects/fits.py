"""Effects of the errata about the printed quality of the fits: Tables 6 to 8, and what r = 0.95 would mean."""

from __future__ import annotations

from functools import partial
from typing import Final

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm

from sma_bayes.paper.effects.amount import Amount, Effect
from sma_bayes.paper.effects.equations import between
from sma_bayes.paper.extremes import TABLE_9, TABLE_12, extremes
from sma_bayes.paper.specifications import TABLE_2, TEXT_VALUES, specification
from sma_bayes.paper.tables import (
    STATISTICS_TABLES,
    TABLE_6,
    TABLE_7,
    TABLE_8,
    CellStatus,
    PrintedCell,
    PrintedTable,
)
from sma_bayes.paper.twin import FITTED_PARAMETERS
from sma_bayes.quantities import convert
from sma_bayes.records.types import Branch


def adjusted_r2(r2: float, dof: float, parameters: int = FITTED_PARAMETERS) -> float:
    """Adjusted R2, ``1 - (1 - R2)(n - 1)/(n - p)``.

    Parameters
    ----------
    r2 : float
        R2 [1].
    dof : float
        Residual degrees of freedom n - p [1].
    parameters : int
        p, the intercept or offset included [1].

    Examples
    --------
    >>> round(adjusted_r2(0.9980, 85), 4)
    0.9979
    """
    return 1 - (1 - r2) * (dof + parameters - 1) / dof


def degrees_of_freedom(sse: float, rmse: float) -> float:
    """Residual degrees of freedom that a sum of squares and its root mean imply, ``SSE/RMSE²`` [1].

    Examples
    --------
    >>> round(degrees_of_freedom(0.0536, 0.0251))
    85
    """
    return sse / rmse**2


def fitted_parameters(r2: float, adjusted: float, dof: float) -> float:
    """Number of parameters at which R2 and adjusted R2 agree, ``1 + dof ((1 - adj)/(1 - R2) - 1)`` [1].

    Examples
    --------
    >>> round(fitted_parameters(0.9982, 0.9977, 19), 1)
    6.3
    """
    return 1 + dof * ((1 - adjusted) / (1 - r2) - 1)


def _column(table: PrintedTable, condition: str, branch: Branch) -> dict[str, float]:
    return {name: cell.value for name, cell in table.select(condition, branch).items()}


def _readable() -> list[dict[str, PrintedCell]]:
    """Columns of Tables 6 to 8 that are not lost."""
    columns = (column for table in STATISTICS_TABLES for column in table.columns().values())
    return [c for c in columns if c["r2"].status is not CellStatus.DAMAGED]


def _adjusted_effect(condition: str, branch: Branch, claimed: str) -> tuple[Amount, ...]:
    """Adjusted R2 of a column, and the number of parameters at which it would agree with R2."""
    c = _column(TABLE_6, condition, branch)
    dof = degrees_of_freedom(c["sse"], c["rmse"])
    return (
        Amount("adjusted R2 as printed", c["adj_r2"]),
        Amount(
            "adjusted R2 that R2, SSE and RMSE give for 6 parameters",
            adjusted_r2(c["r2"], dof),
            claimed=claimed,
        ),
        Amount("parameters that the printed pair needs", fitted_parameters(c["r2"], c["adj_r2"], dof)),
    )


def adjusted_1a_heating() -> tuple[Amount, ...]:
    """Adjusted R2 of 1 A heating; the printed pair needs (n - 1)/(n - p) = 6."""
    c = _column(TABLE_6, "1A-10mHz", Branch.HEATING)
    return (
        *_adjusted_effect("1A-10mHz", Branch.HEATING, "0.9979"),
        Amount("(n - 1)/(n - p) that the printed pair needs", (1 - c["adj_r2"]) / (1 - c["r2"]), claimed="6"),
        Amount("n - p from SSE and RMSE", degrees_of_freedom(c["sse"], c["rmse"]), claimed="85"),
    )


def misplaced_point() -> tuple[Amount, ...]:
    """SSE of 150 g heating as printed and with the decimal point moved by one place."""
    cell = TABLE_7.select("150g-10mHz", Branch.HEATING)["sse"]
    c = _column(TABLE_7, "150g-10mHz", Branch.HEATING)
    moved = cell.value if cell.reconstructed is None else cell.reconstructed
    printed, corrected = (degrees_of_freedom(sse, c["rmse"]) for sse in (c["sse"], moved))
    return (
        Amount("n - p as printed", printed, claimed="189"),
        Amount("parameters it would take", fitted_parameters(c["r2"], c["adj_r2"], printed), claimed="54"),
        Amount("n - p with 0.0058", corrected, claimed="19"),
        Amount(
            "parameters it would take with 0.0058",
            fitted_parameters(c["r2"], c["adj_r2"], corrected),
            claimed="6",
        ),
    )


def points() -> tuple[Amount, ...]:
    """Points and parameters of the fits, from the columns whose SSE and RMSE are sound."""
    sound = [c for c in _readable() if c["sse"].sound and c["rmse"].sound]
    dof = np.array([degrees_of_freedom(c["sse"].value, c["rmse"].value) for c in sound])
    counted = [
        fitted_parameters(c["r2"].value, c["adj_r2"].value, d)
        for c, d in zip(sound, dof, strict=True)
        if c["adj_r2"].sound
    ]
    return (
        *between("n - p", dof, claimed=("20", "122")),
        *between("n with 6 parameters", np.round(dof) + FITTED_PARAMETERS, claimed=("26", "128")),
        Amount("parameters counted, median", float(np.median(counted)), claimed="6"),
    )


def _copied(table: PrintedTable) -> tuple[Amount, ...]:
    """Columns that repeat others."""
    values = [[cell.printed for cell in column.values()] for column in table.columns().values()]
    copies = sum(column in values[:i] for i, column in enumerate(values))
    lost = sum(cell.status is CellStatus.DAMAGED for cell in table.cells)
    return Amount("columns that repeat an earlier one, of 6", float(copies)), Amount(
        "values lost", float(lost)
    )


def copied_stiffness() -> tuple[Amount, ...]:
    """Stiffness columns of Table 12 that repeat the frequency and the least temperature."""
    copies = 0
    for (condition, _), row in TABLE_12.columns().items():
        frequency = row["stiffness_min"].printed == condition.split("-")[1].removesuffix("mHz")
        copies += frequency + (row["stiffness_max"].printed == row["temperature_min"].printed)
    return (
        Amount("stiffness values that copy another column, of 6", float(copies)),
        Amount("candidate for 10 mHz from line 339, least stiffness", _fig10("min"), "N/m"),
        Amount("candidate for 10 mHz from line 339, greatest stiffness", _fig10("max"), "N/m"),
    )


def _fig10(end: str) -> float:
    """Least or greatest stiffness of 2 A, 10 mHz in the running text [N/m]."""
    return specification(TEXT_VALUES, f"stiffness_{end}_fig10", "N/m")


def two_runs() -> tuple[Amount, ...]:
    """Extremes of 2 A, 10 mHz in Table 9 over those of the text."""
    row = extremes(TABLE_9)["2A-10mHz-table3"]
    return tuple(
        Amount(f"{word} stiffness, Table 9 over line 339", row[f"stiffness_{end}"] / _fig10(end))
        for word, end in (("least", "min"), ("greatest", "max"))
    )


def correlation_of_r2() -> tuple[Amount, ...]:
    """Correlation that the printed R2 imply, and R2 that the printed correlation implies.

    For a least-squares fit r is at least ``sqrt(R2)``; the two are equal where the residuals sum to zero and are
    uncorrelated with the curve, as they nearly are at these R2.
    """
    r = np.sqrt([c["r2"].value for c in _readable()])
    claim = specification(TEXT_VALUES, "correlation_factor", "1")
    return (
        Amount("r at R2 = 0.998", float(np.sqrt(0.998)), claimed="0.999"),
        *between("r of the columns that can be read", r),
        Amount("their plain mean", float(r.mean())),
        Amount("their mean by Fisher z", float(np.tanh(np.arctanh(r).mean()))),
        Amount("R2 at r = 0.95", claim**2),
    )


def error_over_range() -> tuple[Amount, ...]:
    """RMSE of the heating fits over the range of stiffness in Table 9, and R2 at the three currents."""
    found = []
    for condition, row in extremes(TABLE_9).items():
        rmse = float(convert(_column(TABLE_6, condition, Branch.HEATING)["rmse"], "N/cm", "N/m"))
        share = 100 * rmse / (row["stiffness_max"] - row["stiffness_min"])
        current = condition.split("-")[0]
        found.append(Amount(f"RMSE over the range of stiffness, {current} heating", share, "percent"))
    r2 = np.array([_column(TABLE_6, c, Branch.HEATING)["r2"] for c in extremes(TABLE_9)])
    return (*found, Amount("gain of R2 from 1 A to 2 A, heating", float(r2[-1] - r2[0]), claimed="0.000"))


def difference_quotient_cdf(ratio: float, step: float, noise: float) -> float:
    """Probability that a noisy difference quotient is at most `ratio` times the true one.

    Both differences are ``step + e`` in units of their own span, with e normal of standard deviation
    ``sqrt(2) noise``, independent of each other: the quotient ``U/V`` of two normals. Integrated over V.

    Parameters
    ----------
    ratio : float
        Quotient over the true stiffness [1].
    step, noise : float
        Step between samples and standard deviation of one sample, as shares of the span [1].
    """
    sd = np.sqrt(2.0) * noise / step

    total = 0.0
    for low, high in ((1 - 9 * sd, 0.0), (0.0, 1 + 9 * sd)):
        v = np.linspace(low, high, 4001)
        below = norm.cdf((ratio * v - 1) / sd)
        share = below if high > 0 else 1 - below
        total += float(np.trapezoid(norm.pdf(v, 1, sd) * share, v))
    return total


def noisy_quotient() -> tuple[Amount, ...]:
    """1 and 99 % points of dF/dX from neighbouring samples: 100 steps, noise of 1 % of the span on both.

    The settings behind the claimed numbers are not stated; these are the project's own.
    """
    true = specification(TABLE_2, "spring_rate", "N/m")

    def quantile(level: float) -> float:
        cdf = partial(difference_quotient_cdf, step=0.01, noise=0.01)
        return true * float(brentq(lambda ratio: cdf(ratio) - level, -500.0, 500.0))

    return (
        Amount("true stiffness", true, "N/m", "130"),
        Amount("1 % point of the quotient", quantile(0.01), "N/m", "-6300"),
        Amount("99 % point of the quotient", quantile(0.99), "N/m", "2600"),
    )


EFFECTS: Final[dict[str, Effect]] = {
    "E20": adjusted_1a_heating,
    "E21": partial(_adjusted_effect, "2A-10mHz-table3", Branch.COOLING, "0.9976"),
    "E22": misplaced_point,
    "E23": points,
    "E24": partial(_copied, TABLE_7),
    "E25": partial(_copied, TABLE_8),
    "E26": copied_stiffness,
    "E27": two_runs,
    "E28": correlation_of_r2,
    "E30": error_over_range,
    "E31": noisy_quotient,
    "N03": partial(_adjusted_effect, "1A-10mHz", Branch.COOLING, ""),
}
"""Effects by id of the erratum."""
