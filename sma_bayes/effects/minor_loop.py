"""Minor loops, after a transformation that was not completed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.transformation import curves
from sma_bayes.effects.types import Inputs, Response, Scales
from sma_bayes.parameters.distributions import Normal
from sma_bayes.parameters.space import Parameter
from sma_bayes.records.history import starts

LEAST: Final = 1e-6
"""Share transformed below which there is nothing left to scale."""


@dataclass(frozen=True)
class MinorLoop:
    """A branch starts from the share reached, and does its own curve with what there is.

    With the shares ``h`` and ``c`` of the major heating and cooling curve: cooling from the temperature T1 at a share
    s1 follows ``c(T) s1/c(T1)``, heating from T2 at s2 follows ``1 - (1 - h(T)) (1 - s2)/(1 - h(T2))``. The first sweep
    after a break is taken from the major loop. Spans absorb it where every sweep of a condition turns at the same
    temperature; a ladder of peaks shows it, and nothing else in the catalogue does that.
    """

    id = "minor_loop"
    title = "incomplete transformation, so that branches start from the share reached"
    equation = "share -> share + w (share from the turning point - share)"
    reference = (
        "proportional minor loops: Liang and Rogers, One-dimensional thermomechanical constitutive relations for "
        "shape memory materials, J. Intell. Mater. Syst. Struct. 1 (1990) 207-234"
    )
    needs = ("curve", "several_peaks", "both_branches")

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        prior = Normal(0.7, 0.4)
        return (
            Parameter(
                "w",
                "1",
                "share of the correction",
                prior,
                "none to the full rule and beyond: 90 % between 0.042 and 1.36",
            ),
        )

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        out, branch = response(inputs), inputs["branch"]
        heating = curves(response, {**inputs, "branch": np.ones_like(branch)})[1]
        cooling = curves(response, {**inputs, "branch": -np.ones_like(branch)})[1]
        changed = {}
        for name, up in heating.items():
            down = cooling[name]
            major = np.where(branch > 0.0, up.share, down.share)
            span = np.where(branch > 0.0, up.span, down.span)
            turned = _turned(up.share, down.share, inputs)
            changed[name] = out[name] + theta[..., :1] * span * (turned - major)
        return {**out, **changed}


def _turned(up: Floats, down: Floats, inputs: Inputs) -> Floats:
    """Share transformed along a history, each sweep from where the one before it ended, shape (..., n)."""
    on_heating = inputs["branch"] > 0.0
    share = np.where(on_heating, up, down)
    for low, high, begins in _sweeps(inputs):
        if begins:
            continue
        reached, part = share[..., low - 1, None], slice(low, high)
        if on_heating[low]:
            left = np.clip((1.0 - reached) / np.maximum(1.0 - up[..., low, None], LEAST), 0.0, 1.0)
            share[..., part] = 1.0 - left * (1.0 - up[..., part])
        else:
            left = np.clip(reached / np.maximum(down[..., low, None], LEAST), 0.0, 1.0)
            share[..., part] = left * down[..., part]
    return share


def _sweeps(inputs: Inputs) -> Iterator[tuple[int, int, bool]]:
    """First sample and end of each sweep, and whether what came before it is unknown."""
    breaks = starts(inputs)
    turns = np.flatnonzero(breaks | (np.diff(inputs["branch"], prepend=0.0) != 0.0))
    for low, high in pairwise([*turns.tolist(), breaks.size]):
        yield low, high, bool(breaks[low])
