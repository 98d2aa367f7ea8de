"""The shapes that one stage of transformation can have, as rivals of every effect.

A curve that is not symmetric, has other tails than a logistic or slopes of its phases is described as well by many an
effect, a second stage among them, as by the richer one-stage models, so a shape alone shows none of them. As an effect
the richer shape goes around whatever the model has already, and its evidence stands against that of the effect. The
shapes are those of the ladder of models, from few numbers to many: an effect of two numbers must not win because the
shape that it imitates was offered with sixteen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
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
SINH_ARGUMENT_BOUND: Final = 40.0
"""Bound of the argument of sinh; the share is 0 or 1 to rounding from 5 on."""
CURVES: Final = ("force", "displacement")
BRANCHES: Final = ("heating", "cooling")
SOURCE: Final = "as in the priors of the model sinh_arcsinh_slopes"


SKEW, TAIL, COLD, HOT = "skew", "tail", "cold", "hot"
NEUTRAL_VALUES: Final = {SKEW: 0.0, TAIL: 1.0, COLD: 0.0, HOT: 0.0}
"""Numbers with which nothing changes."""


@dataclass(frozen=True)
class OneStageShape:
    """Skew, tails and slopes of the phases: ``s -> 1/(1 + exp(-sinh(t asinh(logit s) + e)))``, each phase ``+ c T``.

    At most four numbers for each channel and branch; where e, c are 0 and t is 1 nothing changes.

    Attributes
    ----------
    pivot : float
        Temperature at which slopes add nothing, the same in all histories [degC].
    numbers : tuple of str
        Which of skew e, tail t, slopes of the cold and of the hot phase are free.
    together : bool
        Whether skew and tail are the same in all channels.
    """

    pivot: float
    numbers: tuple[str, ...] = (SKEW, TAIL, COLD, HOT)
    together: bool = False

    id = "one_stage_shape"
    title = "one transformation of another shape"
    equation = "s -> logistic(sinh(t asinh(logit s) + e)), and slopes of both phases"
    reference = "Jones and Pewsey, Sinh-arcsinh distributions, Biometrika 96 (2009) 761-780"
    needs = ("curve",)

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        return tuple(
            _parameter(number, place, scales)
            for number, place in self._places([c for c in CURVES if c in scales.step])
        )

    def _places(self, channels: Sequence[str]) -> list[tuple[str, str]]:
        """Each number, and where it acts: in a channel and branch, or in a branch alone."""
        out = []
        for branch in BRANCHES:
            for number in self.numbers:
                alike = self.together and number in (SKEW, TAIL)
                out += [(number, branch)] if alike else [(number, f"{c}_{branch}") for c in channels]
        return out

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        out, found = curves(response, inputs)
        heating = inputs["branch"] > 0.0
        values = {place: theta[..., i, None] for i, place in enumerate(self._places(list(found)))}

        def along(number: str, channel: str) -> Floats:
            """A number at each sample."""
            up, down = (
                values.get(
                    (number, b), values.get((number, f"{channel}_{b}"), np.array(NEUTRAL_VALUES[number]))
                )
                for b in BRANCHES
            )
            return np.where(heating, up, down)

        changed: dict[str, Floats] = {}
        for name, curve in found.items():
            skew, tail, cold, hot = (along(n, name) for n in (SKEW, TAIL, COLD, HOT))
            inner = tail * np.arcsinh(logit(np.clip(curve.share, TINY, 1.0 - TINY))) + skew
            share = expit(np.sinh(np.clip(inner, -SINH_ARGUMENT_BOUND, SINH_ARGUMENT_BOUND)))
            line = (1.0 - share) * cold + share * hot
            leaning = line * (inputs["temperature"] - self.pivot)
            changed[name] = curve.value + curve.span * (share - curve.share) + leaning
        return {**out, **changed}


def _parameter(number: str, place: str, scales: Scales) -> Parameter:
    if number == SKEW:
        return Parameter(f"e_{place}", "1", "asymmetry", Normal(0.0, 0.5), SOURCE)
    if number == TAIL:
        return Parameter(f"t_{place}", "1", "weight of the tails", LogNormal(1.0, 0.35), SOURCE)
    channel = place.split("_")[0]
    steep = 0.15 * scales.span[channel] / scales.span["temperature"]
    unit, letter = f"{scales.units[channel]}/K", "c" if number == COLD else "h"
    meaning = f"slope of the {number} phase"
    return Parameter(f"{letter}_{place}", unit, meaning, Normal(0.0, steep), SOURCE)


SHAPES: Final = (
    ((SKEW,), True),
    ((SKEW, TAIL), True),
    ((COLD, HOT),),
    ((SKEW, TAIL, COLD, HOT),),
)
"""Numbers that are free, and whether skew and tail are the same in all channels: the rungs of the ladder of models."""


@dataclass(slots=True, eq=False)
class OneStageShapes:
    """What the shapes of one stage are worth in a model as it is; each is fitted once, when it is asked for.

    Attributes
    ----------
    fitted : FittedHypothesis
        The model.
    """

    fitted: FittedHypothesis
    _found: list[float] = field(default_factory=list)

    def worth(self, enough: float = np.inf) -> float:
        """Log Bayes factor of the best shape; -inf where no curve was seen.

        Parameters
        ----------
        enough : float
            Further shapes are not tried once one is worth more.
        """
        while max(self._found, default=-np.inf) <= enough and len(self._found) < len(self._shapes()):
            self._found.append(self._worth_of(self._shapes()[len(self._found)]))
        return max(self._found, default=-np.inf)

    def _shapes(self) -> tuple[OneStageShape, ...]:
        scales = self.fitted.hypothesis.scales
        if not any(c in scales.step for c in CURVES):
            return ()
        pivot = 0.5 * (scales.low["temperature"] + scales.high["temperature"])
        return tuple(OneStageShape(pivot, *shape) for shape in SHAPES)

    def _worth_of(self, shape: OneStageShape) -> float:
        extended = self.fitted.hypothesis.extended(shape)
        priors = [p.prior for p in shape.parameters(extended.scales)]
        plain = [float(p.transform.unconstrain(p.quantile(np.array(0.5)))) for p in priors]
        shaped = fit_hypothesis(extended, np.concatenate([self.fitted.z, plain]), self.fitted.noise)
        return shaped.ln_evidence - self.fitted.ln_evidence


def claims_a_stage(effect: Effect) -> bool:
    """Whether an effect claims a stage of its own, so that it has to beat the shapes of one."""
    return bool(getattr(effect, "further_stage", False))
