"""Flexible terms without meaning: smooth functions of every covariate there is.

They have two uses. Tested on residuals, they tell where a model and measurements disagree. And they guard against
false names: an effect that explains no more than a function that can bend at will explains nothing.

A term is a set of columns, added to one channel, with independent normal coefficients of a common size ``s``:

    ln BF = mean over s of  1/2 b' (A + 1/s**2)^-1 b - 1/2 ln |1 + s**2 A|,    A = G' P G,    b = G' P w

where ``w`` are the whitened residuals, ``G`` the whitened columns, and ``P`` takes out what the model's parameters
absorb. That is the evidence for the term, exact for a model that is linear over the width of its posterior.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from sma_bayes.gap.fitting import Fitted
from sma_bayes.gap.noise import Block
from sma_bayes.gap.splines import bumps, grouped, one_of_each, times
from sma_bayes.quantities import Floats
from sma_bayes.records.history import sweep_rate

SIZES = np.geomspace(0.03, 100.0, 10)
"""Sizes of the coefficients that are averaged over, in standard deviations of the noise of the channel."""


@dataclass(frozen=True, slots=True, eq=False)
class Term:
    """A flexible term.

    Attributes
    ----------
    covariate : str
        What it is a function of: ``temperature``, ``cycle``, ``temperature and cycle``.
    channel : str
        To which it is added.
    columns : ndarray, shape (N, k)
        In standard deviations of the noise, before whitening.
    """

    covariate: str
    channel: str
    columns: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Gain:
    """What a term would bring.

    Attributes
    ----------
    term : Term
    ln_bayes_factor : float
        For the term, over the model as it is.
    directions : ndarray, shape (N, k)
        Whitened columns ``P G``, rotated so that ``A`` is diagonal.
    information : ndarray, shape (k,)
        The diagonal of ``A``.
    """

    term: Term
    ln_bayes_factor: float
    directions: Floats
    information: Floats

    def of(self, residuals: Floats) -> Floats:
        """Log Bayes factor for other whitened residuals (N, S), shape (S,)."""
        return log_bayes_factor(self.directions.T @ residuals, self.information)


def log_bayes_factor(b: Floats, information: Floats) -> Floats:
    """Evidence for a term in coordinates where ``A`` is diagonal.

    Parameters
    ----------
    b : ndarray, shape (k, S)
    information : ndarray, shape (k,)

    Returns
    -------
    ndarray, shape (S,)
    """
    precision = SIZES[:, None] ** -2.0  # of the coefficients
    fit = 0.5 * (1.0 / (information + precision)) @ (b * b)
    price = 0.5 * np.log1p(SIZES[:, None] ** 2 * information).sum(axis=1)
    return np.asarray(logsumexp(fit - price[:, None], axis=0) - np.log(SIZES.size))


def gains(fitted: Fitted, terms: Sequence[Term]) -> list[Gain]:
    """What each term would bring to a fitted model."""
    out = []
    absorbed = np.linalg.solve(fitted.precision, fitted.jacobian.T @ fitted.whitened)
    left = fitted.whitened - fitted.jacobian @ absorbed
    for term in terms:
        whitened = fitted.whiten(term.columns.T).T
        projected = fitted.unabsorbed(whitened)
        information, axes = np.linalg.eigh(whitened.T @ projected)
        kept = information > 1e-9 * max(float(information[-1]), 1e-300)
        information, axes = information[kept], axes[:, kept]
        if not information.size:
            continue
        b = (whitened @ axes).T @ left
        value = float(log_bayes_factor(b[:, None], information)[0])
        out.append(Gain(term, value, projected @ axes, information))
    return out


def terms_of(fitted: Fitted) -> list[Term]:
    """Terms in every covariate that the histories have, for every channel."""
    out: list[Term] = []
    for channel in fitted.hypothesis.channels:
        blocks = [b for b in fitted.blocks if b.channel == channel]
        out += _channel_terms(fitted, channel, blocks)
    return out


def _channel_terms(fitted: Fitted, channel: str, blocks: Sequence[Block]) -> list[Term]:
    hypothesis = fitted.hypothesis
    histories = [hypothesis.histories[b.history] for b in blocks]
    size = np.concatenate(
        [
            np.full(h.n, fitted.noise[fitted.blocks.index(b)].sd)
            for h, b in zip(histories, blocks, strict=True)
        ]
    )
    names = set.intersection(*(set(h.inputs) for h in histories))
    joined = {k: np.concatenate([h.inputs[k] for h in histories]) for k in names}
    joined["condition"] = np.concatenate([np.full(h.n, float(i)) for i, h in enumerate(histories)])
    for (
        other
    ) in hypothesis.channels:  # what the model says, as the measurement would bring its own noise along
        mu = [hypothesis.predict(fitted.theta, b.history)[other] for b in blocks]
        joined[other if other != "temperature" else "simulated temperature"] = np.concatenate(mu)
    if channel == "temperature":  # its own noise must not be among what it is tested against
        joined["temperature"] = joined["simulated temperature"]
        each = np.split(joined["temperature"], np.cumsum([h.n for h in histories])[:-1])
        inputs = [h.inputs for h in histories]
        rates = [sweep_rate(t, v["time"], v["segment"]) for t, v in zip(each, inputs, strict=True)]
        joined["rate"] = np.concatenate(rates)
    rows = np.concatenate([np.arange(b.at.start, b.at.stop) for b in blocks])

    def term(covariate: str, columns: Floats) -> Term:
        whole = np.zeros((fitted.whitened.size, columns.shape[1]))
        whole[rows] = columns * size[:, None]
        return Term(covariate, channel, whole)

    return [term(name, columns) for name, columns in _columns(joined)]


def _columns(v: dict[str, Floats]) -> list[tuple[str, Floats]]:
    """Names and columns of the terms that the covariates allow."""
    branch = one_of_each(v["branch"])
    temperature = bumps(v["temperature"], 8)
    on_branch = times(branch, temperature)
    out = [("temperature", on_branch), ("temperature", times(branch, bumps(v["temperature"], 20)))]
    condition = one_of_each(v["condition"])
    if condition.shape[1] > 1:
        out.append(("condition", times(condition, branch)))
        out.append(("temperature and condition", times(condition, on_branch)))
    cycle = one_of_each(grouped(v["cycle"]))
    if cycle.shape[1] > 1:
        coarse = times(branch, bumps(v["temperature"], 5))
        out.append(("cycle", times(condition, cycle)))
        out.append(("temperature and cycle", times(cycle, coarse)))
    clock = "time" if "time" in v else "order"
    out.append((clock, times(condition, bumps(v[clock], 10))))
    if "rate" in v and np.ptp(v["rate"]) > 0.0:
        out.append(("rate", times(branch, bumps(v["rate"], 8))))
        out.append(
            ("temperature and rate", times(branch, times(bumps(v["temperature"], 5), bumps(v["rate"], 4))))
        )
    for name in ("force", "displacement", "stiffness", "simulated temperature"):
        if name in v and np.ptp(v[name]) > 0.0:
            out.append((name.removeprefix("simulated "), bumps(v[name], 20)))
    for name in ("current", "ambient_temperature", "load"):
        if name in v and np.ptp(v[name]) > 1e-9 * np.max(np.abs(v[name])):
            out.append((name, bumps(v[name], min(5, np.unique(v[name]).size))))
    if {"time", "frequency"} <= set(v):
        phase = 2.0 * np.pi * v["frequency"] * v["time"]
        out.append(
            ("drive phase", np.stack([f(k * phase) for k in range(1, 5) for f in (np.sin, np.cos)], axis=1))
        )
    return out
