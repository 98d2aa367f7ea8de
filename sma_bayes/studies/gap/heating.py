"""The study of a heat balance: temperature given the current.

Where current and time were recorded, temperature is an outcome as well. It is studied apart from force, displacement
and stiffness, which are computed from the temperature that was measured: what is wrong with the one hides nothing of
the other. What the heat balance has to know of the transformation is the share along the measured history, and that is
an input: it comes from the model of the response as it was found.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects import EFFECTS, Effect
from sma_bayes.effects.needs import of_heating
from sma_bayes.effects.transformation import curves
from sma_bayes.fitting.curves import interval
from sma_bayes.parameters.priors_file import PriorSet
from sma_bayes.records.history import histories
from sma_bayes.records.types import Campaign
from sma_bayes.studies.gap.fitting import FittedHypothesis, fit_with_noise
from sma_bayes.studies.gap.hypothesis import baseline
from sma_bayes.studies.gap.schema import HeatParameter
from sma_bayes.studies.gap.study import GapStudy, Progress, baseline_start, study_from

DRAWS = 4000
"""Draws from the normal approximation that give the intervals of a heat balance without effects."""


def study_heating(
    campaign: Campaign,
    response: GapStudy,
    priors: PriorSet,
    *,
    pooled: bool = False,
    effects: Mapping[str, Effect] = EFFECTS,
    seed: int = 0,
    progress: Progress | None = None,
) -> GapStudy | None:
    """Find where temperatures disagree with the heat balance and what is missing there.

    Parameters
    ----------
    campaign : Campaign
    response : GapStudy
        Of the mechanical channels of the same campaign.
    priors, pooled, effects, seed, progress
        See `study_campaign`.

    Returns
    -------
    GapStudy or None
        None where temperature is no outcome, as current or time were not recorded in all conditions.
    """
    along = partial(share_along, response.final)
    return study_balance(
        campaign, along, priors, pooled=pooled, effects=effects, seed=seed, progress=progress
    )


def study_balance(
    campaign: Campaign,
    share_along: Callable[[int], Mapping[str, Floats]],
    priors: PriorSet,
    *,
    pooled: bool = False,
    effects: Mapping[str, Effect] = EFFECTS,
    seed: int = 0,
    progress: Progress | None = None,
) -> GapStudy | None:
    """The same from the share of austenite along each history, whatever model it comes from.

    Parameters
    ----------
    campaign : Campaign
    share_along : callable
        Of the number of a history, from 0: ``share`` (n,) along it; empty where no curve tells of it.
    priors, pooled, effects, seed, progress
        See `study_campaign`.

    Returns
    -------
    GapStudy or None
        See `study_heating`.
    """
    whole = histories(campaign)
    if not all("temperature" in h.observed for h in whole):
        return None
    own = [h.of({"temperature"}, **share_along(i)) for i, h in enumerate(whole)]
    rng = np.random.default_rng(np.random.SeedSequence([seed, 19]))
    hypothesis = baseline(campaign, own, priors, pooled=pooled)
    first = fit_with_noise(hypothesis, baseline_start(hypothesis, campaign, priors, pooled=pooled, rng=rng))
    return study_from(first, of_heating(effects), rng, progress or (lambda _: None))


def share_along(response: FittedHypothesis, history: int) -> dict[str, Floats]:
    """Share of austenite along a measured history, as ``share`` (n,); empty where no curve tells of it.

    By the displacement where there is one, else by the force.
    """
    hypothesis = response.hypothesis
    inputs = hypothesis.histories[history].inputs
    _, found = curves(lambda given: hypothesis.predict(response.theta, history, given), inputs)
    return {"share": list(found.values())[-1].share} if found else {}


def heat_parameters(study: GapStudy, draws: Floats, seed: int) -> dict[str, HeatParameter]:
    """Gain, loss, time constant, switching and, where it was fitted, the ambient temperature, with 90 % intervals.

    Parameters
    ----------
    study : GapStudy
        Of a heat balance.
    draws : ndarray, shape (S, P)
        Of the final model; where there are none, they come from the normal approximation at its mode.
    seed : int
    """
    final = study.final
    space = final.hypothesis.space
    if not len(draws):
        rng = np.random.default_rng(np.random.SeedSequence([seed, 23]))
        draws = space.constrain(rng.multivariate_normal(final.z, final.covariance, DRAWS))
    known = all("ambient_temperature" in h.inputs for h in final.hypothesis.histories)
    one = len({p.name for p in space.parameters if p.name.startswith("gain")}) == 1
    out: dict[str, HeatParameter] = {}
    for i, p in enumerate(space.parameters):
        kind, _, condition = p.name.partition("[")
        if "." in kind or (kind == "ambient" and known):
            continue
        of = "" if one or not condition else f"[{condition}"
        out[f"{kind}{of}"] = heat_parameter(p.unit, p.meaning, draws[:, i])
        if kind == "loss":
            out[f"time_constant{of}"] = heat_parameter(
                "s", "time in which the excess over the ambient falls by e", 1.0 / draws[:, i]
            )
    noise = next((n.switching for n in final.noise if n.switching is not None), None)
    size = 0.0 if noise is None else noise.size
    return {**out, "switching": out["switching"].model_copy(update={"scatter": size})}


def heat_parameter(unit: str, meaning: str, draws: Floats) -> HeatParameter:
    """A parameter as documents state it, from its draws (S,)."""
    return HeatParameter(unit=unit, meaning=meaning, **interval(draws))
