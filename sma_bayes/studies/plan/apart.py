"""Which experiment tells rival explanations of a gap apart, and how surely.

Two explanations A and B were fitted to the same measurements, which give A a ln Bayes factor b over B. New ones y,
whitened by the noise, are expected about ``m_A`` and ``m_B`` with covariances ``S = 1 + J C J'``: each explanation may
still adapt, by its own posterior of covariance C. If A is true with parameters ``t``, the ln Bayes factor that y brings
for A over B,

    ln BF = (r_B' S_B^-1 r_B - r_A' S_A^-1 r_A + ln|S_B| - ln|S_A|)/2,    r = y - m,

is a quadratic form in the noise, nearly normal, and its mean and variance are known in closed form. Where both may
adapt alike, mean and standard deviation are ``d**2/2`` and ``d`` with the separation d of the two, so that that of all
measurements reaches c with the probability ``Phi((d**2/2 + b - c)/d)`` if A is true. Probabilities are averaged over
draws of the parameters of the explanation that is true, and over both with the odds ``exp(b)`` that they have now.

References
----------
W. J. Hill, W. G. Hunter, D. W. Wichern, "A joint design criterion for the dual problem of model discrimination and
parameter estimation", Technometrics 10 (1968) 145, doi 10.1080/00401706.1968.10490542; G. E. P. Box, W. J. Hill,
"Discrimination among mechanistic models", Technometrics 9 (1967) 57, doi 10.1080/00401706.1967.10490441.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import expit, ndtr
from scipy.stats.qmc import MultivariateNormalQMC

from sma_bayes.arrays import Floats
from sma_bayes.records.history import History
from sma_bayes.sampling.pareto import smoothed_weights
from sma_bayes.sampling.weighted import resampled
from sma_bayes.studies.gap.fitting import DIFFERENCE_STEP, FittedHypothesis, log_posterior
from sma_bayes.studies.gap.hypothesis import Hypothesis
from sma_bayes.studies.gap.noise import BlockNoise, ChannelBlock, blocks_of, whiten
from sma_bayes.studies.plan.candidates import CandidateExperiment
from sma_bayes.studies.plan.information import mean_step

DRAWS: Final = 256
"""Draws of the parameters of an explanation; a power of 2, which low-discrepancy points fill space evenly with."""
PAUSE_STEPS: Final = 10.0
"""Time between the last measurement and a new one [steps of the new one]."""


@dataclass(frozen=True, eq=False)
class Explanation:
    """An explanation of a gap, fitted.

    Attributes
    ----------
    name : str
        Id of its effect; empty for none.
    fitted : FittedHypothesis
    draws : ndarray, shape (S, D)
        Of the posterior of the sampled coordinates, as far as the normal approximation at the mode reaches it.
    """

    name: str
    fitted: FittedHypothesis
    draws: Floats

    @staticmethod
    def of(name: str, fitted: FittedHypothesis, rng: np.random.Generator, size: int = DRAWS) -> Explanation:
        """With draws about its mode.

        Scrambled Sobol' points of the normal approximation, resampled by their smoothed weights: a time constant that
        is hardly known has normal draws which no measurement allows, and what these would come to is beyond all bounds.
        """
        points = MultivariateNormalQMC(fitted.z, fitted.covariance, seed=rng).random(max(size, DRAWS))
        away = (points - fitted.z) @ np.linalg.cholesky(fitted.precision)
        with np.errstate(all="ignore"):
            log_ratio = log_posterior(fitted, points) + 0.5 * np.sum(away**2, axis=1)
        log_weight, _ = smoothed_weights(log_ratio[:, None])
        return Explanation(name, fitted, points[resampled(log_weight[:, 0], size, rng)])


def further(candidate: CandidateExperiment, like: History) -> History:
    """What would be applied in a candidate, after the history of its condition; nothing is observed yet.

    Inputs that a candidate does not speak of are as they were on the branch, in the median.
    """
    n, cycles = candidate.samples, candidate.cycles
    up = np.linspace(candidate.lowest, candidate.peak, n)
    temperature: Floats = np.tile(np.concatenate([up, up[::-1]]), cycles)
    branch: Floats = np.tile(np.repeat([1.0, -1.0], n), cycles)
    old = like.inputs
    inputs: dict[str, Floats] = {}
    for name, values in old.items():
        out = np.empty(temperature.size)
        for sign in (1.0, -1.0):
            own = values[old["branch"] == sign]
            out[branch == sign] = np.median(own if own.size else values)
        inputs[name] = out
    count: Floats = np.repeat(np.arange(cycles, dtype=float), 2 * n)
    segment: Floats = np.repeat(np.arange(2.0 * cycles), n)
    inputs |= {
        "temperature": temperature,
        "branch": branch,
        "cycle": float(old["cycle"].max()) + 1.0 + count,
        "segment": float(old["segment"].max()) + 1.0 + segment,
        "stretch": np.full(temperature.size, float(old["stretch"].max()) + 1.0),
        "order": float(old["order"].max()) + 1.0 + np.arange(temperature.size, dtype=float),
    }
    if "cycle_of_all" in old:
        inputs["cycle_of_all"] = float(old["cycle_of_all"].max()) + 1.0 + count
    if "time" in old:
        step = (candidate.peak - candidate.lowest) / max(n - 1, 1) / candidate.rate
        inputs["time"] = float(old["time"].max()) + step * (
            PAUSE_STEPS + np.arange(temperature.size, dtype=float)
        )
        inputs["rate"] = branch * candidate.rate
    if candidate.load is not None and "load" in old:
        inputs["load"] = np.full(temperature.size, candidate.load)
    return replace(
        like,
        inputs=inputs,
        observed={c: np.zeros(temperature.size) for c in like.observed},
        row=np.arange(temperature.size),
    )


def gone_on(old: History, new: History) -> History:
    """A history and what comes after it, as one: creep, lags and a drifting zero go on from where they were."""
    return replace(
        old,
        inputs={name: np.concatenate([old.inputs[name], values]) for name, values in new.inputs.items()},
        observed={c: np.concatenate([old.observed[c], values]) for c, values in new.observed.items()},
        row=np.arange(old.n + new.n),
    )


def expected(hypothesis: Hypothesis, history: int, new: History, theta: Floats) -> dict[str, Floats]:
    """Response of each channel (..., n) to what comes after a history, for parameters (..., P)."""
    old = hypothesis.histories[history]
    mu = hypothesis.predict(theta, history, gone_on(old, new).inputs)
    return {channel: values[..., old.n :] for channel, values in mu.items()}


def noise_there(
    fitted: FittedHypothesis, history: int, new: History, blocks: Sequence[ChannelBlock]
) -> tuple[BlockNoise, ...]:
    """Noise of new measurements: that of the history, its memory as it is at other steps of temperature."""
    ratio = mean_step(new.inputs) / mean_step(fitted.hypothesis.histories[history].inputs)
    own = {b.channel: n for b, n in zip(fitted.blocks, fitted.noise, strict=True) if b.history == history}
    before = {b.channel: b for b in fitted.blocks if b.history == history}
    out = []
    for block in blocks:
        noise, old = own[block.channel], before[block.channel]
        inside = noise.memory[~old.first]
        phi = float(np.median(inside)) if inside.size else 0.0
        memory = np.where(block.first, 0.0, np.sign(phi) * np.abs(phi) ** ratio)
        out.append(BlockNoise(noise.sd, memory, float(np.median(noise.scale))))
    return tuple(out)


@dataclass(frozen=True, eq=False)
class Prospect:
    """What an explanation expects of new measurements, whitened.

    Attributes
    ----------
    mean : ndarray, shape (n,)
        At the mode.
    drawn : ndarray, shape (S, n)
        At its draws.
    reach : ndarray, shape (n, D)
        H with ``S^-1 = 1 - H H'``.
    half_log_determinant : float
        ``ln|S|/2``.
    """

    mean: Floats
    drawn: Floats
    reach: Floats
    half_log_determinant: float

    @staticmethod
    def of(explanation: Explanation, history: int, new: History) -> Prospect:
        """Of a history that goes on like one that was measured."""
        fitted = explanation.fitted
        hypothesis = fitted.hypothesis
        blocks = blocks_of(alone_with(hypothesis, history, new))
        noise = noise_there(fitted, history, new, blocks)

        def predicted(z: Floats) -> Floats:
            mu = expected(hypothesis, history, new, hypothesis.space.constrain(z))
            stacked = np.concatenate([mu[b.channel] for b in blocks], axis=-1)
            return whiten(blocks, noise, np.nan_to_num(stacked, nan=0.0, posinf=0.0, neginf=0.0))

        h = DIFFERENCE_STEP * hypothesis.space.prior_sd()
        moved = np.concatenate([fitted.z + np.diag(h), fitted.z - np.diag(h)])
        up, down = np.split(predicted(moved), 2)
        jacobian = ((up - down) / (2.0 * h[:, None])).T
        gram = jacobian.T @ jacobian
        whole = np.linalg.inv(np.linalg.cholesky(fitted.precision + gram)).T
        half = 0.5 * float(
            np.linalg.slogdet(fitted.precision + gram)[1] - np.linalg.slogdet(fitted.precision)[1]
        )
        return Prospect(predicted(fitted.z[None])[0], predicted(explanation.draws), jacobian @ whole, half)

    def left(self, series: Floats) -> Floats:
        """``S^-1`` applied to series (..., n)."""
        return np.asarray(series - (series @ self.reach) @ self.reach.T)


def alone_with(hypothesis: Hypothesis, history: int, new: History) -> Hypothesis:
    """A hypothesis about new measurements of a condition alone."""
    return replace(hypothesis, histories=(new,), layout=(hypothesis.layout[history],))


def told_apart(first: Prospect, second: Prospect, threshold: float, known: float = 0.0) -> dict[str, float]:
    """How well two explanations are told apart by measurements of which they expect this and that.

    Parameters
    ----------
    first, second : Prospect
    threshold : float
        Least ln Bayes factor of an explanation that is told apart.
    known : float
        That of the first over the second, from the measurements that there are.

    Returns
    -------
    dict
        ``separation``: root mean square over draws of both of ``d' S^-1 d``, d the distance from what the other expects
        [sd of noise]. ``if_first``, ``if_second``: probability that ln Bayes factors of old and new measurements reach
        the threshold for the explanation that is true; ``probability``: of both, as likely as they are now.
    """
    probability, squared = zip(
        *(
            chances(truth, rival, threshold - there)
            for truth, rival, there in ((first, second, known), (second, first, -known))
        ),
        strict=True,
    )
    apart = float(np.sqrt(np.mean([np.mean(s) for s in squared])))
    one, two = (float(np.mean(p)) for p in probability)
    first_is_true = float(expit(known))
    return {
        "separation": apart,
        "probability": first_is_true * one + (1.0 - first_is_true) * two,
        "if_first": one,
        "if_second": two,
    }


def chances(truth: Prospect, rival: Prospect, threshold: float) -> tuple[Floats, Floats]:
    """For each draw of the true explanation, the probability that it is found, and its squared separation (S,)."""
    own, other = truth.drawn - truth.mean, truth.drawn - rival.mean
    left, right = truth.left(own), rival.left(other)
    squared = np.einsum("sn,sn->s", other, right)
    traces = float(np.sum(truth.reach**2) - np.sum(rival.reach**2))
    mean = 0.5 * (squared - np.einsum("sn,sn->s", own, left) + traces)
    mean = mean + rival.half_log_determinant - truth.half_log_determinant
    bent = (
        np.sum((truth.reach.T @ truth.reach) ** 2)
        - 2.0 * np.sum((truth.reach.T @ rival.reach) ** 2)
        + np.sum((rival.reach.T @ rival.reach) ** 2)
    )
    variance = np.sum((right - left) ** 2, axis=1) + 0.5 * max(float(bent), 0.0)
    return np.asarray(ndtr((mean - threshold) / np.sqrt(np.maximum(variance, 1e-12)))), np.asarray(squared)
