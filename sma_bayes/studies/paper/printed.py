"""Trends of Tables 9 to 12 with the scatter between tests that a repeated test shows.

Three tests in a row rise or fall together by chance now and then: how often depends on how well a test repeats. That is
learnt from what a straight line leaves over, and for 2 A from two test runs of which the paper prints both.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
from scipy.stats import t as student_t

from sma_bayes.paper.extremes import EXTREME_CONDITIONS, TABLE_9, extremes
from sma_bayes.paper.specifications import TEXT_VALUES, specification
from sma_bayes.paper.tables import PrintedTable
from sma_bayes.records.types import Condition
from sma_bayes.studies.conditions.effects import SettingEffect, operating_effects
from sma_bayes.studies.conditions.features import BOTH, Feature

SECOND_RUN: Final = Condition("2A-10mHz-line339", current=2.0, frequency=0.010)
"""The other test run at 2 A and 10 mHz, whose extremes the running text prints."""
DRAWS: Final = 8
"""Printed numbers have no posterior; as many equal draws stand for one."""


def printed_effects(table: PrintedTable) -> dict[str, SettingEffect]:
    """What the setting of a table does to each printed quantity and what follows from it, by name.

    Parameters
    ----------
    table : PrintedTable
        One of Tables 9 to 12.
    """
    rows = {EXTREME_CONDITIONS[name]: row for name, row in extremes(table).items()}
    if table is TABLE_9:
        rows[SECOND_RUN] = second_run() | {
            f"temperature_{end}": rows[EXTREME_CONDITIONS["2A-10mHz-table3"]][f"temperature_{end}"]
            for end in ("min", "max")
        }
    features = [f for condition, row in rows.items() for f in _features(condition, row)]
    return {e.feature: e for e in operating_effects(features)}


def second_run() -> dict[str, float]:
    """Extremes of stiffness of the second run [N/m]."""
    return {
        f"stiffness_{end}": specification(TEXT_VALUES, f"stiffness_{end}_fig10", "N/m")
        for end in ("min", "max")
    }


def _features(condition: Condition, row: dict[str, float]) -> Iterator[Feature]:
    def feature(name: str, value: float, unit: str, *, on_log: bool) -> Feature:
        return Feature(name, condition, BOTH, "", unit, np.full(DRAWS, value), "as printed", on_log)

    yield feature("least_temperature", row["temperature_min"], "degC", on_log=False)
    yield feature("peak_temperature", row["temperature_max"], "degC", on_log=False)
    if "stiffness_max" in row:
        low, high = row["stiffness_min"], row["stiffness_max"]
        yield feature("least_stiffness", low, "N/m", on_log=True)
        yield feature("greatest_stiffness", high, "N/m", on_log=True)
        yield feature("stiffness_ratio", high / low, "1", on_log=True)
        yield feature("stiffness_rise", high - low, "N/m", on_log=True)
        slope = (high - low) / (row["temperature_max"] - row["temperature_min"])
        yield feature("mean_slope", slope, "N/m/delta_degC", on_log=True)


def repeat_scatter(quantity: str) -> float:
    """Standard deviation of one test, estimated from the two runs at 2 A with one degree of freedom [unit].

    Parameters
    ----------
    quantity : str
        ``stiffness_min`` or ``stiffness_max`` [N/m].

    Examples
    --------
    >>> round(repeat_scatter("stiffness_max"), 2)
    7.55
    """
    return abs(extremes(TABLE_9)["2A-10mHz-table3"][quantity] - second_run()[quantity]) / float(np.sqrt(2.0))


def probability_positive(contrast: float, weights: tuple[float, ...], scatter: float) -> float:
    """Posterior probability that a contrast of test means is positive, scatter known with one degree of freedom.

    Under the prior ``1/sigma`` the contrast is Student t (A. Gelman et al., Bayesian Data Analysis, 3rd ed. (2013),
    section 3.2), here with one degree of freedom.

    Parameters
    ----------
    contrast : float
        As measured [unit].
    weights : tuple of float
        With which single tests enter it.
    scatter : float
        Estimated standard deviation of one test [unit].

    Examples
    --------
    >>> probability_positive(0.0, (1.0, -1.0), 1.0), round(probability_positive(1.0, (1.0,), 1.0), 2)
    (0.5, 0.75)
    """
    return float(student_t.cdf(contrast / (scatter * float(np.linalg.norm(weights))), 1))
