"""Where a density is nearly normal and where it may be bent, and a first mixture for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sma_bayes.arrays import Floats, Ints
from sma_bayes.sampling.proposals import Coordinates, FactorisedMixture, PlainCoordinates, StudentMixture

NARROW_DF = 10.0
"""Degrees of freedom of the narrow components."""


@dataclass(frozen=True, slots=True, eq=False)
class NormalShape:
    """Where and how a density is nearly normal.

    Attributes
    ----------
    coordinates : Coordinates
    covariance : ndarray, shape (D, D)
        In these coordinates, at the mode.
    bent : int
        How many coordinates, the last ones, may be far from normal; they are independent of the others.
    """

    coordinates: Coordinates
    covariance: Floats
    bent: int

    @staticmethod
    def unknown(covariance: Floats) -> NormalShape:
        """That of a density with a covariance (D, D), all of which may be bent."""
        return NormalShape(PlainCoordinates(), covariance, len(covariance))

    def blocks(self) -> tuple[Ints, ...]:
        """Coordinates that belong together: those that are nearly normal, if any, and the bent ones."""
        d = len(self.covariance)
        both = (np.arange(d - self.bent), np.arange(d - self.bent, d))
        return tuple(block for block in both if block.size)

    def mixture(self, centre: Floats, bends: Sequence[StudentMixture]) -> FactorisedMixture:
        """One component about a centre (D,) where the density is nearly normal, then what is given for the bends."""
        blocks = self.blocks()
        normal = [
            one_component(centre[b], self.covariance[np.ix_(b, b)]) for b in blocks[: -len(bends) or None]
        ]
        return FactorisedMixture(blocks, (*normal, *bends))


def one_component(centre: Floats, covariance: Floats) -> StudentMixture:
    """Student t with a centre (D,) and a covariance (D, D)."""
    return StudentMixture.from_covariances(np.ones(1), centre[None], covariance[None], NARROW_DF)


def spread(mixture: StudentMixture, rng: np.random.Generator, count: int) -> StudentMixture:
    """Several components drawn from one, so that a fit can bend around a curved density."""
    means = mixture.draw(rng, count)
    return StudentMixture(
        np.full(count, 1.0 / count), means, np.repeat(mixture.root[:1], count, axis=0), mixture.df
    )
