"""Proposals of the independence move: mixtures of Student t in coordinates where the posterior is nearly normal.

A proposal can be drawn from and its density evaluated anywhere, which is all that a Metropolis-Hastings step
and an importance estimate need. Coordinates decide how good it is, never whether it is right: the density
carries the Jacobian of the map, and a point that the map would not give back has no share in that part.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache
from typing import Protocol

import numpy as np
from scipy.special import gammaln

from sma_bayes.arrays import Bools, Floats, Ints

DEGREES_OF_FREEDOM = (5.0, 10.0, 20.0, 50.0)
"""What a fit of a single component chooses from: never so many that a tail is drawn no more."""
TAILS_FROM_SHARE = 0.6
"""Effective share of weighted draws from which they tell the degrees of freedom: below, they know little of tails."""


class Coordinates(Protocol):
    """Invertible map ``u(z)`` into coordinates in which a density is nearly normal."""

    def forward(self, z: Floats) -> tuple[Floats, Floats, Bools]:
        """Coordinates (W, D), ``ln |du/dz|`` (W,), and whether `inverse` gives `z` back (W,)."""
        ...

    def inverse(self, u: Floats) -> tuple[Floats, Floats, Bools]:
        """Points (W, D), ``ln |du/dz|`` there (W,), and whether a point was found (W,)."""
        ...


@dataclass(frozen=True, slots=True)
class PlainCoordinates:
    """``u = z``."""

    def forward(self, z: Floats) -> tuple[Floats, Floats, Bools]:
        return z, np.zeros(len(z)), np.ones(len(z), dtype=bool)

    def inverse(self, u: Floats) -> tuple[Floats, Floats, Bools]:
        return u, np.zeros(len(u)), np.ones(len(u), dtype=bool)


@dataclass(frozen=True, slots=True, eq=False)
class StudentMixture:
    """Mixture of multivariate Student t distributions.

    Attributes
    ----------
    weight : ndarray, shape (K,)
    mean : ndarray, shape (K, D)
    root : ndarray, shape (K, D, D)
        Lower Cholesky factors of the scale matrices.
    df : float
        Degrees of freedom of every component.
    """

    weight: Floats
    mean: Floats
    root: Floats
    df: float
    _whiten: Floats = field(init=False, repr=False)
    _log_scale: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        d, df = self.dimension, self.df
        whiten = np.swapaxes(np.linalg.inv(self.root), 1, 2)
        volume = np.log(np.einsum("kii->ki", self.root)).sum(axis=1)
        object.__setattr__(self, "_whiten", whiten)
        object.__setattr__(self, "_log_scale", np.log(self.weight) + _log_norm(df, d) - volume)

    @staticmethod
    def from_covariances(weight: Floats, mean: Floats, covariance: Floats, df: float) -> StudentMixture:
        """Mixture whose components have the given covariances, shape (K, D, D)."""
        roots = np.stack([_root(c * (df - 2.0) / df) for c in covariance])
        return StudentMixture(np.asarray(weight) / np.sum(weight), np.asarray(mean), roots, df)

    @staticmethod
    def about(
        x: Floats, components: int, covariance: Floats, df: float, rng: np.random.Generator
    ) -> StudentMixture:
        """Mixture of equal components of one covariance (D, D) about as many of some points, shape (W, D)."""
        means = x[rng.choice(len(x), size=components, replace=False)]
        return StudentMixture.from_covariances(
            np.ones(components), means, np.repeat(covariance[None], components, axis=0), df
        )

    @property
    def dimension(self) -> int:
        """D."""
        return int(self.mean.shape[1])

    @property
    def components(self) -> int:
        """K."""
        return int(self.weight.size)

    def draw(self, rng: np.random.Generator, size: int) -> Floats:
        """Draws, shape (size, D)."""
        normal = rng.standard_normal((size, self.dimension))
        normal *= np.sqrt(self.df / rng.chisquare(self.df, size))[:, None]
        if len(self.weight) == 1:
            return np.asarray(self.mean[0] + normal @ self.root[0].T)
        which = np.searchsorted(np.cumsum(self.weight)[:-1], rng.random(size), side="right")
        x = np.empty_like(normal)
        for k in range(len(self.weight)):
            mine = which == k
            x[mine] = self.mean[k] + normal[mine] @ self.root[k].T
        return x

    def _distances(self, x: Floats) -> Floats:
        """Squared distances (K, W) from the components' means, in their scales; infinite beyond all numbers."""
        out = np.empty((len(self.weight), len(x)))
        with np.errstate(over="ignore", invalid="ignore"):
            for k, mean in enumerate(self.mean):
                y = (x - mean) @ self._whiten[k]
                np.einsum("ij,ij->i", y, y, out=out[k])
        out[np.isnan(out)] = np.inf
        return out

    def _log_components(self, distances: Floats) -> Floats:
        """Log of weight times density of each component, shape (K, W)."""
        out = distances / self.df
        np.log1p(out, out=out)
        out *= -0.5 * (self.df + self.dimension)
        out += self._log_scale[:, None]
        return out

    def log_density(self, x: Floats) -> Floats:
        """Log density, shape (W,)."""
        return _log_sum(self._log_components(self._distances(x)))

    def _shares(self, distances: Floats) -> Floats:
        """Probability (K, W) that a point comes from each component; even where it is beyond the reach of all."""
        parts = self._log_components(distances)
        top = parts.max(axis=0)
        parts -= np.where(np.isfinite(top), top, 0.0)
        np.exp(parts, out=parts)
        parts[:, ~np.isfinite(top)] = 1.0
        parts /= parts.sum(axis=0)
        return parts

    def refitted(self, x: Floats, weight: Floats, *, rounds: int) -> StudentMixture:
        """Fit to weighted points by expectation-maximisation; components that lose their points are dropped.

        Parameters
        ----------
        x : ndarray, shape (W, D)
        weight : ndarray, shape (W,)
            Importance weights that sum to one.
        rounds : int
            Iterations.
        """
        if len(self.weight) == 1:
            return self._refitted_alone(x, weight, rounds)
        mixture = self
        for _ in range(rounds):
            distances = mixture._distances(x)
            share = mixture._shares(distances) * weight
            found = [mixture._moments(x, *each) for each in zip(share, distances, strict=True)]
            kept = [moments for moments in found if moments is not None]
            if not kept:
                return mixture
            totals, means, scales = zip(*kept, strict=True)
            w = np.array(totals)
            roots = np.stack([_root(scale) for scale in scales])
            mixture = StudentMixture(w / w.sum(), np.stack(means), roots, self.df)
        return mixture

    def _refitted_alone(self, x: Floats, weight: Floats, rounds: int) -> StudentMixture:
        """Fit of a single component, its degrees of freedom too (ECME; Liu and Rubin 1995, Statistica Sinica 5, 19)."""
        d, df = self.dimension, self.df
        effective = 1.0 / float(weight @ weight)
        if effective < 2.0 * d:
            return self
        mean = weight @ x
        centred = x - mean
        root, distance = self.root[0], self._distances(x)[0]
        for _ in range(rounds):
            if effective >= TAILS_FROM_SHARE * len(x):
                df = _likeliest_df(distance, weight, d)
            tail = (df + d) / (df + distance) * weight
            root = _root((centred * tail[:, None]).T @ centred)
            y = centred @ np.linalg.inv(root).T
            distance = np.einsum("ij,ij->i", y, y)
        return StudentMixture(self.weight, mean[None], root[None], df)

    def _moments(self, x: Floats, share: Floats, distance: Floats) -> tuple[float, Floats, Floats] | None:
        """Weight, mean and scale matrix of a component, from its shares (W,) of points at squared distances (W,).

        None if it has too few.
        """
        d, df = self.dimension, self.df
        total = float(share.sum())
        effective = total**2 / max(float(share @ share), 1e-300)
        if effective < 2.0 * d or total < 1e-3:
            return None
        mean = share @ x / total
        tail = (df + d) / (df + distance) * share
        centred = x - mean
        return total, mean, (centred * tail[:, None]).T @ centred / total


@dataclass(frozen=True, slots=True, eq=False)
class FactorisedMixture:
    """Independent mixtures for blocks of coordinates.

    Attributes
    ----------
    blocks : tuple of ndarray of int
        Coordinates of each block; together all of them, once.
    parts : tuple of StudentMixture
        One for each block.
    """

    blocks: tuple[Ints, ...]
    parts: tuple[StudentMixture, ...]

    @property
    def components(self) -> int:
        """Greatest number of components of a part."""
        return max(part.components for part in self.parts)

    def draw(self, rng: np.random.Generator, size: int) -> Floats:
        """Draws, shape (size, D)."""
        x = np.empty((size, sum(b.size for b in self.blocks)))
        for block, part in zip(self.blocks, self.parts, strict=True):
            x[:, block] = part.draw(rng, size)
        return x

    def log_density(self, x: Floats) -> Floats:
        """Log density, shape (W,)."""
        total = np.zeros(len(x))
        for block, part in zip(self.blocks, self.parts, strict=True):
            total += part.log_density(x[:, block])
        return total

    def refitted(self, x: Floats, weight: Floats, *, rounds: int) -> FactorisedMixture:
        """Fit each block to weighted points, shape (W, D)."""
        parts = tuple(
            part.refitted(x[:, block], weight, rounds=rounds)
            for block, part in zip(self.blocks, self.parts, strict=True)
        )
        return FactorisedMixture(self.blocks, parts)


Mixture = StudentMixture | FactorisedMixture


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """A t mixture in suitable coordinates, with a wide component in plain ones.

    The wide component keeps importance weights bounded where the density has tails that the narrow part lacks.

    Attributes
    ----------
    coordinates : Coordinates
    narrow : StudentMixture or FactorisedMixture
        In ``u``.
    wide : StudentMixture
        In ``z``.
    share : float
        Of the wide component.
    """

    coordinates: Coordinates
    narrow: Mixture
    wide: StudentMixture
    share: float = 0.05

    def draw(self, rng: np.random.Generator, size: int) -> tuple[Floats, Floats]:
        """Points (size, D) and their log density (size,); a point that could not be built has NaN coordinates."""
        return self.draw_with_coordinates(rng, size)[:2]

    def draw_with_coordinates(
        self, rng: np.random.Generator, size: int
    ) -> tuple[Floats, Floats, Floats, Bools]:
        """The same, with the coordinates (size, D) of the points and whether these lead back to them (size,)."""
        from_wide = rng.random(size) < self.share
        z_wide = self.wide.draw(rng, int(from_wide.sum()))
        u = self.narrow.draw(rng, size)
        z, log_jacobian, back = self.coordinates.inverse(u)
        found = back | from_wide
        if from_wide.any():
            z, log_jacobian, back = z.copy(), log_jacobian.copy(), back.copy()
            z[from_wide] = z_wide
            u[from_wide], log_jacobian[from_wide], back[from_wide] = self.coordinates.forward(z_wide)
        with np.errstate(invalid="ignore"):
            narrow = np.where(back, self.narrow.log_density(u) + log_jacobian, -np.inf)
        if found.all():
            return z, self._join(narrow, z), u, back
        z[~found] = np.nan
        log_q = np.full(size, -np.inf)
        log_q[found] = self._join(narrow[found], z[found])
        return z, log_q, u, back

    def log_density(self, z: Floats, at: tuple[Floats, Floats, Bools] | None = None) -> Floats:
        """Log density at any points, shape (W,); `at` is what its coordinates give there, where that is known."""
        u, log_jacobian, back = self.coordinates.forward(z) if at is None else at
        with np.errstate(invalid="ignore"):
            narrow = np.where(back, self.narrow.log_density(u) + log_jacobian, -np.inf)
        return self._join(narrow, z)

    def _join(self, narrow: Floats, z: Floats) -> Floats:
        return np.asarray(
            np.logaddexp(math.log1p(-self.share) + narrow, math.log(self.share) + self.wide.log_density(z))
        )


@dataclass(frozen=True, slots=True, eq=False)
class MixedProposal:
    """Several proposals, one for each mode of a density.

    Attributes
    ----------
    weight : ndarray, shape (K,)
    parts : tuple of Proposal
    """

    weight: Floats
    parts: tuple[Proposal, ...]

    def draw(self, rng: np.random.Generator, size: int) -> tuple[Floats, Floats]:
        """Points (size, D) and their log density (size,); see `Proposal.draw`."""
        which = np.searchsorted(np.cumsum(self.weight)[:-1], rng.random(size), side="right")
        z = np.empty((size, self.parts[0].wide.dimension))
        for k, part in enumerate(self.parts):
            mine = which == k
            z[mine] = part.draw(rng, int(mine.sum()))[0]
        found = np.isfinite(z).all(axis=1)
        log_q = np.full(size, -np.inf)
        log_q[found] = self.log_density(z[found])
        return z, log_q

    def log_density(self, z: Floats) -> Floats:
        """Log density at any points, shape (W,)."""
        mapped = {
            id(part.coordinates): part.coordinates for part in self.parts
        }  # several parts may share them
        at = {key: coordinates.forward(z) for key, coordinates in mapped.items()}
        parts = np.stack([part.log_density(z, at[id(part.coordinates)]) for part in self.parts])
        return _log_sum(parts + np.log(self.weight)[:, None])


class DrawSource(Protocol):
    """What importance draws come from, such as a `Proposal`."""

    def draw(self, rng: np.random.Generator, size: int) -> tuple[Floats, Floats]:
        """Points (size, D) and their log density (size,); minus infinity where no point could be built."""
        ...

    def log_density(self, z: Floats) -> Floats:
        """Log density at any points, shape (W,)."""
        ...


AnyProposal = Proposal | MixedProposal


@cache
def _log_norm(df: float, dimension: int) -> float:
    """Log of the density of a Student t at its centre, with a unit scale matrix."""
    return float(
        gammaln(0.5 * (df + dimension)) - gammaln(0.5 * df) - 0.5 * dimension * math.log(df * math.pi)
    )


def _likeliest_df(distance: Floats, weight: Floats, dimension: int) -> float:
    """Degrees of freedom under which weighted points at squared distances (W,) from the centre are the likeliest."""
    df = np.array(DEGREES_OF_FREEDOM)
    log_norm = np.array([_log_norm(each, dimension) for each in DEGREES_OF_FREEDOM])
    mean_log = np.log1p(distance / df[:, None]) @ weight
    return DEGREES_OF_FREEDOM[int(np.argmax(log_norm - 0.5 * (df + dimension) * mean_log))]


def _log_sum(parts: Floats) -> Floats:
    """Logarithm (W,) of the sum of exponentials of a few series (K, W), many times as fast as scipy's or logaddexp."""
    if len(parts) == 1:
        return np.asarray(parts[0])
    top = parts.max(axis=0)
    top[~np.isfinite(top)] = 0.0
    with np.errstate(divide="ignore"):
        return np.asarray(top + np.log(np.exp(parts - top).sum(axis=0)))


def _root(matrix: Floats) -> Floats:
    """Cholesky factor; a matrix that is not quite positive definite is lifted by its own scale."""
    try:
        return np.asarray(np.linalg.cholesky(matrix))
    except np.linalg.LinAlgError:
        pass
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    correlation = matrix / np.outer(scale, scale)
    for lift in (1e-12, 1e-9, 1e-6, 1e-3):
        try:
            return np.asarray(np.linalg.cholesky(correlation + lift * np.eye(len(matrix))) * scale[:, None])
        except np.linalg.LinAlgError:
            continue
    return np.diag(scale)
