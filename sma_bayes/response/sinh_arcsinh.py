"""Transformations that are not symmetric, or whose tails are longer or shorter than those of a logistic curve.

    s = 1/(1 + exp(-sinh(tail asinh(rate u) + skew)))

At ``skew = 0`` and ``tail = 1`` this is the logistic curve. A positive skew lets the transformation come early and end
slowly; below 1 the tail makes both ends slow without the middle being so.

References
----------
M. C. Jones and A. Pewsey, Sinh-arcsinh distributions, Biometrika 96 (2009) 761, doi:10.1093/biomet/asp053, where the
transformation is applied to a normal variable.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.special import expit

from sma_bayes.arrays import Floats
from sma_bayes.parameters.roles import Role
from sma_bayes.response.phase_lines import Argument, LogisticArgument, Parameters

SINH_ARGUMENT_BOUND = 150.0
"""Bound of the argument of sinh: the share is 0 or 1 to rounding from 8 on, and squares must not overflow."""


@dataclass(frozen=True)
class SinhArcsinhSlopes(LogisticArgument):
    """Asymmetric transformation with free tails between two sloped phases; see `PhaseLines`."""

    name = "sinh_arcsinh_slopes"
    rung = 3
    reference = "Eqs. (2) and (4) with the sinh-arcsinh transformation and a slope of each phase; K = F'/X'"
    shape: ClassVar[tuple[Role, ...]] = (Role.SKEW, Role.TAIL)
    meanings = {Role.SKEW: "asymmetry of the transformation", Role.TAIL: "weight of the tails"}  # noqa: RUF012

    def passed(self, p: Parameters, u: Floats) -> Floats:
        """Share of the transformation."""
        return np.asarray(expit(np.sinh(_inner(p, u)[0])))

    def argument(self, p: Parameters, u: Floats) -> Argument:
        """``sinh(tail asinh(rate u) + skew)``."""
        rate, tail = p[Role.RATE], p[Role.TAIL]
        v, w = _inner(p, u)
        root = np.hypot(1.0, rate * u)
        value, rise = np.sinh(v), np.cosh(v)
        dv = tail * rate / root
        first = dv * rise
        second = dv * dv * value - first * (rate / root) ** 2 * u

        def by(change: Floats, of_slope: Floats) -> tuple[Floats, Floats]:
            """Of the argument and its slope, from those of `v` and of its slope."""
            return change * rise, of_slope * rise + dv * value * change

        changes: dict[str, tuple[Floats, Floats]] = {
            Role.RATE: by(tail * u / root, tail / root**3),
            Role.SKEW: by(np.ones_like(w), np.zeros_like(w)),
            Role.TAIL: by(w, rate / root),
        }
        return Argument(value, first, second, changes)


@dataclass(frozen=True)
class SinhArcsinh(SinhArcsinhSlopes):
    """Asymmetric transformation with free tails between two level phases; see `PhaseLines`."""

    name = "sinh_arcsinh"
    rung = 2
    reference = "Eqs. (2) and (4) with the sinh-arcsinh transformation; K = F'/X'"
    sloped = False


def _inner(p: Parameters, u: Floats) -> tuple[Floats, Floats]:
    """``tail asinh(rate u) + skew``, bounded, and ``asinh(rate u)``."""
    w = np.arcsinh(p[Role.RATE] * u)
    return np.clip(p[Role.TAIL] * w + p[Role.SKEW], -SINH_ARGUMENT_BOUND, SINH_ARGUMENT_BOUND), w
