"""What samplers of the benchmark are told, and what they hand over."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sma_bayes.arrays import Floats

GROUPS = 4
"""Independent ensembles or chains of every sampler."""


@dataclass(frozen=True, slots=True, eq=False)
class Progress:
    """How far a sampler got.

    Attributes
    ----------
    chains : ndarray, shape (G, S, W, D)
        Independent groups, steps, walkers (1 for samplers of single chains), sampled coordinates.
    evaluations : int
        Points at which the log-posterior was evaluated; gradients are counted by the sampler that uses them.
    discards : tuple of float
        Shares of the steps that may be dropped as burn-in; the best one counts.
    anew : bool
        Whether the sampler began anew to make more draws. Its last run counts alone: a user who knew how many draws
        it takes would have asked for so many at once.
    """

    chains: Floats
    evaluations: int
    discards: tuple[float, ...] = (0.1, 0.25, 0.5)
    anew: bool = False

    @staticmethod
    def none(dimension: int) -> Progress:
        """No draws at all."""
        return Progress(np.full((GROUPS, 0, 1, dimension), np.nan), 0)

    def cut(self, steps: int) -> Progress:
        """What there was after fewer steps."""
        share = steps / self.chains.shape[1]
        return Progress(self.chains[:, :steps], round(self.evaluations * share), self.discards, self.anew)


@dataclass(frozen=True, slots=True)
class Settings:
    """What ensembles of other samplers are given.

    Attributes
    ----------
    walkers : int
    start : str
        ``laplace`` or ``ball``; see `Problem.starts`.
    log_prob : str
        What samplers that ask for one point at a time call: ``written`` out for one point, or the ``package``'s
        log-posterior with a batch of one.
    """

    walkers: int = 100
    start: str = "laplace"
    log_prob: str = "written"
