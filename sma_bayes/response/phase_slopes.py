"""The published sigmoid between phases that have slopes of their own.

    s = 1/(1 + exp(-rate u))

Either phase expands, stretches and stiffens with temperature on its own, so real records run out in lines that are not
level. With slopes the stiffness ``K = F'/X'`` tends to the ratio of those of force and displacement, while Eq. (7)
falls to zero or grows without bound wherever A2 differs from B2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import expit

from sma_bayes.arrays import Floats
from sma_bayes.parameters.roles import Role
from sma_bayes.response.phase_lines import Argument, LogisticArgument, Parameters


@dataclass(frozen=True)
class PhaseSlopes(LogisticArgument):
    """Logistic transformation between two sloped phases; see `PhaseLines`."""

    name = "phase_slopes"
    rung = 2
    reference = "Eqs. (2) and (4) with a slope of each phase; K = F'/X'"

    def passed(self, p: Parameters, u: Floats) -> Floats:
        """Share of the transformation."""
        return np.asarray(expit(p[Role.RATE] * u))

    def argument(self, p: Parameters, u: Floats) -> Argument:
        """``rate u``."""
        rate, one = p[Role.RATE], np.ones_like(u)
        return Argument(rate * u, rate * one, np.zeros_like(u), {Role.RATE: (u, one)})
