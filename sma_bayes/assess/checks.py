"""Posterior predictive checks: whether the model with its noise makes data like those that were measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sma_bayes.noise import Steps
from sma_bayes.noise.base import lag1
from sma_bayes.quantities import Floats
from sma_bayes.records.types import Ints, Record
from sma_bayes.results.fit import Fit

CHECKED = 200
"""Draws that a check looks at."""

MEANING = {
    "greatest": "largest innovation [sd]: outliers, if the measured one is larger",
    "lag1": "correlation of neighbouring innovations: memory that the noise model misses",
    "block_means": "sum of squared mean innovations over blocks of temperature: misfit of the curve",
}
"""Statistics of the innovations, and what each would show."""


@dataclass(frozen=True, slots=True)
class Check:
    """One statistic of the residuals, measured and replicated.

    Attributes
    ----------
    channel, statistic : str
    measured : float
        Median over the posterior.
    q05, q95 : float
        Of the statistic of replicated data.
    p_value : float
        Share of draws whose replication exceeds the measurement (half of ties); near 0 or 1 the model misses it.
    meaning : str
    """

    channel: str
    statistic: str
    measured: float
    q05: float
    q95: float
    p_value: float
    meaning: str


def predictive_checks(fit: Fit, record: int = 0) -> list[Check]:
    """Compare residuals, memory taken out, with those of replicated data.

    The statistics are those of `MEANING`.
    """
    r = fit.records[record]
    every = max(1, len(fit.flat) // CHECKED)
    theta = fit.flat[::every]
    rng = np.random.default_rng(np.random.SeedSequence([fit.seed, 2, *r.key.encode()]))
    weights = tuple({c: w[::every] for c, w in own.items()} for own in fit.discrepancy)
    measured = fit.posterior.residuals(theta, weights)[record]
    out = []
    order = np.argsort(r.temperature, kind="stable")
    blocks = np.array_split(order, max(4, min(12, r.n // 8)))
    for channel in r.channels:
        place = fit.posterior.layout[record].noise[channel]
        e_new = fit.posterior.noise.innovations(
            fit.posterior.noise.draw(rng, theta[:, place[1:]], fit.posterior.steps[record]),
            theta[:, place[1:]],
            fit.posterior.steps[record],
        )
        for name, meaning in MEANING.items():
            seen = _statistic(name, measured[channel], r, blocks)
            new = _statistic(name, e_new, r, blocks)
            p = float(np.mean(new > seen) + 0.5 * np.mean(new == seen))
            low, high = np.quantile(new, (0.05, 0.95))
            out.append(Check(channel, name, float(np.median(seen)), float(low), float(high), p, meaning))
    return out


def _statistic(name: str, e: Floats, record: Record, blocks: list[Ints]) -> Floats:
    """A statistic of each of several series of innovations (N, n)."""
    if name == "greatest":
        return np.asarray(np.max(np.abs(e), axis=1))
    if name == "lag1":
        return lag1(e, Steps.of(record))
    return np.asarray(np.sum([len(b) * np.mean(e[:, b], axis=1) ** 2 for b in blocks], axis=0))
