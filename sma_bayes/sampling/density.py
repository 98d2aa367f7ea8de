"""What is sampled: any density, and what one may know of itself.

A `Density` need only have names and values, and points where to begin. What else it knows saves evaluations, never
decides what is drawn:

- a `Shaped` one names coordinates for proposals, and says in which of them it is nearly normal;
- a `Linearisable` one is the posterior of parameters whose response can be linearised at any point. `Linearised` there
  it says how wide it is, and in which coordinates it is nearly normal;
- a `Factorisable` one may be the product of densities of some of its coordinates each, which are sampled apart.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from sma_bayes.arrays import Floats, Ints
from sma_bayes.sampling.proposals import Coordinates, DrawSource, Mixture
from sma_bayes.sampling.shape import NormalShape


class Density(Protocol):
    """An unnormalised density that ensembles can sample."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        ...

    def log_prob(self, z: Floats) -> Floats:
        """Log of the density at each row of `z` (W, D); never NaN."""
        ...

    def draw_prior(self, rng: np.random.Generator, size: int) -> Floats:
        """Dispersed points (size, D): draws from a distribution wider than the density."""
        ...


@runtime_checkable
class Shaped(Density, Protocol):
    """A density that knows its shape."""

    def shape(self) -> NormalShape:
        """Coordinates for proposals, and what is known of the density in them."""
        ...


class Linearised(ABC):
    """A density about a point, its response linearised there.

    Attributes
    ----------
    z : ndarray, shape (D,)
        The point.
    """

    z: Floats

    @abstractmethod
    def information(self) -> Floats:
        """Information of data and prior (D, D): the inverse of the covariance, were the density normal."""
        ...

    @abstractmethod
    def proposals(
        self, covariance: Floats, rng: np.random.Generator
    ) -> Iterator[tuple[Coordinates, Mixture]]:
        """Coordinates in which the density is nearly normal, those that cost least first, with a mixture in each.

        Parameters
        ----------
        covariance : ndarray, shape (D, D)
            Of the density about the point, as far as it is known.
        rng : numpy.random.Generator
        """
        ...

    def coordinates_over(self, z: Floats) -> Coordinates | None:
        """Coordinates for draws (N, D) that reach farther than those of `proposals`; None where there are no others."""
        return None

    def prior_proposal(self, covariance: Floats) -> DrawSource | None:
        """The prior, but for parameters that any data determine; None where it can't be drawn from.

        It is what the density is like where data tell little. For the others it is about the point, with their part of
        the covariance (D, D).
        """
        return None


@runtime_checkable
class Linearisable(Density, Protocol):
    """A density whose response can be linearised."""

    def linearised(self, z: Floats) -> Linearised:
        """The density linearised at a point (D,)."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class DensityFactor:
    """A density of some coordinates, one of those whose product a density is.

    Attributes
    ----------
    name : str
        For people and files.
    density : Density
    at : ndarray of int
        Its coordinates among those of the product, in order.
    """

    name: str
    density: Density
    at: Ints


@runtime_checkable
class Factorisable(Density, Protocol):
    """A density that may be a product."""

    def factors(self) -> tuple[DensityFactor, ...]:
        """Densities whose product it is, but for a constant; none where it is no product that is known."""
        ...


def linearised_at(density: Density, z: Floats) -> Linearised | None:
    """A density linearised at a point (D,), if it can be."""
    return density.linearised(z) if isinstance(density, Linearisable) else None


def shape_of(density: Density, covariance: Floats) -> NormalShape:
    """What a density says of its shape; if nothing, all of it may be bent, with the covariance (D, D) of its mode."""
    return density.shape() if isinstance(density, Shaped) else NormalShape.unknown(covariance)
