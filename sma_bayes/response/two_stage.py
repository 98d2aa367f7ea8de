"""Two transformations in sequence, as through the R-phase, between phases that have slopes.

    s = share/(1 + exp(-rate u)) + (1 - share)/(1 + exp(-rate_2 (u - gap)))

``u`` counts from the midpoint of the first stage, the one at lower temperature, since the gap is positive. At
``share = 1`` this is `PhaseSlopes`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import expit

from sma_bayes.arrays import Floats
from sma_bayes.parameters.roles import Role
from sma_bayes.response.phase_lines import Argument, Parameters, PhaseLines, Share, between


@dataclass(frozen=True)
class TwoStage(PhaseLines):
    """Two logistic stages between two sloped phases; see `PhaseLines`."""

    name = "two_stage"
    rung = 4
    reference = "Eqs. (2) and (4) with two stages and a slope of each phase; K = F'/X'"
    stages = 2
    shape = (Role.SHARE, Role.GAP, Role.SECOND_RATE)
    meanings = {  # noqa: RUF012
        Role.SHARE: "share of the first stage",
        Role.GAP: "distance of the second stage from the first",
        Role.SECOND_RATE: "rate of the second stage",
    }

    def passed(self, p: Parameters, u: Floats) -> Floats:
        """Share of both stages together."""
        share = p[Role.SHARE]
        second = expit(p[Role.SECOND_RATE] * (u - p[Role.GAP]))
        return np.asarray(share * expit(p[Role.RATE] * u) + (1.0 - share) * second)

    def stage(self, theta: Floats, channel: str, temperature: Floats, number: int) -> Floats:
        """See `ResponseModel.stage`; the curve between the stages is their common plateau."""
        p, u = self._of(channel, theta, temperature)
        share = p[Role.SHARE]
        if number == 0:
            return between(p, u, share * expit(p[Role.RATE] * u))
        second = expit(p[Role.SECOND_RATE] * (u - p[Role.GAP]))
        return between(p, u, share + (1.0 - share) * second)

    def share(self, p: Parameters, u: Floats) -> Share:
        """See `PhaseLines.share`."""
        share = p[Role.SHARE]
        early, late = _stage(p[Role.RATE], u), _stage(p[Role.SECOND_RATE], u - p[Role.GAP])
        rest = 1.0 - share
        by = {
            Role.RATE: tuple(share * x for x in early.by["rate"]),
            Role.SHARE: (early.value - late.value, early.first - late.first),
            Role.GAP: (-rest * late.first, -rest * late.second),
            Role.SECOND_RATE: tuple(rest * x for x in late.by["rate"]),
        }
        value, first, second = (
            share * getattr(early, name) + rest * getattr(late, name) for name in ("value", "first", "second")
        )
        return Share(value, first, second, {k: (v[0], v[1]) for k, v in by.items()})


def _stage(rate: Floats, u: Floats) -> Share:
    one = np.ones_like(u)
    return Argument(rate * u, rate * one, np.zeros_like(u), {"rate": (u, one)}).share()
