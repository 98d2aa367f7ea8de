"""Where model and measurement disagree, and whether chance explains it.

Every flexible term and the signature of every effect is tested, and the greatest of their Bayes factors is compared
with the greatest that residuals without any pattern give: whitened residuals of the fit, shuffled within each channel
of each history, with what the parameters absorb taken out. So one p-value pays for all the looking, and heavy tails of
the noise are in it. Where tails are heavy all is looked for once more in innovations that have their whole size, since
a misfit of few readings passes for tails.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.studies.gap.fitting import FittedHypothesis
from sma_bayes.studies.gap.flexible import TermEvidence, gains, terms_of
from sma_bayes.studies.gap.noise import ChannelBlock
from sma_bayes.studies.gap.periodic import Spectra
from sma_bayes.studies.gap.schema import StatedPeriodicity

SHUFFLES = 400
SURE_LN_BAYES_FACTOR, SHUFFLES_IF_SURE = 100.0, 100
"""Log Bayes factor from which on chance is not to be told to the digit, and the shuffles that are enough then."""
TAIL_SHARE = 0.2
"""Share of the shuffled maxima from which the tail beyond them is extrapolated."""
BINS = 10
"""Parts of the range of a covariate whose unions are searched for the place of a disagreement."""


@dataclass(frozen=True, slots=True)
class Disagreement:
    """A stretch of a covariate over which residuals lie to one side.

    Attributes
    ----------
    condition, branch, channel, covariate : str
    start, stop : float
        Ends of the stretch: the least and the greatest value of its samples [unit].
    unit : str
    size_sigma : float
        Mean residual there in standard errors, signed: positive where more was measured than predicted.
    mean : float
        Mean residual there [unit of the channel].
    """

    condition: str
    branch: str
    channel: str
    covariate: str
    start: float
    stop: float
    unit: str
    size_sigma: float
    mean: float


@dataclass(frozen=True, slots=True, eq=False)
class DisagreementTest:
    """What flexible terms and the signatures of effects say about residuals.

    Attributes
    ----------
    gains : list of TermEvidence
        Flexible terms, greatest Bayes factor first.
    p_value : float
        Of the greatest Bayes factor, over all terms and effects.
    extrapolated : bool
        Whether it lies beyond the shuffled ones.
    periodic : tuple of StatedPeriodicity
        Lines of spectra, best first, where they explain more than any covariate does.
    """

    gains: list[TermEvidence]
    p_value: float
    extrapolated: bool
    periodic: tuple[StatedPeriodicity, ...] = ()

    @property
    def best(self) -> TermEvidence:
        """The flexible term that brings most."""
        return self.gains[0]


class Signature(Protocol):
    """A pattern that residuals are tested for."""

    @property
    def ln_bayes_factor(self) -> float:
        """For the pattern, given the residuals of the fit."""
        ...

    def of(self, residuals: Floats) -> Floats:
        """The same for other whitened residuals (N, S), shape (S,)."""
        ...


def look(
    fitted: FittedHypothesis,
    signatures: Sequence[Signature],
    rng: np.random.Generator,
    shuffles: int = SHUFFLES,
) -> DisagreementTest:
    """Test the residuals of a fit against every covariate, and for the signatures of effects.

    Parameters
    ----------
    fitted : FittedHypothesis
    signatures : sequence of Signature
    rng : numpy.random.Generator
    shuffles : int
        At most; a disagreement that is far beyond chance takes `SHUFFLES_IF_SURE`.
    """
    found = sorted(gains(fitted, terms_of(fitted)), key=lambda g: -g.ln_bayes_factor)
    sure = bool(found) and found[0].ln_bayes_factor >= SURE_LN_BAYES_FACTOR
    null, null_whole = shuffled(fitted, rng, min(shuffles, SHUFFLES_IF_SURE) if sure else shuffles)
    # lines and steps, which the others contain, are there to be compared with effects, not to be looked for
    spectra = Spectra(fitted)
    patterns: list[Signature] = [*(g for g in found if g.term.columns.shape[1] > 1), *signatures, spectra]
    greatest = np.max(np.stack([p.of(null) for p in patterns]), axis=0)
    measured = max(p.ln_bayes_factor for p in patterns)
    if null_whole is not null:
        greatest = np.maximum(greatest, np.max(np.stack([p.of(null_whole) for p in patterns]), axis=0))
        measured = max(measured, *(float(p.of(fitted.whole[:, None])[0]) for p in patterns))
    p, beyond = tail_probability(greatest, measured)
    stands_out = spectra.ln_bayes_factor > found[0].ln_bayes_factor
    return DisagreementTest(found, p, beyond, spectra.lines() if stands_out else ())


def shuffled(fitted: FittedHypothesis, rng: np.random.Generator, count: int) -> tuple[Floats, Floats]:
    """Whitened residuals as they would be by chance, as they count and in their whole size.

    Those of each block in random order, with random signs since their sum would else be the same each time. They get
    the memory and size of a noise that is as likely as the data let it be, and are whitened with the estimated one.

    Returns
    -------
    counted, whole : ndarray, shape (N, count)
        The same array where no noise has heavy tails.
    """
    counted = np.empty((fitted.whitened.size, count))
    heavy = any(noise.heavy for noise in fitted.noise)
    whole = np.empty_like(counted) if heavy else counted
    for block, noise in zip(fitted.blocks, fitted.noise, strict=True):
        own = fitted.whitened[block.at]
        order = rng.permuted(np.tile(np.arange(own.size)[:, None], (1, count)), axis=0)
        sign = rng.choice([-1.0, 1.0], size=order.shape)
        for series, out in ((own, counted), *([(fitted.whole[block.at], whole)] if heavy else [])):
            new = (series / (np.sqrt(np.mean(series**2)) or 1.0))[order] * sign
            out[block.at] = noise.whiten(noise.as_likely(new, rng).T).T
    return counted, whole


def tail_probability(null: Floats, value: float) -> tuple[float, bool]:
    """Probability that the null exceeds a value, and whether it is extrapolated.

    Within the sample the share that exceeds it, itself counted; beyond, an exponential tail through the greatest
    fifth of it.

    Examples
    --------
    >>> import numpy as np
    >>> p, beyond = tail_probability(np.random.default_rng(0).exponential(size=4000), 12.0)
    >>> beyond, bool(2e-6 < p < 2e-5)
    (True, True)
    """
    exceeding = int(np.sum(null >= value))
    if exceeding >= 10:
        return (1.0 + exceeding) / (1.0 + null.size), False
    threshold = float(np.quantile(null, 1.0 - TAIL_SHARE))
    scale = float(np.mean(null[null > threshold] - threshold))
    return float(TAIL_SHARE * np.exp(-max(value - threshold, 0.0) / max(scale, 1e-12))), True


def disagreements(fitted: FittedHypothesis, covariates: Sequence[str], most: int = 6) -> list[Disagreement]:
    """The stretches of the greatest mean residual, no two of them overlapping.

    Parameters
    ----------
    fitted : FittedHypothesis
    covariates : sequence of str
        Inputs along which to search; those that a history lacks are left out.
    most : int
    """
    found: list[tuple[Disagreement, frozenset[int]]] = []
    for block in fitted.blocks:
        history = fitted.hypothesis.histories[block.history]
        for sign, branch in ((1.0, "heating"), (-1.0, "cooling")):
            on = history.inputs["branch"] == sign
            for name in covariates:
                if name in history.inputs and np.ptp(history.inputs[name][on]) > 0.0 if on.any() else False:
                    found += _stretches(fitted, block, on, branch, name)
    found.sort(key=lambda f: -abs(f[0].size_sigma))
    kept: list[tuple[Disagreement, frozenset[int]]] = []
    for candidate in found:
        if all(not (candidate[1] & other[1]) for other in kept):
            kept.append(candidate)
        if len(kept) == most:
            break
    return [d for d, _ in kept]


def _stretches(
    fitted: FittedHypothesis, block: ChannelBlock, on: Floats, branch: str, name: str
) -> list[tuple[Disagreement, frozenset[int]]]:
    """Best union of neighbouring bins of a covariate, upwards and downwards."""
    history = fitted.hypothesis.histories[block.history]
    x = history.inputs[name]
    edges = np.unique(np.quantile(x[on], np.linspace(0.0, 1.0, BINS + 1)))
    inside = [
        on & (x >= low) & ((x < high) if i < len(edges) - 2 else (x <= high))
        for i, (low, high) in enumerate(pairwise(edges.tolist()))
    ]
    columns = np.zeros((fitted.whitened.size, len(inside)))
    columns[block.at] = np.stack(inside, axis=1)
    whitened = fitted.whiten(columns.T).T
    information = whitened.T @ fitted.project_out(whitened)
    b = whitened.T @ fitted.project_out(fitted.whole[:, None])[:, 0]
    out = []
    for direction in (1.0, -1.0):
        best: tuple[float, int, int] | None = None
        for i in range(len(inside)):
            for j in range(i + 1, len(inside) + 1):
                spread = float(information[i:j, i:j].sum())
                if spread <= 1e-9:
                    continue
                z = direction * float(b[i:j].sum()) / np.sqrt(spread)
                if best is None or z > best[0]:
                    best = z, i, j
        if best is None or best[0] <= 2.0:
            continue
        z, i, j = best
        mask = np.any(inside[i:j], axis=0)
        samples = frozenset((block.at.start + np.flatnonzero(mask)).tolist())
        mean = float(np.mean(fitted.residual[block.at][mask]))
        unit = history.units.get(name, "1")
        ends = float(x[mask].min()), float(x[mask].max())
        out.append((
            Disagreement(history.condition.id, branch, block.channel, name, *ends, unit, direction * z, mean),
            samples,
        ))  # fmt: skip
    return out
