"""Keep heating and cooling of a card apart, as the solvers that read it need them.

Where the corners of curves are rounder than their hysteresis is wide, the tails of the law cross: with a few hundredths
of a phase left, heating is below cooling. No loop does that, and in a solver both transformations then go on at once,
whose equations become singular. So the exponents at that end of both branches are raised together, by as much as it
takes, on the scale of their logits: the tangents, and with them Ms, Mf, As and Af, stay where they are, and corners
become sharper than those that were measured.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.optimize import brentq
from scipy.special import expit

from sma_bayes.studies.card.features import logits
from sma_bayes.studies.card.law import crossed_at
from sma_bayes.studies.card.pooling import Constant, PooledConstants

LEFT: Final = {"martensite": ("n1", "n3"), "austenite": ("n2", "n4")}
"""Exponents of cooling and heating at the end where little of a phase is left."""
CROSSED: Final = 0.001
"""Share of a phase up to which branches may cross, in tails that no curve shows [1]."""
AIMED_AT: Final = 0.5 * CROSSED
"""What they are left to cross in where they did more [1]."""
FARTHEST: Final = 8.0
"""Greatest change of logits that is tried: exponents are all but one then, and tangents themselves cross."""


def crossing_of(law: PooledConstants, stresses: Sequence[float]) -> float:
    """Greatest share of a phase below which heating and cooling of a card cross at any of some stresses [MPa]; [1]."""
    values = {name: one.value for name, one in law.constants.items()}
    return max(max(_shares(values, law.shifts(stress))) for stress in stresses)


def _shares(c: Mapping[str, float], shifts: tuple[float, float]) -> tuple[float, float]:
    cooling, heating = shifts
    return crossed_at(
        (c["Ms"] + cooling, c["Mf"] + cooling, c["n1"], c["n2"]),
        (c["Af"] + heating, c["As"] + heating, c["n3"], c["n4"]),
    )


def kept_apart(law: PooledConstants, stresses: Sequence[float]) -> PooledConstants:
    """The law with heating above cooling at all of some stresses [MPa]; itself where it is so already.

    What is raised is not identified any more: the constraint decides it. Where even tangents cross, nothing helps, and
    the exponents stay as they were.
    """
    shifts = [law.shifts(stress) for stress in stresses]
    found = dict(law.constants)
    for phase, (name, names) in enumerate(LEFT.items()):

        def left(by: float, names: tuple[str, ...] = names, phase: int = phase) -> float:
            c = {n: one.value for n, one in found.items()}
            c |= {n: float(expit(logits(np.asarray(c[n])) + by)) for n in names}
            return max(_shares(c, s)[phase] for s in shifts)

        crossing = left(0.0)
        if crossing <= CROSSED or left(FARTHEST) > AIMED_AT:
            continue
        by = float(brentq(lambda by, left=left: left(by) - AIMED_AT, 0.0, FARTHEST, xtol=1e-3)) + 1e-3
        why = (
            f"with the corners that were measured, heating and cooling of the law cross where "
            f"{100.0 * crossing:.1f} % of {name} or less is left, which no loop does and no solver "
            f"follows: {' and '.join(names)} are raised until they do not"
        )
        for n in names:
            one = found[n]
            value, draws = (expit(logits(np.asarray(x)) + by) for x in (one.value, one.draws))
            found[n] = Constant(float(value), np.asarray(draws), False, why)
    return replace(law, constants=found)
