"""The spring with its bias spring: Eq. (8) and what the named arrangements really give.

The paper writes ``K = K1 - K2`` for an arrangement that it calls parallel. A node held between two grounded
springs has ``K1 + K2``; two springs end to end have ``K1 K2/(K1 + K2)``. All three are offered by name, so
that nobody gets one where another was meant.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.errors import QuantityError

BIAS_STIFFNESS = 130.0
"""Stiffness of the steel bias spring [N/m], Table 2 of the paper."""
BIAS_STIFFNESS_SD = 6.5
"""Standard deviation of the bias stiffness [N/m]: 5 %, a usual tolerance of wound springs (DIN EN 15800 grade 2);
the paper states none."""


class Arrangement(StrEnum):
    """How the spring and the bias spring act on the load."""

    PUBLISHED_DIFFERENCE = "published_difference"
    PARALLEL = "parallel"
    SERIES = "series"


@dataclass(frozen=True, slots=True)
class ArrangedSpring:
    """A bias spring and how it is arranged.

    Attributes
    ----------
    arrangement : Arrangement
    stiffness, sd : float
        Stiffness K2 and its standard deviation [N/m].
    """

    arrangement: Arrangement
    stiffness: float = BIAS_STIFFNESS
    sd: float = BIAS_STIFFNESS_SD

    def __post_init__(self) -> None:
        if not (np.isfinite(self.stiffness) and self.stiffness > 0 and np.isfinite(self.sd) and self.sd >= 0):
            raise QuantityError(
                f"bias spring of {self.stiffness!r} N/m with standard deviation {self.sd!r} N/m",
                expected="a positive stiffness and a standard deviation that is not negative",
            )


def overall_stiffness(k1: Floats, k2: Floats, arrangement: Arrangement) -> Floats:
    """Stiffness of the pair.

    Parameters
    ----------
    k1, k2 : ndarray
        Stiffness of the alloy spring and of the bias spring [N/m]; they broadcast.
    arrangement : Arrangement

    Returns
    -------
    ndarray
        [N/m].

    Examples
    --------
    >>> import numpy as np
    >>> float(overall_stiffness(np.array(170.0), np.array(130.0), Arrangement.PUBLISHED_DIFFERENCE))
    40.0
    >>> float(overall_stiffness(np.array(130.0), np.array(130.0), Arrangement.SERIES))
    65.0
    """
    if arrangement is Arrangement.PUBLISHED_DIFFERENCE:
        return np.asarray(k1 - k2)
    if arrangement is Arrangement.PARALLEL:
        return np.asarray(k1 + k2)
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(1.0 / (1.0 / k1 + 1.0 / k2))
