"""The shapes that one stage of transformation can have, as a rival of effects that claim a second one.

A curve that is not symmetric, has other tails than a logistic or slopes of its phases is described as well by two
stages as by the richer one-stage models, so a shape alone does not show a second stage. As an effect the richer shape
goes around whatever the model has already, and its evidence stands against that of the second stage.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import expit, logit

from sma_bayes.arrays import Floats
from sma_bayes.effects.transformation import curves
from sma_bayes.effects.types import Effect, Inputs, Response, Scales
from sma_bayes.parameters.distributions import LogNormal, Normal
from sma_bayes.parameters.space import Parameter
from sma_bayes.studies.gap.fitting import FittedHypothesis, fit_hypothesis

TINY: Final = 1e-12
FARTHEST: Final = 40.0
"""Bound of the argument of sinh; the share is 0 or 1 to rounding from 5 on."""
CURVES: Final = ("force", "displacement")
SOURCE: Final = "as in the priors of the model sinh_arcsinh_slopes"


@dataclass(frozen=True)
class OneStageShape:
    """Skew, tails and slopes of the phases: ``s -> 1/(1 + exp(-sinh(t asinh(logit s) + e)))``, each phase ``+ c T``.

    Four numbers for each channel and branch; where e, c are 0 and t is 1 nothing changes.
    """

    id = "one_stage_shape"
    title = "one transformation of another shape"
    equation = "s -> logistic(sinh(t asinh(logit s) + e)), and slopes of both phases"
    reference = "Jones and Pewsey, Sinh-arcsinh distributions, Biometrika 96 (2009) 761-780"
    needs = ("curve",)

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        out = []
        for channel in (c for c in CURVES if c in scales.step):
            steep = 0.15 * scales.span[channel] / scales.span["temperature"]
            unit = f"{scales.units[channel]}/K"
            for branch in ("heating", "cooling"):
                where = f"{channel}_{branch}"
                out += [
                    Parameter(f"e_{where}", "1", "asymmetry", Normal(0.0, 0.5), SOURCE),
                    Parameter(f"t_{where}", "1", "weight of the tails", LogNormal(1.0, 0.35), SOURCE),
                    Parameter(f"c_{where}", unit, "slope of the cold phase", Normal(0.0, steep), SOURCE),
                    Parameter(f"h_{where}", unit, "slope of the hot phase", Normal(0.0, steep), SOURCE),
                ]
        return tuple(out)

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        out, found = curves(response, inputs)
        heating, temperature = inputs["branch"] > 0.0, inputs["temperature"]
        middle = 0.5 * (np.min(temperature) + np.max(temperature))
        changed: dict[str, Floats] = {}
        for i, name in enumerate(c for c in CURVES if c in found):
            up, down = (theta[..., 8 * i + 4 * k : 8 * i + 4 * k + 4] for k in (0, 1))
            skew, tail, cold, hot = (
                np.where(heating, up[..., j, None], down[..., j, None]) for j in range(4)
            )
            curve = found[name]
            inner = tail * np.arcsinh(logit(np.clip(curve.share, TINY, 1.0 - TINY))) + skew
            share = expit(np.sinh(np.clip(inner, -FARTHEST, FARTHEST)))
            line = (1.0 - share) * cold + share * hot
            changed[name] = curve.value + curve.span * (share - curve.share) + line * (temperature - middle)
        return {**out, **changed}


def worth_of_one_stage(fitted: FittedHypothesis) -> float:
    """Log Bayes factor of the richer one-stage shape over a model as it is.

    Parameters
    ----------
    fitted : FittedHypothesis
        The model without a second stage.
    """
    extended = fitted.hypothesis.extended(OneStageShape())
    priors = [p.prior for p in OneStageShape().parameters(extended.scales)]
    plain = [float(p.transform.unconstrain(p.quantile(np.array(0.5)))) for p in priors]
    shaped = fit_hypothesis(extended, np.concatenate([fitted.z, plain]), fitted.noise)
    return shaped.ln_evidence - fitted.ln_evidence


def claims_a_stage(effect: Effect) -> bool:
    """Whether an effect claims a stage of its own, so that it has to beat the shapes of one."""
    return bool(getattr(effect, "further_stage", False))
