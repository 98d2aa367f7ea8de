"""How much of the gap adding the effects closes, on measurements that had no part in choosing them.

Measurements are dealt out into folds: whole cycles, or whole conditions, or, where there are neither, stretches of a
sweep. For each fold the loop runs anew on the others: effects are chosen and all parameters fitted without it. Then
the fold is predicted, with and without them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sma_bayes.account import Account
from sma_bayes.arrays import Floats
from sma_bayes.effects.types import Effect
from sma_bayes.records.history import History
from sma_bayes.runs.jobs import run
from sma_bayes.studies.gap.fitting import (
    FittedHypothesis,
    fit_hypothesis,
    fit_with_noise,
    held_at,
    measured,
    stacked,
)
from sma_bayes.studies.gap.flexible import COEFFICIENT_SD_GRID, Term, TermEvidence, gains, terms_of
from sma_bayes.studies.gap.hypothesis import Hypothesis
from sma_bayes.studies.gap.name import Candidate
from sma_bayes.studies.gap.noise import BlockNoise, Noise, blocks_of, whiten_residual
from sma_bayes.studies.gap.study import SIGNIFICANT_P, GapStudy, study_from

NOISE_ONLY_RMS = 1.0
"""Root mean square of innovations without any gap, in standard deviations of the noise."""
FOLDS = 3
NOISE_DRAWS = 200
"""Draws of the noise by which is told what it alone leaves."""
HELD_OUT_STRETCHES = 12
"""Stretches of a sweep that are dealt out where there is only one cycle and no other condition."""

Masks = tuple[NDArray[np.bool_], ...]


@dataclass(frozen=True, slots=True)
class ChannelGap:
    """Held-out residuals of one channel.

    Attributes
    ----------
    before_sigma, after_sigma : float
        Root mean square as innovations of the noise, in its standard deviations.
    before, after, noise : float
        Root mean square as they are, and what the noise alone would leave of them [unit of the channel]. Noise that
        hardly changes is followed by the parameters, so that it leaves less than its standard deviation.
    """

    before_sigma: float
    after_sigma: float
    before: float
    after: float
    noise: float

    @property
    def way_to_noise(self) -> float:
        """Share of the way from the gap before to noise alone; see `way_to_noise`."""
        return way_to_noise(self.before_sigma, self.after_sigma)


def way_to_noise(before: float, after: float) -> float:
    """Share of the way to noise alone, ``(before - after)/(before - 1)``; 0 where noise alone was left before.

    Parameters
    ----------
    before, after : float
        Root mean square of innovations, in standard deviations of the noise.

    Examples
    --------
    >>> round(way_to_noise(5.47, 5.15), 3), way_to_noise(0.99, 0.98)
    (0.072, 0.0)
    """
    return (before - after) / (before - NOISE_ONLY_RMS) if before > NOISE_ONLY_RMS else 0.0


@dataclass(frozen=True, slots=True)
class Gap:
    """Gap between model and measurement, before and after adding the effects.

    Attributes
    ----------
    before, after, floor : float
        Root mean square of held-out residuals, as innovations of the noise, in its standard deviations: of the model
        without effects, with those that were chosen without the fold, and with the most helpful flexible term besides,
        where that helps. Where the study says that something is left, the floor is at most what noise alone gives.
    held_out : str
        What was held out.
    chosen : tuple of tuple of str
        Effects that were chosen without each fold.
    channels : mapping of str to ChannelGap
    """

    before: float
    after: float
    floor: float
    held_out: str
    chosen: tuple[tuple[str, ...], ...]
    channels: Mapping[str, ChannelGap]

    @property
    def way_to_noise(self) -> float:
        """Share of the way from the gap before to noise alone; see `way_to_noise`."""
        return way_to_noise(self.before, self.after)

    @property
    def shrink(self) -> float:
        """Closed share of what can be explained, ``(before - after)/(before - floor)``; 0 where that is nothing."""
        return (self.before - self.after) / (self.before - self.floor) if self.before > self.floor else 0.0


@dataclass(frozen=True, slots=True)
class HeldOutScore:
    """Difference of the log density of held-out measurements that an effect makes.

    Attributes
    ----------
    delta, se : float
    """

    delta: float
    se: float


def folds_of(histories: Sequence[History], *, pooled: bool) -> tuple[list[Masks], str]:
    """What is held out in turn, as masks of each history, and what to call it."""
    cycles = [np.unique(h.inputs["cycle"]) for h in histories]
    if min(c.size for c in cycles) >= FOLDS:
        ranks = [np.searchsorted(c, h.inputs["cycle"]) for c, h in zip(cycles, histories, strict=True)]
        named = "cycles, a third at a time"
    elif pooled and len(histories) >= FOLDS:
        ranks = [np.full(h.n, i) for i, h in enumerate(histories)]
        named = "conditions, a third at a time"
    else:
        ranks = [_stretches(h) for h in histories]
        named = f"each sweep in {HELD_OUT_STRETCHES} stretches, a third of them at a time"
    return [tuple(r % FOLDS == fold for r in ranks) for fold in range(FOLDS)], named


def _stretches(history: History) -> NDArray[np.intp]:
    out = np.zeros(history.n, dtype=np.intp)
    segment = history.inputs["segment"]
    for s in np.unique(segment):
        on = np.flatnonzero(segment == s)
        out[on] = np.arange(on.size) * HELD_OUT_STRETCHES // on.size
    return out


@dataclass(frozen=True, slots=True)
class Fold:
    """A fold to predict: what a process needs for it."""

    study: GapStudy
    effects: Mapping[str, Effect]
    out: Masks
    seed: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Predicted:
    """Sums of squares over a fold.

    Attributes
    ----------
    squares : ndarray, shape (3,)
        Of innovations: before, after, and with a flexible term besides.
    channels : mapping of str to ndarray, shape (6,)
        Of each channel: samples; squared innovations before and after; squared residuals before and after [unit^2];
        what noise alone would leave of these [unit^2].
    chosen : tuple of str
    """

    squares: Floats
    channels: Mapping[str, Floats]
    chosen: tuple[str, ...]


def close(
    study: GapStudy,
    effects: Mapping[str, Effect],
    *,
    pooled: bool,
    seed: int,
    jobs: int | None = 1,
    account: Account | None = None,
) -> Gap:
    """Gap before and after on held-out measurements.

    Parameters
    ----------
    study : GapStudy
    effects : mapping of str to Effect
        Catalogue from which each fold chooses anew.
    pooled : bool
    seed : int
    jobs : int, optional
        Processes; by default one for each core.
    account : Account, optional
        Told how long it took, as the stage ``hold_out``.
    """
    masks, named = folds_of(study.baseline.hypothesis.histories, pooled=pooled)
    folds = [Fold(study, effects, out, (seed, 11, i)) for i, out in enumerate(masks)]
    found = list(run(predict_fold, folds, jobs, account=account, stage="hold_out"))
    sums = {c: np.sum([f.channels[c] for f in found], axis=0) for c in found[0].channels}
    channels = {
        c: ChannelGap(*np.sqrt(own[1:] / max(float(own[0]), 1.0)).tolist()) for c, own in sums.items()
    }
    count = sum(float(f.channels[c][0]) for f in found for c in f.channels)
    rms = np.sqrt(np.sum([f.squares for f in found], axis=0) / max(count, 1.0))
    floor = min(float(rms[1]), float(rms[2]))
    if study.left.p_value <= SIGNIFICANT_P:
        floor = min(floor, NOISE_ONLY_RMS)
    return Gap(float(rms[0]), float(rms[1]), floor, named, tuple(f.chosen for f in found), channels)


def predict_fold(fold: Fold) -> Predicted:
    """Run the loop without a fold, and predict it."""
    first, out = fold.study.baseline, fold.out
    kept = tuple(~m for m in out)
    train, test = first.hypothesis.on(kept), first.hypothesis.on(out)
    base = fit_with_noise(train, first.z)
    final = study_from(base, fold.effects, np.random.default_rng(fold.seed), lambda _: None).final
    noise = _noise_on(fold.study.final, out)
    extended = test.with_effects(final.hypothesis.effects)
    rows = _rows(first, kept), _rows(first, out)
    left = (
        _residual(test, base.theta),
        _residual(extended, final.theta),
        _with_flexible(final, extended, fold.study.final, *rows),
    )
    alone = by_noise_alone(final, extended, fold.study.final, *rows, np.random.default_rng((*fold.seed, 1)))
    blocks = blocks_of(test)
    whitened = [whiten_residual(blocks, noise, r) ** 2 for r in left]
    channels: dict[str, Floats] = {}
    for block in blocks:
        n = block.first.size
        parts = (whitened[0], whitened[1], left[0] ** 2, left[1] ** 2, alone)
        own_sums = np.array([n, *(np.sum(x[block.at]) for x in parts)])
        channels[block.channel] = channels.get(block.channel, 0.0) + own_sums
    chosen = tuple(e.id for e in final.hypothesis.effects)
    return Predicted(np.array([w.sum() for w in whitened]), channels, chosen)


def held_out_scores(
    fitted: FittedHypothesis, candidates: Sequence[Candidate], *, pooled: bool
) -> dict[str, HeldOutScore]:
    """What each refitted candidate does for held-out measurements, refitted without them.

    Parameters
    ----------
    fitted : FittedHypothesis
        The model that the candidates extend.
    candidates : sequence of Candidate
    pooled : bool
    """
    folds, _ = folds_of(fitted.hypothesis.histories, pooled=pooled)
    gained: dict[str, list[Floats]] = {}
    for out in folds:
        kept = tuple(~m for m in out)
        plain = fit_hypothesis(fitted.hypothesis.on(kept), fitted.z, _noise_on(fitted, kept))
        test = fitted.hypothesis.on(out)
        blocks, noise = blocks_of(test), _noise_on(fitted, out)
        before = whiten_residual(blocks, noise, _residual(test, plain.theta))
        for candidate in candidates:
            if candidate.fitted is None:
                continue
            own = fit_hypothesis(
                candidate.fitted.hypothesis.on(kept), candidate.fitted.z, _noise_on(fitted, kept)
            )
            extended = candidate.fitted.hypothesis.on(out)
            after = whiten_residual(blocks, noise, _residual(extended, own.theta))
            gained.setdefault(candidate.effect.id, []).append(0.5 * (before**2 - after**2))
    return {
        name: HeldOutScore(float(np.sum(g)), float(np.std(g) * np.sqrt(g.size)))
        for name, g in ((name, np.concatenate(parts)) for name, parts in gained.items())
    }


def _rows(fitted: FittedHypothesis, kept: Masks) -> NDArray[np.intp]:
    return np.concatenate([np.flatnonzero(kept[b.history]) + b.at.start for b in fitted.blocks])


def _noise_on(fitted: FittedHypothesis, kept: Masks) -> Noise:
    """The noise of a fit, for some of the samples of each block."""
    return tuple(
        n.on(kept[b.history])
        for b, n in zip(fitted.blocks, fitted.noise, strict=True)
        if kept[b.history].any()
    )


def by_noise_alone(
    train: FittedHypothesis,
    test: Hypothesis,
    whole: FittedHypothesis,
    rows_train: NDArray[np.intp],
    rows_test: NDArray[np.intp],
    rng: np.random.Generator,
) -> Floats:
    """Mean squares that the noise alone would leave of what is held out (N_test,), once parameters followed the rest.

    Parameters
    ----------
    train : FittedHypothesis
        Fitted to the rest.
    test : Hypothesis
        The same about what is held out.
    whole : FittedHypothesis
        Whose noise it is, of all samples.
    rows_train, rows_test : ndarray of int
        Places of either among all samples.
    rng : numpy.random.Generator
    """
    noise = np.empty((whole.whitened.size, NOISE_DRAWS))
    for block, own in zip(whole.blocks, whole.noise, strict=True):
        fresh = rng.standard_normal((block.first.size, NOISE_DRAWS))
        noise[block.at] = replace(own, others=()).as_likely(fresh, rng)
    pull = train.jacobian.T @ train.whiten(noise[rows_train].T).T
    for block, own in zip(whole.blocks, whole.noise, strict=True):  # is there, but moves no parameter
        noise[block.at] += np.reshape(own.excess, (-1, 1))
    unit = tuple(BlockNoise(1.0, np.zeros(b.first.size)) for b in blocks_of(test))
    slopes = held_at(test, train.z, unit).jacobian
    left = noise[rows_test] - slopes @ np.linalg.solve(train.precision, pull)
    return np.asarray(np.mean(left**2, axis=1))


def _residual(hypothesis: Hypothesis, theta: Floats) -> Floats:
    blocks = blocks_of(hypothesis)
    return np.asarray(measured(hypothesis, blocks) - stacked(hypothesis, blocks, theta))


def _with_flexible(
    train: FittedHypothesis,
    test: Hypothesis,
    whole: FittedHypothesis,
    rows_train: NDArray[np.intp],
    rows_test: NDArray[np.intp],
) -> Floats:
    """Held-out residuals with the flexible term that brings most on the rest."""
    terms = terms_of(whole)
    on_train = [Term(t.covariate, t.channel, t.columns[rows_train]) for t in terms]
    found = gains(train, on_train)
    best: TermEvidence = max(found, key=lambda g: g.ln_bayes_factor)
    columns = terms[[id(t) for t in on_train].index(id(best.term))].columns
    whitened = train.whiten(columns[rows_train].T).T
    projected = train.project_out(whitened)
    a, b = whitened.T @ projected, projected.T @ train.whitened
    information, axes = np.linalg.eigh(a)
    sizes = [_evidence(axes.T @ b, np.maximum(information, 0.0), s) for s in COEFFICIENT_SD_GRID]
    size = float(COEFFICIENT_SD_GRID[int(np.argmax(sizes))])
    coefficients = axes @ ((axes.T @ b) / (np.maximum(information, 0.0) + size**-2.0))
    pull = train.jacobian.T @ (train.whitened - whitened @ coefficients)
    z = train.z + np.linalg.solve(train.precision, pull)
    return np.asarray(_residual(test, test.space.constrain(z)) - columns[rows_test] @ coefficients)


def _evidence(b: Floats, information: Floats, size: float) -> float:
    return float(
        0.5 * np.sum(b**2 / (information + size**-2.0)) - 0.5 * np.sum(np.log1p(size**2 * information))
    )
