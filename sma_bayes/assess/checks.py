"""Posterior predictive checks: whether the model with its noise makes data like those that were measured.

Each statistic is formed of the innovations, that is of residuals whose memory, growth and shape are taken out as the
noise model says, so that they are independent and normal where it is right. The p-values are conservative: parameters
were fitted to what was measured, not to what is replicated.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from scipy.special import ndtr

from sma_bayes.arrays import Floats, Ints
from sma_bayes.fitting.fit import Fit
from sma_bayes.noise import Steps
from sma_bayes.noise.base import lag1

CHECK_DRAWS: Final = 500
"""Draws that a check looks at."""
SAMPLES_OF_A_BLOCK, FEWEST_BLOCKS, MOST_BLOCKS = 8, 4, 12
FALSE_ALARM_RATE: Final = 0.002
"""Probability, in each tail that tells, below which a check counts as failed; a channel has some six."""


@dataclass(frozen=True, slots=True, eq=False)
class CheckedSeries:
    """What the statistics look at beside the innovations.

    Attributes
    ----------
    steps : Steps
    blocks : list of ndarray
        Samples in blocks of temperature.
    sweeps : list of ndarray
        Samples of each uninterrupted sweep.
    response : ndarray, shape (n,)
        Curve of the posterior median.
    """

    steps: Steps
    blocks: list[Ints]
    sweeps: list[Ints]
    response: Floats

    @staticmethod
    def of(fit: Fit, record: int, channel: str, theta: Floats) -> CheckedSeries:
        """Of a channel of a record; the curve is taken over some of the draws (N, D)."""
        r = fit.records[record]
        order = np.argsort(r.temperature, kind="stable")
        count = max(FEWEST_BLOCKS, min(MOST_BLOCKS, r.n // SAMPLES_OF_A_BLOCK))
        number = r.inputs["segment"] if "segment" in r.inputs else np.zeros(r.n)
        curve = fit.posterior.predict(theta, r.inputs, record=record)[channel]
        return CheckedSeries(
            fit.posterior.steps[record],
            np.array_split(order, count),
            [np.flatnonzero(number == s) for s in np.unique(number)],
            np.median(curve, axis=0),
        )


@dataclass(frozen=True, slots=True)
class Statistic:
    """A number that tells of a series of innovations.

    Attributes
    ----------
    meaning : str
        What it is, and what it would show.
    value : callable
        Of innovations (N, n) and what stands beside them, shape (N,).
    two_sided : bool
        Whether one that is too small tells something, too.
    """

    meaning: str
    value: Callable[[Floats, CheckedSeries], Floats]
    two_sided: bool = False


def _means(e: Floats, groups: list[Ints]) -> Floats:
    """Sum of the squared mean innovations of groups, each in units of its variance."""
    return np.asarray(np.sum([g.size * np.mean(e[:, g], axis=1) ** 2 for g in groups], axis=0))


def _uneven(e: Floats, series: CheckedSeries) -> Floats:
    """Greatest ratio, as a logarithm, of the mean square in a block to that of all; nought where nothing is left."""
    square = np.square(e)
    whole = square.mean(axis=1)
    blocks = np.stack([square[:, b].mean(axis=1) for b in series.blocks])
    share = np.divide(blocks, whole, out=np.ones_like(blocks), where=whole > 0.0)
    return np.asarray(np.abs(np.log(np.maximum(share, np.finfo(float).tiny))).max(axis=0))


def _growing(e: Floats, series: CheckedSeries) -> Floats:
    """Correlation of the magnitude with the response; nought where the response is level."""
    size = np.abs(e) - np.abs(e).mean(axis=1, keepdims=True)
    response = series.response - series.response.mean()
    norm = np.sqrt((size**2).sum(axis=1) * float(response @ response))
    return np.asarray(np.divide(size @ response, norm, out=np.zeros(len(e)), where=norm > 0.0))


def _uneven_pit(e: Floats, series: CheckedSeries) -> Floats:
    """Greatest distance of the probability integral transforms from a uniform distribution."""
    u = np.sort(ndtr(e), axis=1)
    n = e.shape[1]
    step = np.arange(n) / n
    return np.asarray(np.maximum(u - step, step + 1.0 / n - u).max(axis=1))


STATISTICS: Final[Mapping[str, Statistic]] = MappingProxyType({
    "greatest": Statistic(
        "largest innovation [sd]: outliers, if the measured one is larger",
        lambda e, _: np.asarray(np.abs(e).max(axis=1)), two_sided=True,
    ),
    "lag1": Statistic(
        "correlation of neighbouring innovations: memory that the noise model misses",
        lambda e, s: lag1(e, s.steps.first), two_sided=True,
    ),
    "block_means": Statistic(
        "sum of squared mean innovations over blocks of temperature: misfit of the curve",
        lambda e, s: _means(e, s.blocks),
    ),
    "sweep_means": Statistic(
        "sum of squared mean innovations over the sweeps: sweeps that differ by more than the noise",
        lambda e, s: _means(e, s.sweeps),
    ),
    "sd_by_temperature": Statistic(
        "greatest ratio of the variance in a block of temperature to that of all: noise that changes along the sweep",
        _uneven,
    ),
    "sd_by_response": Statistic(
        "correlation of the size of innovations with the response: noise that grows with it, or falls",
        _growing, two_sided=True,
    ),
    "pit": Statistic(
        "greatest distance of the distribution of the innovations from that of the noise model: noise of another shape",
        _uneven_pit,
    ),
})  # fmt: skip
"""Statistics by name. Sweeps are compared where there are several."""


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
    sweep : int
        That it is about, from 1; 0 where it is about all.
    """

    channel: str
    statistic: str
    measured: float
    q05: float
    q95: float
    p_value: float
    meaning: str
    sweep: int = 0

    @property
    def failed(self) -> bool:
        """Whether the model does not make such data: its p-value is below `FALSE_ALARM_RATE` in a tail that tells."""
        return in_tail(self.statistic, self.p_value, FALSE_ALARM_RATE)


def in_tail(statistic: str, p_value: float, tail: float) -> bool:
    """Whether a p-value is so far out at an end that tells something; of most statistics only the lower one does."""
    return p_value < tail or (tails_of(statistic) == 2 and p_value > 1.0 - tail)


def tails_of(statistic: str) -> int:
    """At how many ends a p-value of a statistic tells something."""
    return 2 if statistic in STATISTICS and STATISTICS[statistic].two_sided else 1


def predictive_checks(fit: Fit, record: int = 0) -> list[Check]:
    """Compare innovations with those of replicated data.

    The statistics are those of `STATISTICS`.
    """
    r = fit.records[record]
    every = max(1, len(fit.flat) // CHECK_DRAWS)
    theta = fit.flat[::every]
    rng = np.random.default_rng(np.random.SeedSequence([fit.seed, 2, *r.key.encode()]))
    weights = tuple({c: w[::every] for c, w in own.items()} for own in fit.discrepancy)
    posterior = fit.posterior
    measured = posterior.residuals(theta, weights)[record]
    response = posterior.predict(theta, r.inputs, record=record, weights=weights)
    noise, steps = posterior.noise, posterior.steps[record]
    out = []
    for channel in r.channels:
        shape = posterior.noise_shape(theta, record, channel)
        scale = posterior.noise_scale(theta, record, channel, response[channel])
        again = posterior.readings(rng, theta, record, channel, response[channel], scale, steps)
        replicated = noise.innovations((again - response[channel]) / scale, shape, steps)
        series = CheckedSeries.of(fit, record, channel, theta)
        for name, statistic in STATISTICS.items():
            if name == "sweep_means" and len(series.sweeps) < 2:
                continue
            seen, new = statistic.value(measured[channel], series), statistic.value(replicated, series)
            p = float(np.mean(new > seen) + 0.5 * np.mean(new == seen))
            low, high = np.quantile(new, (0.05, 0.95))
            out.append(
                Check(channel, name, float(np.median(seen)), float(low), float(high), p, statistic.meaning)
            )
    return out
