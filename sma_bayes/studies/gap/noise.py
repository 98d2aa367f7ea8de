"""Noise of one channel of one history: an AR(1) series, in sample index or in time, whose innovations may be scaled."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.linalg import solve_banded
from scipy.special import ndtri

from sma_bayes.arrays import Floats
from sma_bayes.noise.ar1 import memory_innovations, memory_log_scale, memory_series
from sma_bayes.normal import MAD_TO_SD
from sma_bayes.records.history import starts
from sma_bayes.studies.gap.hypothesis import Hypothesis
from sma_bayes.studies.gap.switching import Scatter

CORRELATION_GRID = np.concatenate([[-0.6, -0.3, -0.15], np.tanh(np.linspace(0.0, 2.65, 28))])
"""Correlations of neighbouring samples that are tried."""
MAX_MEMORY_SWEEPS, MAX_MEMORY_SHARE_OF_RECORD = 1.5, 0.75
"""Sweeps, and share of an uninterrupted record, that may count as one sample under chance: what remembers for longer is
a wave that wants an explanation. Of one cycle they are the same; several cycles tell by their likelihood how long noise
remembers."""


@dataclass(frozen=True, slots=True, eq=False)
class ChannelBlock:
    """One channel of one history: where it is in the stacked vectors, and how its samples follow each other.

    Attributes
    ----------
    history : int
    channel : str
    at : slice
        Place in vectors over all samples of all blocks.
    first : ndarray of bool, shape (n,)
        Samples that remember nothing.
    dt : ndarray, shape (n,)
        Time since the sample before, in medians; 1 where time was not recorded.
    sweep : float
        Samples of its usual sweep.
    """

    history: int
    channel: str
    at: slice
    first: NDArray[np.bool_]
    dt: Floats
    sweep: float = np.inf

    @property
    def uneven(self) -> bool:
        """Whether steps of time differ, so that memory may be one in time or by sample."""
        steps = self.dt[~self.first]
        return bool(steps.size > 2 and np.std(steps) > 0.05 * np.mean(steps))

    @property
    def possible(self) -> NDArray[np.bool_]:
        """Which of `CORRELATION_GRID` chance may have.

        At most `MAX_MEMORY_SWEEPS` sweeps or `MAX_MEMORY_SHARE_OF_RECORD` count as one sample.
        """
        whole = self.first.size / max(int(self.first.sum()), 1)
        return np.asarray(
            samples_as_one(CORRELATION_GRID)
            <= max(MAX_MEMORY_SWEEPS * self.sweep, MAX_MEMORY_SHARE_OF_RECORD * whole)
        )


@dataclass(frozen=True, slots=True, eq=False)
class BlockNoise:
    """Noise of a block.

    Attributes
    ----------
    sd : float
        Of the series [unit of the channel].
    memory : ndarray, shape (n,)
        Correlation with the sample before; 0 where nothing precedes.
    scale : ndarray, shape (n,), or float
        Of each innovation, over the usual one: where their size grows with the response, and where what passes for
        heavy tails is a misfit.
    excess : ndarray, shape (n,), or float
        What heavy tails leave out of account of each residual [unit of the channel]; see `HeavyTails`.
    tails : ndarray, shape (n,), or float
        What of `scale` stands for heavy tails that may be a misfit.
    others : tuple of (float, BlockNoise)
        What it may be by chance, with probabilities from the restricted likelihood that add up to 1; itself included
        unless it remembers for too long, see `ChannelBlock.possible`.
    switching : Scatter or None
        Scatter of the instants at which a current was switched, on top of it.
    """

    sd: float
    memory: Floats
    scale: Floats | float = 1.0
    others: tuple[tuple[float, BlockNoise], ...] = ()
    switching: Scatter | None = None
    excess: Floats | float = 0.0
    tails: Floats | float = 1.0

    def whiten(self, x: Floats) -> Floats:
        """Series (..., n) as innovations of unit variance."""
        out = memory_innovations(x / self.sd, self.memory, self.scale)
        return np.asarray(out if self.switching is None else self.switching.whiten(out))

    def whiten_residual(self, residual: Floats) -> Floats:
        """Residuals (..., n) of a model as innovations of unit variance, without their excess."""
        return self.whiten(residual - self.excess)

    @property
    def heavy(self) -> bool:
        """Whether it has heavy tails."""
        return bool(np.any(self.excess) or np.any(np.asarray(self.tails) != 1.0))

    def whole(self, residual: Floats) -> Floats:
        """Residuals (n,) of a model as innovations whose size says how far off each is, however heavy the tails.

        What counts of an innovation in heavy tails falls again with its size, so that a misfit of few readings counts
        the less the greater it is. Of the size of these only the rank is taken: as a normal deviate, whose sign is that
        of the innovation [1]_.

        References
        ----------
        .. [1] Normal scores: B. L. van der Waerden, Indag. Math. 14 (1952) 453.
        """
        u = self.whiten(residual) * self.tails
        return np.asarray(np.sign(u) * ndtri(0.5 + 0.5 * stats.rankdata(np.abs(u)) / (u.size + 1.0)))

    def as_likely(self, innovations: Floats, rng: np.random.Generator) -> Floats:
        """Series (n, count) from innovations of unit variance, each with one of `others` drawn for it."""
        others = self.others or ((1.0, self),)
        which = rng.choice(len(others), size=innovations.shape[1], p=[p for p, _ in others])
        memory = np.stack([o.memory for _, o in others], axis=1)[:, which]
        sd = np.array([o.sd for _, o in others])[which]
        out = memory_series(innovations.T, memory.T, self.scale).T * sd
        return np.asarray(out if self.switching is None else out + self.switching.drawn(rng, out.shape[1]))

    def spread(self, columns: Floats) -> Floats:
        """Columns (n, k) so that products of what is returned are those with the covariance in between, shape (n, k).

        Of scales of innovations and of switching nothing is seen.
        """
        ahead = np.zeros((2, self.memory.size))
        ahead[0, 1:], ahead[1] = -self.memory[1:], 1.0
        size = self.sd * np.sqrt(1.0 - self.memory**2)
        return np.asarray(size[:, None] * solve_banded((0, 1), ahead, columns))

    @property
    def log_scale(self) -> float:
        """Sum over samples of the logarithm of the scale of an innovation."""
        widths = np.log(np.broadcast_to(self.scale, self.memory.shape))
        own = self.memory.size * np.log(self.sd) + memory_log_scale(self.memory).sum() + widths.sum()
        return float(own) + (0.0 if self.switching is None else self.switching.log_scale)

    def on(self, kept: NDArray[np.bool_]) -> BlockNoise:
        """The same noise of samples for which a mask is true; without memory where the one before is not kept."""
        together = np.concatenate([[False], kept[:-1]])[kept]
        some = BlockNoise(
            self.sd,
            np.where(together, self.memory[kept], 0.0),
            _on(self.scale, kept),
            excess=_on(self.excess, kept),
            tails=_on(self.tails, kept),
        )
        if self.switching is None:
            return some
        courses = self.switching.courses[kept]
        return replace(some, switching=Scatter.of(self.switching.size, courses, some.whiten))


def _on(values: Floats | float, kept: NDArray[np.bool_]) -> Floats | float:
    """Those of the samples for which a mask is true, of values of each sample or of all."""
    return values if np.ndim(values) == 0 else np.asarray(values)[kept]


Noise = tuple[BlockNoise, ...]


def blocks_of(hypothesis: Hypothesis) -> tuple[ChannelBlock, ...]:
    """Every channel of every history, stacked."""
    out, at = [], 0
    for i, history in enumerate(hypothesis.histories):
        first = starts(history.inputs)
        dt = np.ones(history.n)
        if "time" in history.inputs:
            dt[1:] = np.maximum(np.diff(history.inputs["time"]), 0.0)
            usual = float(np.median(dt[~first])) if (~first).any() else 1.0
            dt = dt / max(usual, 1e-300)
        sweep = float(np.median(np.unique(history.inputs["segment"], return_counts=True)[1]))
        for channel in hypothesis.channels:
            out.append(ChannelBlock(i, channel, slice(at, at + history.n), first, dt, sweep))
            at += history.n
    return tuple(out)


def whiten(blocks: Sequence[ChannelBlock], noise: Noise, series: Floats) -> Floats:
    """Stacked series (..., N) as innovations of unit variance."""
    return _by_block(BlockNoise.whiten, blocks, noise, series)


def whiten_residual(blocks: Sequence[ChannelBlock], noise: Noise, residual: Floats) -> Floats:
    """Stacked residuals (..., N) of a model as innovations of unit variance, without their excess."""
    return _by_block(BlockNoise.whiten_residual, blocks, noise, residual)


def _by_block(
    whitened: Callable[[BlockNoise, Floats], Floats],
    blocks: Sequence[ChannelBlock],
    noise: Noise,
    series: Floats,
) -> Floats:
    out = np.empty_like(series)
    for block, own in zip(blocks, noise, strict=True):
        out[..., block.at] = whitened(own, series[..., block.at])
    return out


def scatter(residual: Floats, block: ChannelBlock) -> float:
    """Standard deviation from reading to reading: of differences of neighbours over the square root of 2.

    By the median, so that jumps and outliers don't count. For white noise it is the standard deviation; what changes
    slowly isn't in it.

    Parameters
    ----------
    residual : ndarray, shape (n,)
    block : ChannelBlock
    """
    steps = np.diff(residual)[~block.first[1:]]
    return float(MAD_TO_SD * np.median(np.abs(steps)) / np.sqrt(2.0)) if steps.size else 0.0


def samples_as_one(memory: Floats) -> Floats:
    """How many samples count as one for the mean, as noise remembers."""
    return np.asarray((1.0 + memory) / (1.0 - memory))
