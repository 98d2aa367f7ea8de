"""Jumps: what a grip that slips, a knock or a zero that is set anew leaves, which no law of the catalogue is.

A few jumps in one direction look like a law of the cycle or of the time, and what each cycle has of its own follows any
of them. But a law changes what it changes gradually, or from one cycle to the next: jumps within cycles it must leave.
So jumps are looked for one by one, each where it explains most beside those before it, in a model whose curves are free
to have any shape, and an effect has to explain as much as they do: in the noise that the model leaves, and in that
which is left beside the jumps. What each cycle has of its own is held against jumps within cycles alone, since those
between cycles are the same thing.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import gammaln

from sma_bayes.arrays import Bools, Floats
from sma_bayes.studies.gap.finite import STRONG_LN_BAYES_FACTOR
from sma_bayes.studies.gap.fitting import FittedHypothesis, fit_hypothesis, in_steady_noise
from sma_bayes.studies.gap.flexible import (
    FlexibleTerms,
    beyond_shape,
    channel_sd,
    log_bayes_factor,
    offer,
    shape_terms,
)
from sma_bayes.studies.gap.noise import ChannelBlock
from sma_bayes.studies.gap.noise_estimate import noise_of

LEAST_SHARE_OF_JUMPS = 0.5
"""Share of what an effect explains that jumps must explain to be its rivals."""
JUMPS_OF_A_CONDITION = 4
"""Jumps of a condition, at most, on average over all of them."""
COARSE_PLACES = 40
"""Places of each condition and channel at which a jump is tried first; it is then moved to the sample."""
GREATEST_INNOVATIONS = 20
"""Greatest innovations of each of these, at which a jump is tried as well."""
MAX_REFINEMENTS = 5
"""How often all jumps are moved in turn, at most."""
EDGE_OF_A_CYCLE = 0.1
"""Share of a cycle at either end in which a jump is not surely one within it."""
LEAST_SAMPLES_BETWEEN = 3
"""Samples between a jump and the end of its condition, or another jump, at least."""


@dataclass(frozen=True, slots=True)
class Jump:
    """A channel that jumps, and stays so to the end of its condition.

    Attributes
    ----------
    block : ChannelBlock
        Channel and condition.
    sample : int
        The first sample after it.
    by : float
        How far it jumps [unit of the channel].
    """

    block: ChannelBlock
    sample: int
    by: float


Place = tuple[ChannelBlock, int]
"""Where a channel may jump, and the first sample after that."""


@dataclass(frozen=True, eq=False)
class Jumps:
    """Jumps in a fitted model, looked for when they are asked for.

    Attributes
    ----------
    fitted : FittedHypothesis
        The model.
    within_cycles : bool
        Whether only jumps well within cycles are looked for.
    """

    fitted: FittedHypothesis
    within_cycles: bool = False

    @property
    def worth(self) -> float:
        """Log Bayes factor of the jumps in a model whose curves are free, 0 where there are none."""
        return self._search[1]

    @property
    def found(self) -> tuple[Jump, ...]:
        """The jumps, by condition and channel."""
        return self._search[0]

    @property
    def told(self) -> tuple[Jump, ...]:
        """The jumps as they are told: in the noise that is left beside them, where that is smaller."""
        return (self.in_own_noise or self).found

    def are_rivals_of(self, explained: float) -> bool:
        """Whether they explain so much of what an effect does, or noise remembers for less beside them.

        A jump that is not in the model passes for noise in part, and for a long memory, beside which it counts little,
        and less where tails are heavy.
        """
        return self.worth >= LEAST_SHARE_OF_JUMPS * explained or self._in_steady_noise is not None

    @cached_property
    def in_own_noise(self) -> Jumps | None:
        """Jumps in the same model with the noise that is left beside these; None where that is not smaller."""
        if not self.found:
            return self._in_steady_noise
        fitted = self.fitted
        residual = fitted.residual.copy()
        for jump in self.found:
            residual[jump.block.at.start + jump.sample : jump.block.at.stop] -= jump.by
        noise = noise_of(fitted.hypothesis, fitted.blocks, residual, fitted.theta)
        smaller = sum(a.log_scale - b.log_scale for a, b in zip(fitted.noise, noise, strict=True))
        if smaller < STRONG_LN_BAYES_FACTOR:
            return self._in_steady_noise
        return Jumps(fit_hypothesis(fitted.hypothesis, fitted.z, noise), self.within_cycles)

    @cached_property
    def _in_steady_noise(self) -> Jumps | None:
        steady = in_steady_noise(self.fitted)
        return None if steady is None else Jumps(steady, self.within_cycles)

    @cached_property
    def _flexible(self) -> FlexibleTerms:
        return offer(self.fitted)

    def evidence_over(self, extended: FittedHypothesis, explained: float) -> float:
        """Log Bayes factor of an effect, with the best flexible term on top of it, over the jumps.

        Parameters
        ----------
        extended : FittedHypothesis
            The model with the effect.
        explained : float
            Log Bayes factor of the two over the model, where curves are free.

        Returns
        -------
        float
            The smaller one of that in the noise of the model and in that beside the jumps.
        """
        over = explained - self.worth
        own = self.in_own_noise
        if own is None:
            return over
        with_it = offer(fit_hypothesis(extended.hypothesis, extended.z, own.fitted.noise))
        return min(over, with_it.explained_beyond_shape(own._flexible) - own.worth)

    @cached_property
    def _free(self) -> FittedHypothesis:
        """The model with the shape of every curve free."""
        return beyond_shape(self.fitted, shape_terms(self.fitted)[0])[0]

    @cached_property
    def _search(self) -> tuple[tuple[Jump, ...], float]:
        tried = _Steps(self._free, [(b, i) for b in self.fitted.blocks for i in self._coarse(b)])
        chosen = _Steps(self._free, [])
        worth = 0.0
        most = JUMPS_OF_A_CONDITION * len(self.fitted.hypothesis.histories)
        while tried.places and len(chosen.places) < most:
            best = tried.places[int(np.argmax(tried.gain_beside(chosen)))]
            longer = self._refined([*chosen.places, best], [len(chosen.places)])
            more = self._worth(longer)
            if more <= worth:
                break
            chosen, worth = longer, more
        if not chosen.places:
            return (), 0.0
        for _ in range(MAX_REFINEMENTS):
            before, chosen = chosen, self._refined(chosen.places, range(len(chosen.places)))
            if chosen.places == before.places:
                break
        size = np.linalg.solve(chosen.product(chosen), chosen.along)
        jumps = [
            Jump(block, sample, float(s) * channel_sd(self.fitted, block.channel))
            for (block, sample), s in zip(chosen.places, size, strict=True)
        ]
        jumps.sort(key=lambda j: (j.block.history, j.block.channel, j.sample))
        return tuple(jumps), self._worth(chosen)

    def _may_jump(self, block: ChannelBlock) -> Bools:
        """Samples of a block before which it may jump."""
        n = block.at.stop - block.at.start
        inner = np.arange(n)
        may: Bools = (inner >= LEAST_SAMPLES_BETWEEN) & (inner <= n - LEAST_SAMPLES_BETWEEN)
        if self.within_cycles:
            cycle = self.fitted.hypothesis.histories[block.history].inputs["cycle"]
            for number in np.unique(cycle):
                own = np.flatnonzero(cycle == number)
                edge = round(EDGE_OF_A_CYCLE * own.size)
                may[own[: edge + 1]] = may[own[own.size - edge :]] = False
        return may

    def _coarse(self, block: ChannelBlock) -> list[int]:
        """Samples of a block at which a jump is tried first: at equal distances, and where innovations are greatest.

        The longer noise remembers, the more of a jump is in the one innovation in which it happens.
        """
        places = np.flatnonzero(self._may_jump(block))
        even = np.linspace(0, places.size, COARSE_PLACES + 2)[1:-1].astype(int)[: places.size]
        greatest = np.argsort(np.abs(self._free.left[block.at][places]))[-GREATEST_INNOVATIONS:]
        return [int(i) for i in np.unique(places[[*even, *greatest]])]

    def _near(self, place: Place, others: Sequence[Place]) -> list[Place]:
        """Where a jump may be moved to from a place of the coarse grid, not too near to others."""
        block, at = place
        may = self._may_jump(block)
        for other, sample in others:
            if other is block:
                may[max(sample - LEAST_SAMPLES_BETWEEN + 1, 0) : sample + LEAST_SAMPLES_BETWEEN] = False
        reach = may.size // COARSE_PLACES + 1
        low = max(at - reach, 0)
        return [(block, low + int(i)) for i in np.flatnonzero(may[low : at + reach + 1])] or [place]

    def _refined(self, places: Sequence[Place], which: Iterable[int]) -> _Steps:
        """Jumps of which some, by their numbers, are moved to the samples where they explain most beside the others."""
        out = list(places)
        for k in which:
            others = [*out[:k], *out[k + 1 :]]
            near = _Steps(self._free, self._near(out[k], others))
            out[k] = near.places[int(np.argmax(near.gain_beside(_Steps(self._free, others))))]
        return _Steps(self._free, out)

    def _worth(self, jumps: _Steps) -> float:
        """Log Bayes factor of jumps whose places nobody knew beforehand."""
        information, axes = np.linalg.eigh(jumps.product(jumps))
        kept = information > 1e-9 * information[-1]
        k = len(jumps.places)
        known = log_bayes_factor((axes[:, kept].T @ jumps.along)[:, None], information[kept])[0]
        return float(known + gammaln(k + 1) - k * np.log(self.fitted.whitened.size))


class _Steps:
    """Steps of a standard deviation of the noise, whitened, less what a model absorbs, by their products alone.

    Each is in one block, so that their columns are never made whole.

    Parameters
    ----------
    free : FittedHypothesis
        The model.
    places : sequence of tuple of ChannelBlock and int

    Attributes
    ----------
    along : ndarray, shape (k,)
        Products with what the model leaves.
    """

    def __init__(self, free: FittedHypothesis, places: Sequence[Place]) -> None:
        self.places = tuple(places)
        self._precision = free.precision
        self._own: list[Floats] = []
        noise = dict(zip(free.blocks, free.noise, strict=True))
        for block, sample in places:
            step = np.where(np.arange(block.at.stop - block.at.start) >= sample, 1.0, 0.0)
            self._own.append(noise[block].whiten(step * channel_sd(free, block.channel)))
        pairs = list(zip(places, self._own, strict=True))
        self._shared = np.array([own @ free.jacobian[block.at] for (block, _), own in pairs])
        self.along = np.array([own @ free.left[block.at] for (block, _), own in pairs])

    def product(self, other: _Steps) -> Floats:
        """Scalar products with other steps, shape (k, l)."""
        out = np.zeros((len(self.places), len(other.places)))
        for i, (block, _) in enumerate(self.places):
            for j, (another, _) in enumerate(other.places):
                if block is another:
                    out[i, j] = self._own[i] @ other._own[j]
        return np.asarray(out - self._shared @ np.linalg.solve(self._precision, other._shared.T))

    def gain_beside(self, others: _Steps) -> Floats:
        """By how much each of them would raise the log likelihood beside others, shape (k,)."""
        blocks = np.array([own @ own for own in self._own])
        absorbed = np.linalg.solve(self._precision, self._shared.T)
        length, along = blocks - np.einsum("ij,ji->i", self._shared, absorbed), self.along
        if others.places:
            between = self.product(others)
            weight = np.linalg.solve(others.product(others), np.column_stack([between.T, others.along]))
            length = length - np.einsum("ij,ji->i", between, weight[:, :-1])
            along = along - between @ weight[:, -1]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(length > 1e-6 * blocks, 0.5 * along**2 / length, 0.0)
