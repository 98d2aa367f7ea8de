"""Flexible terms without meaning: smooth functions of every covariate there is.

They have two uses. Tested on residuals, they tell where a model and measurements disagree. And they guard against
false names: an effect that explains no more than a function that can bend at will explains nothing.

A term is a set of columns, added to one channel, with independent normal coefficients of a common size ``s``:

    ln BF = mean over s of  1/2 b' (A + 1/s**2)^-1 b - 1/2 ln |1 + s**2 A|,    A = G' P G,    b = G' P w

where ``w`` are the whitened residuals, ``G`` the whitened columns, and ``P`` takes out what the model's parameters
absorb. That is the evidence for the term where the model is linear over the width of its posterior and no prior pulls
at its parameters; where one does, a term gets no credit for giving way in their place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from sma_bayes.arrays import Floats
from sma_bayes.records.history import sweep_rate
from sma_bayes.studies.gap.fitting import FittedHypothesis
from sma_bayes.studies.gap.noise import ChannelBlock
from sma_bayes.studies.gap.splines import (
    bspline_basis,
    grouped,
    indicators,
    linear,
    row_tensor_product,
    steps,
)

SIZES = np.geomspace(0.03, 100.0, 10)
"""Sizes of the coefficients that are averaged over, in standard deviations of the noise of the channel."""


SHAPE = "temperature"
"""Covariate of the terms that only bend a curve."""
SIMULATED = "simulated temperature"
ALONE = ("force", "displacement", "stiffness", SIMULATED, "drive phase")
"""Covariates of terms that are not tried on several channels together."""
STEPS = 6
"""Places at which a step in time is tried, at equal distances along each condition."""
FAR = 500.0
"""Distance from the measured temperatures at which the transformation is over [K]."""


@dataclass(frozen=True, slots=True, eq=False)
class Term:
    """A flexible term.

    Attributes
    ----------
    covariate : str
        What it is a function of: ``temperature``, ``cycle``, ``temperature and cycle``.
    channel : str
        To which it is added; ``temperature shift`` or ``share transformed`` where it acts on several together.
    columns : ndarray, shape (N, k)
        In standard deviations of the noise, before whitening.
    """

    covariate: str
    channel: str
    columns: Floats


@dataclass(frozen=True, slots=True, eq=False)
class TermEvidence:
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


def gains(fitted: FittedHypothesis, terms: Sequence[Term]) -> list[TermEvidence]:
    """What each term would bring to a fitted model."""
    out = []
    left = fitted.left
    for term in terms:
        whitened = fitted.whiten(term.columns.T).T
        projected = fitted.project_out(whitened)
        information, axes = np.linalg.eigh(whitened.T @ projected)
        kept = information > 1e-9 * max(float(information[-1]), 1e-300)
        information, axes = information[kept], axes[:, kept]
        if not information.size:
            continue
        b = (whitened @ axes).T @ left
        value = float(log_bayes_factor(b[:, None], information)[0])
        out.append(TermEvidence(term, value, projected @ axes, information))
    return out


def beyond_shape(fitted: FittedHypothesis, terms: Sequence[Term]) -> FittedHypothesis:
    """The same fit with the shape of every curve free: a smooth function of temperature on each branch and channel.

    What terms and effects bring to it is not what the curve of a specimen has by being no sigmoid, the same in every
    cycle and condition.
    """
    parts = [
        term.columns[:, np.any(term.columns != 0.0, axis=0)]
        for term in terms
        if term.covariate == SHAPE and term.channel in fitted.hypothesis.channels
    ]
    columns = fitted.whiten(np.concatenate(parts, axis=1).T).T
    free = fitted.jacobian.shape[1]
    jacobian = np.concatenate([fitted.jacobian, columns], axis=1)
    precision = jacobian.T @ jacobian
    precision[:free, :free] = fitted.precision
    loose = 1e-9 * float(np.max(np.diag(precision)[free:]))
    precision[np.arange(free, len(precision)), np.arange(free, len(precision))] += loose
    return replace(fitted, jacobian=jacobian, precision=precision)


@dataclass(frozen=True, slots=True)
class FlexibleTerms:
    """What flexible terms bring to a fitted model.

    Attributes
    ----------
    best : TermEvidence or None
        The best of all.
    shape : float
        Log Bayes factor of a curve that is free to have any shape: in every channel by itself, or in all together.
    beyond : TermEvidence or None
        The best on top of that.
    """

    best: TermEvidence | None
    shape: float
    beyond: TermEvidence | None


def offer(fitted: FittedHypothesis, found: Sequence[TermEvidence] = ()) -> FlexibleTerms:
    """What flexible terms bring to a fitted model; `found`, if that is known already for it as it is."""
    terms = [g.term for g in found] or terms_of(fitted)
    found = found or gains(fitted, terms)
    channels = [c for c in fitted.hypothesis.channels if c != "temperature"]
    if not channels:  # a heat balance has no curve whose shape may be another
        return FlexibleTerms(_best(found), 0.0, _best(found))
    shapes = [g for g in found if g.term.covariate == SHAPE]
    alone = sum(worth_of(_best([g for g in shapes if g.term.channel == c])) for c in channels)
    together = worth_of(_best([g for g in shapes if g.term.channel not in channels]))
    shape = max(alone, together)
    others = [t for t in terms if t.covariate != SHAPE]
    return FlexibleTerms(_best(found), shape, _best(gains(beyond_shape(fitted, terms), others)))


def _best(found: Sequence[TermEvidence]) -> TermEvidence | None:
    return max(found, key=lambda g: g.ln_bayes_factor, default=None)


def worth_of(gain: TermEvidence | None) -> float:
    """Log Bayes factor of a term; 0 where there is none, or where it does not pay for itself."""
    return 0.0 if gain is None else max(gain.ln_bayes_factor, 0.0)


def terms_of(fitted: FittedHypothesis) -> list[Term]:
    """Terms in every covariate that the histories have.

    Each is added to one channel; or shifts the temperature of all mechanical channels together, as what acts on the
    alloy or its thermometer would; or adds to the share transformed, in all of them in proportion to their spans.
    """
    out: list[Term] = []
    for channel in fitted.hypothesis.channels:
        blocks = [b for b in fitted.blocks if b.channel == channel]
        v = _covariates(fitted, channel)
        size = np.concatenate([np.full(b.first.size, _noise(fitted, b)) for b in blocks])
        rows = np.concatenate([np.arange(b.at.start, b.at.stop) for b in blocks])
        for name, columns in _columns(v):
            whole = np.zeros((fitted.whitened.size, columns.shape[1]))
            whole[rows] = columns * size[:, None]
            out.append(Term(name, channel, whole))
    return out + _joint_terms(fitted)


def _noise(fitted: FittedHypothesis, block: ChannelBlock) -> float:
    return fitted.noise[fitted.blocks.index(block)].sd


def _covariates(fitted: FittedHypothesis, channel: str) -> dict[str, Floats]:
    """Inputs of all histories, which condition a sample belongs to, and what the model says.

    Responses enter as predicted, since the measured ones would bring their own noise along.
    """
    hypothesis = fitted.hypothesis
    histories = hypothesis.histories
    names = set.intersection(*(set(h.inputs) for h in histories))
    joined = {k: np.concatenate([h.inputs[k] for h in histories]) for k in names}
    joined["condition"] = np.concatenate([np.full(h.n, float(i)) for i, h in enumerate(histories)])
    mu = [hypothesis.predict(fitted.theta, i) for i in range(len(histories))]
    for other in hypothesis.channels:
        name = SIMULATED if other == "temperature" else other
        joined[name] = np.concatenate([m[other] for m in mu])
    if channel == "temperature":
        joined["temperature"] = joined[SIMULATED]
        inputs = [h.inputs for h in histories]
        rates = [
            sweep_rate(m["temperature"], v["time"], v["segment"]) for m, v in zip(mu, inputs, strict=True)
        ]
        joined["rate"] = np.concatenate(rates)
    return joined


def _joint_terms(fitted: FittedHypothesis) -> list[Term]:
    """Terms that act on force, displacement and stiffness together."""
    channels = [c for c in fitted.hypothesis.channels if c != "temperature"]
    if len(channels) < 2:
        return []
    columns = _columns(_covariates(fitted, ""))
    at = np.cumsum([0, *(h.n for h in fitted.hypothesis.histories)])
    slopes, spans = {}, {}
    for block in fitted.blocks:
        if block.channel in channels:
            slopes[block], spans[block] = _leverage(fitted, block)
    out = []
    for label, leverage in (("temperature shift", slopes), ("share transformed", spans)):
        greatest = max(float(np.max(np.abs(v))) / _noise(fitted, b) for b, v in leverage.items())
        for name, basis in columns:
            if name in ALONE or (leverage is spans and name != "temperature"):
                continue
            whole = np.zeros((fitted.whitened.size, basis.shape[1]))
            for block, v in leverage.items():
                part = basis[at[block.history] : at[block.history + 1]]
                whole[block.at] = part * (v / max(greatest, 1e-300))[:, None]
            out.append(Term(name, label, whole))
    return out


def _leverage(fitted: FittedHypothesis, block: ChannelBlock) -> tuple[Floats, Floats]:
    """Derivative of a channel by temperature, and its span from cold to hot, at each sample of a block."""
    hypothesis = fitted.hypothesis
    inputs = hypothesis.histories[block.history].inputs

    def at(by: float) -> Floats:
        moved = {**inputs, "temperature": inputs["temperature"] + by}
        return hypothesis.predict(fitted.theta, block.history, moved)[block.channel]

    return (at(0.05) - at(-0.05)) / 0.1, at(FAR) - at(-FAR)


def _columns(v: dict[str, Floats]) -> list[tuple[str, Floats]]:
    """Names and columns of the terms that the covariates allow."""
    branch = indicators(v["branch"])
    temperature = bspline_basis(v["temperature"], 8)
    on_branch = row_tensor_product(branch, temperature)
    out = [
        ("temperature", on_branch),
        ("temperature", row_tensor_product(branch, bspline_basis(v["temperature"], 20))),
    ]
    condition = indicators(v["condition"])
    if condition.shape[1] > 1:
        out.append(("condition", row_tensor_product(condition, branch)))
        out.append(("temperature and condition", row_tensor_product(condition, on_branch)))
    cycle = indicators(grouped(v["cycle"]))
    if cycle.shape[1] > 1:
        coarse = row_tensor_product(branch, bspline_basis(v["temperature"], 5))
        out.append(("cycle", row_tensor_product(condition, cycle)))
        out.append(("temperature and cycle", row_tensor_product(cycle, coarse)))
    clock = "time" if "time" in v else "order"
    out.append((clock, row_tensor_product(condition, bspline_basis(v[clock], 10))))
    out += [(clock, linear(v[clock])), *((clock, step) for step in steps(v["condition"], STEPS))]
    if cycle.shape[1] > 1:
        out.append(("cycle", linear(v["cycle"])))
    if "rate" in v and np.ptp(v["rate"]) > 0.0:
        out.append(("rate", row_tensor_product(branch, bspline_basis(v["rate"], 8))))
        out.append(
            (
                "temperature and rate",
                row_tensor_product(
                    branch,
                    row_tensor_product(bspline_basis(v["temperature"], 5), bspline_basis(v["rate"], 4)),
                ),
            )
        )
    for name in ("force", "displacement", "stiffness", SIMULATED):
        if name in v and np.ptp(v[name]) > 0.0:
            out.append((name, bspline_basis(v[name], 20)))
    for name in ("current", "ambient_temperature", "load"):
        if name in v and np.ptp(v[name]) > 1e-9 * np.max(np.abs(v[name])):
            out.append((name, bspline_basis(v[name], min(5, np.unique(v[name]).size))))
    if {"time", "frequency"} <= set(v):
        phase = 2.0 * np.pi * v["frequency"] * v["time"]
        out.append(
            ("drive phase", np.stack([f(k * phase) for k in range(1, 9) for f in (np.sin, np.cos)], axis=1))
        )
    return out
