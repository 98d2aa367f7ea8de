"""Offset, stroke and transformation temperatures that settle together until the alloy is trained."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.training_drift import TrainingDrift, trained
from sma_bayes.effects.transformation import curves, moved, stretched
from sma_bayes.effects.types import Inputs, Response, Scales, either_sign
from sma_bayes.parameters.space import Parameter

STROKE = 2.0
"""Change of the stroke, over it, that goes with a drift by the whole stroke."""
SHIFT = 100.0
"""Shift of a transformation that goes with a drift by the whole stroke [K]."""
FARTHEST = 200.0
"""Greatest shift [K]."""
LEAST = 0.05
"""Least share of the stroke that is left."""


@dataclass(frozen=True)
class Training:
    """One approach to the trained state, ``g(N)``, in all that the plateaus and temperatures of a sweep are.

    Dislocations and retained martensite that cycling leaves behind move the wire as a whole, change how much of it
    still transforms, and ease the transformation in one direction, all at one pace. So the displacement gets the drift
    y of `training_drift`, and with it each branch another stroke and another transformation temperature, in proportion.
    The stiffness, dF/dX, falls as the stroke grows. Where only the offset changes, `training_drift` says the same with
    two numbers for six and is preferred by its evidence. A twentieth of the stroke stays at least, and no
    transformation moves by more than `FARTHEST`.
    """

    id = "training"
    title = "offset, stroke and transformation temperatures settle together"
    equation = (
        "X(T) -> X_cold + (1 + k y) (X(T - m y) - X_cold) + y, y = d (1 - exp(-(N - 1)/N0))/(1 - exp(-(L - 1)/N0)), "
        "L the last cycle; k_heating and m_heating while heating, k_cooling and m_cooling while cooling"
    )
    reference = (
        "Auricchio, Marfia and Sacco, Comput. Struct. 81 (2003) 2301-2317: permanent strain, two-way effect and "
        "transformation stresses evolve together with cycling; Lagoudas, Shape Memory Alloys (Springer, 2008)"
    )
    needs = ("curve", "displacement", "cycles")

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        drift, pace = TrainingDrift().parameters(scales)
        unit, span = scales.units["displacement"], scales.span["displacement"]
        per = "1" if unit == "1" else f"1/{unit}"
        stroke, shift = either_sign(STROKE / span), either_sign(SHIFT / span)
        ease = "K" if unit == "1" else f"K/{unit}"
        of_stroke = "90 % within 20 % where the drift is 10 % of the stroke"
        of_shift = "90 % within 10 K where the drift is 10 % of the stroke"
        return (
            drift,
            Parameter(
                "k_heating",
                per,
                "change of the stroke while heating, over it and the drift",
                stroke,
                of_stroke,
            ),
            Parameter(
                "k_cooling",
                per,
                "change of the stroke while cooling, over it and the drift",
                stroke,
                of_stroke,
            ),
            Parameter(
                "m_heating", ease, "rise of the transformation while heating, over the drift", shift, of_shift
            ),
            Parameter(
                "m_cooling", ease, "rise of the transformation while cooling, over the drift", shift, of_shift
            ),
            pace,
        )

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        drift, k_heating, k_cooling, m_heating, m_cooling, pace = (theta[..., i : i + 1] for i in range(6))
        drifted, heating = drift * trained(inputs, pace), inputs["branch"] > 0.0
        stroke = np.maximum(1.0 + np.where(heating, k_heating, k_cooling) * drifted, LEAST)
        shift = np.clip(np.where(heating, m_heating, m_cooling) * drifted, -FARTHEST, FARTHEST)

        def shifted(v: Inputs) -> dict[str, Floats]:
            return moved(response, v, -shift)

        out, found = curves(shifted, inputs)
        out = stretched(out, found["displacement"], found["displacement"].cold, stroke)
        return {**out, "displacement": out["displacement"] + drifted}
