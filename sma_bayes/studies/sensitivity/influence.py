"""What single sweeps and readings do to the numbers of a record.

A reading that is left out moves the mean of a quantity, to first order, by less its posterior covariance with the log
density of the reading. A sweep is left out by weights of one over its likelihood, smoothed by Pareto's distribution;
where these can't be relied on, the others are fitted again.

References
----------
A. Vehtari, A. Gelman, J. Gabry, Statistics and Computing 27 (2017) 1413 (weights); R. Giordano, T. Broderick, M. I.
Jordan, "Covariances, robustness, and variational Bayes", Journal of Machine Learning Research 19 (2018) 51
(covariances).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats, Ints
from sma_bayes.assess.draws import RecordDraws
from sma_bayes.assess.held_out import evaluated_on, missed_by
from sma_bayes.assess.sweeps import fitted_without, samples_of_sweeps, weights_without
from sma_bayes.sampling.pareto import MAX_RELIABLE_K, smoothed_weights
from sma_bayes.sampling.weighted import resampled
from sma_bayes.studies.sensitivity.quantities import (
    Densities,
    QuantityDraws,
    of_other_draws,
    quantities_of,
)

FEWEST_SWEEPS: Final = 2
MAX_REFITS: Final = 10
"""Fits made anew for one record, at most: of the sweeps without which the draws can be relied on least."""


@dataclass(frozen=True, slots=True, eq=False)
class LeftOut:
    """Means of all quantities without a part of the readings.

    Attributes
    ----------
    mean : ndarray, shape (q,)
        [unit of each]; NaN where they can't be told.
    pareto_k : float
        Of the weights.
    refitted : bool
        Whether the rest was fitted again.
    """

    mean: Floats
    pareto_k: float
    refitted: bool


def reading_influence(values: Floats, readings: Mapping[str, Floats]) -> dict[str, Floats]:
    """Change of the means of quantities where a reading is left out, to first order.

    Parameters
    ----------
    values : ndarray, shape (S, q)
        Finite draws.
    readings : mapping of str to ndarray, shape (S, n)
        Log density of each reading, by channel.

    Returns
    -------
    dict of str to ndarray, shape (q, n)
        By channel, in the units of the quantities.
    """
    apart = values - values.mean(axis=0)
    return {c: -(apart.T @ density) / len(values) for c, density in readings.items()}


def without_readings(values: Floats, log_density: Floats) -> tuple[Floats, Floats]:
    """Means of quantities where parts of the readings are left out, by weights alone.

    Parameters
    ----------
    values : ndarray, shape (S, q)
    log_density : ndarray, shape (S, parts)
        Of each part.

    Returns
    -------
    mean : ndarray, shape (parts, q)
    pareto_k : ndarray, shape (parts,)
    """
    log_weight, k = smoothed_weights(-log_density)
    return np.exp(log_weight).T @ values, k


def means_without_sweeps(
    draws: RecordDraws,
    quantities: Sequence[QuantityDraws],
    values: Floats,
    densities: Densities,
    at: Sequence[float],
    seed: int,
) -> list[LeftOut]:
    """Leave out each sweep of a record; empty where it has fewer than `FEWEST_SWEEPS`.

    Parameters
    ----------
    draws : RecordDraws
    quantities : sequence of QuantityDraws
        Of these draws.
    values : ndarray, shape (S, q)
        Their finite draws.
    densities : Densities
        At these draws.
    at : sequence of float
        See `quantities_of`.
    seed : int
        For the fits that have to be made anew.
    """
    sweeps = samples_of_sweeps(draws.record)
    if len(sweeps) < FEWEST_SWEEPS:
        return []
    log_weight, k, again = weights_without(densities.readings, sweeps, MAX_REFITS)
    means = np.exp(log_weight).T @ values
    out = []
    for i, sweep in enumerate(sweeps):
        if k[i] <= MAX_RELIABLE_K:
            out.append(LeftOut(means[i], float(k[i]), False))
            continue
        anew = mean_without(draws, quantities, sweep, at, seed) if i in again else None
        lost = np.full(len(quantities), np.nan)
        out.append(LeftOut(lost if anew is None else anew, float(k[i]), anew is not None))
    return out


def mean_without(
    draws: RecordDraws, quantities: Sequence[QuantityDraws], left_out: Ints, at: Sequence[float], seed: int
) -> Floats | None:
    """Means (q,) of quantities under a fit without some readings; None where it missed its target."""
    record, posterior = draws.record, draws.posterior
    own = np.random.SeedSequence([seed, 8, int(left_out[0]), *record.key.encode()])
    seed_of_draws, seed_of_rest, seed_of_choice = own.spawn(3)
    start = np.median(posterior.space.unconstrain(draws.before_calibration), axis=0)
    without = fitted_without(posterior, left_out, start, seed_of_draws)
    if without is None:
        return None
    rest, found = without
    chosen = resampled(found.log_weight, draws.size, np.random.default_rng(seed_of_choice))
    theta = rest.space.constrain(found.z[chosen])
    missed = missed_by(rest, theta, seed_of_rest)
    fitted = of_other_draws(draws, theta, missed[0] if missed else {}, posterior=evaluated_on(rest, record))
    stiffness = any(q.channel == "stiffness" and q.kind == "curve" for q in quantities)
    return np.array([q.tamed.mean() for q in quantities_of(fitted, at, stiffness=stiffness)])
