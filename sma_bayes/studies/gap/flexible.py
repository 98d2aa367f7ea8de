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
from scipy.stats import norm

from sma_bayes.arrays import Floats
from sma_bayes.records.history import sweep_rate
from sma_bayes.studies.gap.fitting import FittedHypothesis
from sma_bayes.studies.gap.free_shape import free_curves
from sma_bayes.studies.gap.noise import ChannelBlock
from sma_bayes.studies.gap.noise_columns import slope_of
from sma_bayes.studies.gap.splines import (
    bspline_basis,
    grouped,
    indicators,
    linear,
    row_tensor_product,
    steps,
)

COEFFICIENT_SD_GRID = np.geomspace(0.03, 100.0, 10)
"""Sizes of the coefficients that are averaged over, in standard deviations of the noise of the channel."""


SHAPE_COVARIATE = "temperature"
"""Covariate of the terms that only bend a curve."""
SIMULATED_TEMPERATURE = "simulated temperature"
SINGLE_CHANNEL_COVARIATES = ("force", "displacement", "stiffness", SIMULATED_TEMPERATURE, "drive phase")
"""Covariates of terms that are not tried on several channels together."""
STEP_PLACES = 6
"""Places at which a step in time is tried, at equal distances along each condition."""
FULLY_TRANSFORMED_DISTANCE = 500.0
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
class TermWorth:
    """What a term would bring.

    Attributes
    ----------
    term : Term
    ln_bayes_factor : float
        For the term, over the model as it is.
    """

    term: Term
    ln_bayes_factor: float


@dataclass(frozen=True, slots=True, eq=False)
class TermEvidence(TermWorth):
    """What a term would bring, also to other residuals.

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
    precision = COEFFICIENT_SD_GRID[:, None] ** -2.0  # of the coefficients
    fit = 0.5 * (1.0 / (information + precision)) @ (b * b)
    price = 0.5 * np.log1p(COEFFICIENT_SD_GRID[:, None] ** 2 * information).sum(axis=1)
    return np.asarray(logsumexp(fit - price[:, None], axis=0) - np.log(COEFFICIENT_SD_GRID.size))


def log_density_of_size(fitted: FittedHypothesis, change: Floats) -> float:
    """Log prior density of the logarithm of a size, were it the coefficient of a term.

    Parameters
    ----------
    fitted : FittedHypothesis
    change : ndarray, shape (N,)
        What is added, of which the greatest value counts, in standard deviations of the noise of its channel.
    """
    size = max(float(np.max(np.abs(change[b.at]))) / channel_sd(fitted, b.channel) for b in fitted.blocks)
    each = norm.logpdf(size, scale=COEFFICIENT_SD_GRID)
    return float(logsumexp(each) - np.log(COEFFICIENT_SD_GRID.size) + np.log(size))


def gains(fitted: FittedHypothesis, terms: Sequence[Term]) -> list[TermEvidence]:
    """What each term would bring to a fitted model, and to other residuals of it."""
    out = []
    left = fitted.left
    for term in terms:
        whitened = fitted.whiten(term.columns.T).T
        projected = fitted.project_out(whitened)
        information, axes = _independent(whitened.T @ projected)
        if not information.size:
            continue
        b = axes.T @ (whitened.T @ left)
        value = float(log_bayes_factor(b[:, None], information)[0])
        out.append(TermEvidence(term, value, projected @ axes, information))
    return out


def _independent(a: Floats) -> tuple[Floats, Floats]:
    """Coordinates in which `A` is diagonal: the diagonal and the axes, without what the model absorbs."""
    information, axes = np.linalg.eigh(a)
    kept = information > 1e-9 * max(float(information[-1]), 1e-300)
    return information[kept], axes[:, kept]


class WhitenedTerms:
    """Terms as the noise has them, to be weighed in several models that have that noise.

    What a term brings hangs on products of its columns alone, which are made once; see `gains`, which gives the
    directions as well.

    Parameters
    ----------
    fitted : FittedHypothesis
        Whose noise it is.
    terms : sequence of Term
    """

    def __init__(self, fitted: FittedHypothesis, terms: Sequence[Term]) -> None:
        self.terms = tuple(terms)
        self._columns = [fitted.whiten(t.columns.T) for t in terms]  # (k, N)
        self._products = [c @ c.T for c in self._columns]

    def gains(self, fitted: FittedHypothesis) -> list[TermWorth]:
        """What each term would bring to a fitted model."""
        absorbed = np.linalg.solve(fitted.precision, np.eye(len(fitted.precision)))
        out = []
        for term, columns, product in zip(self.terms, self._columns, self._products, strict=True):
            shared = columns @ fitted.jacobian
            information, axes = _independent(product - shared @ absorbed @ shared.T)
            if information.size:
                b = axes.T @ (columns @ fitted.left)
                out.append(TermWorth(term, float(log_bayes_factor(b[:, None], information)[0])))
        return out


def shape_terms(fitted: FittedHypothesis) -> tuple[list[Term], list[Term]]:
    """Terms that let the curves bend inside the effects, one a channel: with all splines, and with few."""
    sizes = {c: channel_sd(fitted, c) for c in _mechanical(fitted)}
    found = free_curves(fitted, sizes) if sizes else {}
    fine, coarse = ([Term(SHAPE_COVARIATE, c, of[i]) for c, of in found.items()] for i in (0, 1))
    return fine, coarse


def beyond_shape(fitted: FittedHypothesis, shape: Sequence[Term]) -> tuple[FittedHypothesis, float]:
    """The same fit with the shape of every curve free, and its log evidence then.

    What terms and effects bring to it is not what the curve of a specimen has by being no sigmoid, the same in every
    cycle and condition. The prior of a coefficient is as wide as the channel covers: freedom costs the same with an
    effect and without, so it is no matter how much of a curve an effect could have explained by itself.

    Parameters
    ----------
    fitted : FittedHypothesis
    shape : sequence of Term
        As of `shape_terms`.
    """
    if not shape:
        return fitted, fitted.ln_evidence
    columns = fitted.whiten(np.concatenate([t.columns for t in shape], axis=1).T).T
    held = np.concatenate([np.full(t.columns.shape[1], _loose(fitted, t.channel)) for t in shape])
    free = fitted.jacobian.shape[1]
    jacobian = np.concatenate([fitted.jacobian, columns], axis=1)
    precision = jacobian.T @ jacobian
    precision[:free, :free] = fitted.precision
    place = np.arange(free, len(precision))
    precision[place, place] += held
    a, b = columns.T @ fitted.project_out(columns), columns.T @ fitted.left
    a[np.diag_indices_from(a)] += held
    volume = np.linalg.slogdet(a)[1] - float(np.sum(np.log(held)))
    value = fitted.ln_evidence + 0.5 * float(b @ np.linalg.solve(a, b)) - 0.5 * float(volume)
    return replace(fitted, jacobian=jacobian, precision=precision), value


def _loose(fitted: FittedHypothesis, channel: str) -> float:
    """Precision of the coefficient of a spline whose prior is as wide as its channel covers."""
    span = fitted.hypothesis.scales.span.get(channel, 0.0)
    return float((channel_sd(fitted, channel) / max(span, 1e-300)) ** 2)


@dataclass(frozen=True, slots=True)
class FlexibleTerms:
    """What flexible terms bring to a fitted model.

    Attributes
    ----------
    best : TermWorth or None
        The best of all.
    shape : float
        Log Bayes factor of a curve that is free to have any shape: in every channel by itself, or in all together.
    beyond : TermWorth or None
        The best on top of that.
    free : float
        Log evidence of the model with all curves free, up to a constant; see `beyond_shape`.
    curved : bool
        Whether there is a curve that could have another shape; a heat balance has none.
    """

    best: TermWorth | None
    shape: float
    beyond: TermWorth | None
    free: float
    curved: bool = True

    def explained_beyond_shape(self, without: FlexibleTerms) -> float:
        """What an effect and the best term on top of it are worth beside free curves, by the terms without it."""
        return self.free - without.free + worth_of(self.beyond)


def offer(fitted: FittedHypothesis, found: Sequence[TermWorth] = ()) -> FlexibleTerms:
    """What flexible terms bring to a fitted model; `found`, if that is known already for it as it is."""
    terms = WhitenedTerms(fitted, [g.term for g in found] or terms_of(fitted))
    found = found or terms.gains(fitted)
    fine, coarse = shape_terms(fitted)
    free, evidence = beyond_shape(fitted, fine)
    if not fine:
        return FlexibleTerms(_best(found), 0.0, _best(found), evidence, curved=False)
    bent = WhitenedTerms(fitted, [*fine, *coarse]).gains(fitted)
    shapes = [*bent, *(g for g in found if g.term.covariate == SHAPE_COVARIATE)]
    channels = {t.channel for t in fine}
    apart = sum(worth_of(_best([g for g in shapes if g.term.channel == c])) for c in channels)
    joint = [g for g in shapes if g.term.channel not in channels]
    others = [g for g in terms.gains(free) if g.term.covariate != SHAPE_COVARIATE]
    return FlexibleTerms(_best(found), max(apart, worth_of(_best(joint))), _best(others), evidence)


def _best(found: Sequence[TermWorth]) -> TermWorth | None:
    return max(found, key=lambda g: g.ln_bayes_factor, default=None)


def worth_of(gain: TermWorth | None) -> float:
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
        size = channel_sd(fitted, channel)
        rows = np.concatenate([np.arange(b.at.start, b.at.stop) for b in blocks])
        for name, columns in _columns(v):
            whole = np.zeros((fitted.whitened.size, columns.shape[1]))
            whole[rows] = columns * size
            out.append(Term(name, channel, whole))
    return out + _joint_terms(fitted)


def _mechanical(fitted: FittedHypothesis) -> list[str]:
    return [c for c in fitted.hypothesis.channels if c != "temperature"]


def channel_sd(fitted: FittedHypothesis, channel: str) -> float:
    """Standard deviation of the noise of a channel, the root mean square over all histories.

    One for all, so that what is common to all histories stays so.
    """
    own = [n.sd for b, n in zip(fitted.blocks, fitted.noise, strict=True) if b.channel == channel]
    return float(np.sqrt(np.mean(np.square(own))))


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
        name = SIMULATED_TEMPERATURE if other == "temperature" else other
        joined[name] = np.concatenate([m[other] for m in mu])
    if channel == "temperature":
        joined["temperature"] = joined[SIMULATED_TEMPERATURE]
        inputs = [h.inputs for h in histories]
        rates = [
            sweep_rate(m["temperature"], v["time"], v["segment"]) for m, v in zip(mu, inputs, strict=True)
        ]
        joined["rate"] = np.concatenate(rates)
    return joined


def _joint_terms(fitted: FittedHypothesis) -> list[Term]:
    """Terms that act on force, displacement and stiffness together."""
    channels = _mechanical(fitted)
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
        greatest = max(float(np.max(np.abs(v))) / channel_sd(fitted, b.channel) for b, v in leverage.items())
        for name, basis in columns:
            if name in SINGLE_CHANNEL_COVARIATES or (leverage is spans and name != "temperature"):
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

    return slope_of(hypothesis, block, fitted.theta), at(FULLY_TRANSFORMED_DISTANCE) - at(
        -FULLY_TRANSFORMED_DISTANCE
    )


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
    out += [(clock, linear(v[clock])), *((clock, step) for step in steps(v["condition"], STEP_PLACES))]
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
    for name in ("force", "displacement", "stiffness", SIMULATED_TEMPERATURE):
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
