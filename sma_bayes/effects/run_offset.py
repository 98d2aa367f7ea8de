"""Runs that differ for no recorded cause."""

from __future__ import annotations

from dataclasses import dataclass

from sma_bayes.arrays import Floats
from sma_bayes.effects.scatter import REFERENCE, scatter_parameters, scattered
from sma_bayes.effects.types import Inputs, Response, Scales
from sma_bayes.parameters.space import Parameter


@dataclass(frozen=True)
class RunOffset:
    """Every run, or condition, has an offset and a transformation temperature of its own, as after mounting it anew.

    Each condition's own parameters absorb it completely; it shows where one set of them serves several. It says how
    much runs scatter, not why: a law of the load, of the ambient temperature or of time is preferred where it explains
    them. Running the same condition again tells what of it is chance.
    """

    id = "run_offset"
    title = "runs differ in offset and transformation temperature for no recorded cause"
    equation = "X -> X + s u_i, Tc -> Tc + s w v_i of either branch in run i"
    reference = REFERENCE
    needs = ("curve", "several_runs")
    members = ("condition",)

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        return scatter_parameters(scales, "run", "run")

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        return scattered(response, theta, inputs, "run")
