"""What each sweep of a record has of its own beside the curve that all share.

Sweeps of one record need not repeat each other: training, a grip that slips, an ambient that drifts. What a sweep has
of its own is a small change of the parameters of its curve, along their tangents, independent from sweep to sweep
(`SweepFunctions`). Its size is a parameter. The curve is that of the mean over sweeps, as sure as so many of them make
it: functions that the curve's own shape does not consist of would leave it as sure as all readings, by what it has and
they have not.

A new reading is one of a new sweep. Sweeps need not scatter alike in offset, stroke, midpoint and rate, as a single
size has it, and new ones scatter as the measured ones were found to. Their covariance is inverse Wishart a priori, as
if n = 3 (`PRIOR_SWEEPS`) sweeps more were of the one size in all functions; given the own weights w of S measured ones,

    new ~ t_v(0, (n between**2 + sum of w w')/v),    v = S - 1 + n.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from sma_bayes.arrays import Floats, Ints

MAX_SWEEPS = 48
"""Sweeps of a record, at most, that may have something of their own."""
NEGLIGIBLE_SENSITIVITY = 1e-6
"""Part of the greatest of what changes of the parameters do to the curve that is rounding."""
LEAST_SEEN_SHARE = 0.1
"""Root mean square that a change of the curve has where samples are, over that which it has anywhere, from which they
see it. A transition between two readings is no place that they tell anything of; functions that are scaled by what
readings see of it would be as many times too large between them."""
PRIOR_SWEEPS = 3
"""Sweeps of the one size that count as seen a priori. Beside two measured ones a new one, or the mean of all, then has
four degrees of freedom, beside three five: variances that are finite, and can be estimated from draws."""
SWEEP = "sweep"
"""Input of a part of a record: the segment of the whole one that each sample is from."""


@dataclass(frozen=True, eq=False)
class SweepFunctions:
    """What a sweep may have of its own, in one channel of one record: changes of offset, stroke, midpoint, rate.

    Orthogonal combinations of the tangents of the curve, all of one size.

    Attributes
    ----------
    temperature : ndarray, shape (G,)
        Nodes, ascending.
    values : ndarray, shape (G, q)
        Functions there; natural cubic splines through them.
    samples : ndarray, shape (q, n)
        Functions at the samples of the record, of a mean square over them that is one for all together.
    sweep : ndarray of int, shape (n,)
        Which sweep each sample belongs to, from 0.
    change : ndarray, shape (p, q), or None
        Change of the curve's parameters along which each function is; None where they are known by their values alone.
    sum_to_zero : bool
        Whether what the sweeps have of their own sums to zero: then the curve is that of the sweeps that were measured.
    """

    temperature: Floats
    values: Floats
    samples: Floats
    sweep: Ints
    change: Floats | None = None
    sum_to_zero: bool = False

    @staticmethod
    def of(
        inputs: Mapping[str, Floats], nodes: Floats, tangents: Floats, tangents_at_nodes: Floats
    ) -> SweepFunctions | None:
        """Those of samples of 2 to `MAX_SWEEPS` sweeps; None of others, and where no parameter does anything.

        Parameters
        ----------
        inputs : mapping of str to ndarray, shape (n,)
            Of the samples.
        nodes : ndarray, shape (G,)
            Temperatures, ascending.
        tangents, tangents_at_nodes : ndarray, shape (n, p) and (G, p)
            Derivatives of the response with respect to the parameters of the curve, at samples and nodes.
        """
        if not 2 <= int(sweeps_of(inputs).max(initial=0)) + 1 <= MAX_SWEEPS:
            return None
        seen = seen_changes(inputs["temperature"], nodes, tangents, tangents_at_nodes)
        _, singular, axes = np.linalg.svd(seen.at_samples, full_matrices=False)
        kept = singular > NEGLIGIBLE_SENSITIVITY * singular.max(initial=0.0)
        if not kept.any():
            return None
        turned_by = axes[kept].T / singular[kept] * np.sqrt(len(tangents) / kept.sum())
        found = SweepFunctions.tabulated(nodes, seen.at_nodes @ turned_by, inputs)
        return replace(found, change=seen.change @ turned_by)

    @staticmethod
    def tabulated(nodes: Floats, values: Floats, inputs: Mapping[str, Floats]) -> SweepFunctions:
        """Functions from their values (G, q) at nodes (G,), for samples with these inputs."""
        no_samples = SweepFunctions(nodes, values, np.empty((0, 0)), np.empty(0, dtype=np.int64))
        at_samples = np.ascontiguousarray(no_samples.at(inputs["temperature"]).T)
        return SweepFunctions(nodes, values, at_samples, sweeps_of(inputs))

    @cached_property
    def parts(self) -> tuple[slice, ...]:
        """Samples of each sweep, which follow each other."""
        starts = np.flatnonzero(np.diff(self.sweep, prepend=-1))
        return tuple(map(slice, starts.tolist(), [*starts[1:].tolist(), self.sweep.size]))

    def part(self, samples: slice) -> SweepFunctions:
        """Those of the samples of one sweep."""
        sweep = np.zeros(samples.stop - samples.start, dtype=np.int64)
        return SweepFunctions(self.temperature, self.values, self.samples[:, samples], sweep)

    @cached_property
    def rows(self) -> Floats:
        """Functions of each sweep, zero in the others, shape (sweeps q, n)."""
        inside = np.arange(int(self.sweep.max()) + 1)[:, None, None] == self.sweep
        return np.ascontiguousarray((inside * self.samples).reshape(-1, self.sweep.size))

    @cached_property
    def _spline(self) -> CubicSpline:
        return CubicSpline(self.temperature, self.values, bc_type="natural")

    def at(self, temperature: Floats) -> Floats:
        """Functions, shape (..., q), at temperatures of any shape; as at the nearest node beyond these."""
        return np.asarray(self._spline(np.clip(temperature, self.temperature[0], self.temperature[-1])))

    def of_new_sweep(
        self, rng: np.random.Generator, weights: Floats, size: Floats, temperature: Floats
    ) -> Floats:
        """What new sweeps have of their own at temperatures (g,) or (W, g); shape (W, g).

        Each reading is of another sweep.

        Parameters
        ----------
        rng : numpy.random.Generator
        weights : ndarray, shape (W, S, q)
            Of the measured sweeps, drawn given the measurements.
        size : ndarray, shape (W,)
            Their standard deviation in all functions together.
        temperature : ndarray, shape (g,) or (W, g)
        """
        functions, degrees = self.at(temperature), degrees_of_freedom(weights.shape[1])
        squares = sums_of_squares(_apart(weights), size)
        variance = np.sum((functions @ squares) * functions, axis=-1)
        normal, spread = rng.standard_normal(variance.shape), rng.chisquare(degrees, variance.shape)
        return np.asarray(np.sqrt(variance / spread) * normal)


def covariance_of_sweeps(weights: Floats, size: Floats) -> Floats:
    """Expected covariance (q, q) of a new sweep's weights, with which the mean of all sweeps scatters as well.

    Parameters
    ----------
    weights : ndarray, shape (W, S, q)
        Of the measured sweeps, drawn given the measurements; only how they differ from their mean counts.
    size : ndarray, shape (W,)
        Their standard deviation in all functions together.
    """
    degrees = degrees_of_freedom(weights.shape[1])
    return np.asarray(sums_of_squares(_apart(weights), size).mean(axis=0) / (degrees - 2.0))


def sums_of_squares(weights: Floats, size: Floats) -> Floats:
    """Scale (W, q, q) of the inverse Wishart distribution of the covariance between sweeps.

    Parameters
    ----------
    weights : ndarray, shape (W, S, q)
        Of the measured sweeps, less their mean.
    size : ndarray, shape (W,)
        Their standard deviation in all functions together.
    """
    seen_before = PRIOR_SWEEPS * size[:, None, None] ** 2 * np.eye(weights.shape[2])
    return np.asarray(np.swapaxes(weights, 1, 2) @ weights + seen_before)


def degrees_of_freedom(sweeps: int) -> float:
    """Those with which a new sweep beside so many, and their mean, are known."""
    return sweeps - 1.0 + PRIOR_SWEEPS


def _apart(weights: Floats) -> Floats:
    """Weights (W, S, q) less their mean over the sweeps."""
    return np.asarray(weights - weights.mean(axis=1, keepdims=True))


class SeenChanges(NamedTuple):
    """Changes of the parameters of a curve that the samples see, and what each does to the curve.

    Attributes
    ----------
    change : ndarray, shape (p, k)
        Of the parameters, each in units in which the greatest derivative is one; zero for those whose derivatives
        overflow. All parameters where samples see all; orthogonal to what they don't see.
    at_samples, at_nodes : ndarray, shape (n, k) and (G, k)
        What they do.
    """

    change: Floats
    at_samples: Floats
    at_nodes: Floats


def seen_changes(
    temperature: Floats, nodes: Floats, tangents: Floats, tangents_at_nodes: Floats
) -> SeenChanges:
    """Changes of the parameters of a curve that are seen where it was measured; see `LEAST_SEEN_SHARE`.

    Each parameter by itself may be seen where a change of several is not: one reading in a transition tells of midpoint
    and rate together, and nothing of what turns the curve about that reading. Of samples that are nearest to the same
    node one counts, so that thousands on a plateau do not outweigh the few in a transition.

    Parameters
    ----------
    temperature : ndarray, shape (n,)
        Of the samples.
    nodes : ndarray, shape (G,)
        Temperatures, ascending, over the range of the samples.
    tangents, tangents_at_nodes : ndarray, shape (n, p) and (G, p)
        Derivatives of the response with respect to the parameters, at samples and nodes.
    """
    greatest = np.abs(tangents_at_nodes).max(axis=0)
    usable = np.isfinite(tangents).all(axis=0) & np.isfinite(greatest) & (greatest > 0.0)
    scale = greatest[usable]
    _, sizes, axes = np.linalg.svd(tangents_at_nodes[:, usable] / scale, full_matrices=False)
    told_apart = sizes > NEGLIGIBLE_SENSITIVITY * sizes.max(initial=0.0)
    of_size_one = axes[told_apart].T / sizes[told_apart] * np.sqrt(nodes.size)
    middles = 0.5 * (nodes[1:] + nodes[:-1])
    one_of_each = np.unique(np.searchsorted(middles, temperature), return_index=True)[1]
    here = (tangents[one_of_each][:, usable] / scale) @ of_size_one / np.sqrt(one_of_each.size)
    mean_square, turned_by = np.linalg.eigh(here.T @ here)
    unseen = of_size_one @ turned_by[:, mean_square <= LEAST_SEEN_SHARE**2]
    unseen = np.concatenate([unseen, axes[~told_apart].T], axis=1)
    others = np.linalg.qr(unseen, mode="complete")[0][:, unseen.shape[1] :]
    change = np.zeros((usable.size, others.shape[1]))
    change[usable] = others / scale[:, None]
    return SeenChanges(
        change, tangents[:, usable] @ change[usable], tangents_at_nodes[:, usable] @ change[usable]
    )


def sweeps_of(inputs: Mapping[str, Floats]) -> Ints:
    """Which sweep each sample belongs to, shape (n,), from 0 without gaps."""
    number = inputs[SWEEP] if SWEEP in inputs else inputs["segment"]
    return np.asarray(np.unique(number, return_inverse=True)[1], dtype=np.int64).reshape(-1)
