"""Cycles that differ for no recorded cause."""

from __future__ import annotations

from dataclasses import dataclass

from sma_bayes.arrays import Floats
from sma_bayes.effects.scatter import REFERENCE, scatter_parameters, scattered
from sma_bayes.effects.types import Inputs, Response, Scales
from sma_bayes.parameters.space import Parameter


@dataclass(frozen=True)
class CycleOffset:
    """Every cycle has an offset and a transformation temperature of its own, without an order.

    What does not repeat from cycle to cycle: a specimen that slips, a zero that is set anew, a rig that sticks.
    Training and fatigue order the cycles and are preferred where they explain them; whether that order is chance,
    exchanging the cycles tells.
    """

    id = "cycle_offset"
    title = "cycles differ in offset and transformation temperature for no recorded cause"
    equation = "X -> X + s u_i, Tc -> Tc + s w v_i of either branch in cycle i"
    reference = REFERENCE
    needs = ("curve", "several_cycles")
    members = ("cycle",)

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        return scatter_parameters(scales, "cycle_of_all", "cycle")

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        return scattered(response, theta, inputs, "cycle_of_all")
