"""Leaving a condition out, predicting its curve from the others, and holding the band against what was measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.assess.draws import RecordDraws, as_logged
from sma_bayes.fitting.curves import quantiles
from sma_bayes.studies.conditions.design import Design, designs
from sma_bayes.studies.conditions.population import (
    PRIOR_MEDIAN_SCATTER,
    Population,
    population_of,
    shared_calibration,
)
from sma_bayes.studies.conditions.prediction import (
    Neighbours,
    Prediction,
    curve_by_hand,
    neighbours,
    parameters_by_hand,
    predict,
)
from sma_bayes.studies.conditions.schema import StatedScore

HIERARCHICAL, CURVES, PARAMETERS = "hierarchical", "curves by hand", "parameters by hand"
"""Ways to predict: the hierarchical model; a straight line between the neighbours' curves; between their A and B."""
BAND = (0.05, 0.5, 0.95)
"""Quantiles of the band that is scored."""


@dataclass(frozen=True, slots=True, eq=False)
class LeftOutChannel:
    """A channel of a condition that was left out.

    Attributes
    ----------
    record : RecordDraws
        What was left out.
    channel : str
    population : Population
        Learnt from the others.
    beyond : tuple of str
        Why it is an extrapolation; empty where it is none.
    temperature : ndarray, shape (m,)
    own : ndarray, shape (m,)
        Median of the curve fitted to the condition itself.
    bands : mapping of str to ndarray, shape (3, m)
        Quantiles `BAND` of the curve, by the way to predict it.
    new : ndarray, shape (3, m)
        Quantiles of a new measurement by the hierarchical model; NaN where the channel was not measured.
    scores : mapping of str to StatedScore
    """

    record: RecordDraws
    channel: str
    population: Population
    beyond: tuple[str, ...]
    temperature: Floats
    own: Floats
    bands: Mapping[str, Floats]
    new: Floats
    scores: Mapping[str, StatedScore]


def leave_out(
    design: Design,
    records: Sequence[RecordDraws],
    place: int,
    seed: np.random.SeedSequence,
    *,
    scatter: float = PRIOR_MEDIAN_SCATTER,
) -> tuple[LeftOutChannel, ...]:
    """Predict one condition from the others of its design.

    Parameters
    ----------
    design : Design
    records : sequence of RecordDraws
        Of one branch, one for each condition of the design.
    place : int
        Which is left out.
    seed : numpy.random.SeedSequence
    scatter : float
        See `population_of`.

    Returns
    -------
    tuple of LeftOutChannel
        One for each channel; empty where the others don't vary in what it would have to be predicted from.
    """
    if shared_calibration(records):  # what all are off by is no part of how they differ
        records = [as_logged(r) for r in records]
    target = records[place]
    others = tuple(r for i, r in enumerate(records) if i != place)
    (rest,) = designs([r.condition for r in others])
    if not set(design.varied) <= set(rest.varied):
        return ()
    population_seed, draw_seed = seed.spawn(2)
    population = population_of(rest, others, population_seed, scatter=scatter)
    rng = np.random.default_rng(draw_seed)
    prediction = predict(population, target.condition, rng)
    between = neighbours(rest, target.condition)
    return tuple(_held_out(target, prediction, between, channel, rng) for channel in target.quantities)


def _held_out(
    target: RecordDraws,
    prediction: Prediction,
    between: Neighbours | None,
    channel: str,
    rng: np.random.Generator,
) -> LeftOutChannel:
    t, records = target.grid(), prediction.population.records
    own = np.median(target.curve(channel, t), axis=0)
    band = prediction.band(channel, t, rng)
    bands = {HIERARCHICAL: np.stack([band.curve[q] for q in ("q05", "q50", "q95")])}
    if between is not None:
        for name, by_hand in ((CURVES, curve_by_hand), (PARAMETERS, parameters_by_hand)):
            bands[name] = quantiles(by_hand(records, between, channel, t), BAND, axis=0)
    new = np.stack([band.predictive[q] for q in ("pred_q05", "pred_q50", "pred_q95")])
    whole = (band.simultaneous["sim90_low"] <= own) & (own <= band.simultaneous["sim90_high"])
    scale = _log if channel == "stiffness" else np.asarray
    scores = {
        name: StatedScore(
            covers_curve=float(np.mean((quantiles[0] <= own) & (own <= quantiles[2]))),
            covers_samples=_covered(target, channel, t, new) if name == HIERARCHICAL else None,
            holds_whole=bool(whole.all()) if name == HIERARCHICAL else None,
            width=float(np.mean(scale(quantiles[2]) - scale(quantiles[0]))),
            error=float(np.sqrt(np.mean((scale(quantiles[1]) - scale(own)) ** 2))),
        )
        for name, quantiles in bands.items()
    }
    return LeftOutChannel(
        record=target,
        channel=channel,
        population=prediction.population,
        beyond=prediction.population.design.beyond(target.condition),
        temperature=t,
        own=own,
        bands=bands,
        new=new,
        scores=scores,
    )


def _log(stiffness: Floats) -> Floats:
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(np.abs(stiffness)))


def _covered(target: RecordDraws, channel: str, t: Floats, new: Floats) -> float | None:
    if channel not in target.channels:
        return None
    at, y = target.record.temperature, target.record.observed[channel]
    low, high = np.interp(at, t, new[0]), np.interp(at, t, new[2])
    return float(np.mean((low <= y) & (y <= high)))
