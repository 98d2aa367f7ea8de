"""Coordinates in which the posterior of a model with effects is nearly normal.

What an effect does bends with its own few parameters, and the curves of the model give way to it. Where they go is
taken out: the model's parameters are measured from the place that is best for them, given those of the effects, by one
Gauss-Newton step from the mode.

Where the model misses something the curve itself is known so little that it bends, too: its tails with its place and
width, its levels with all of these. There each parameter is measured from the place that is best for it given those
before it, a triangular map [1]_: first the effects, then the model in its order, those by which the response is only
scaled last, as they can follow any others. All steps but one are then made from a few samples, which tell where
a smooth curve goes as well as all of them.

References
----------
.. [1] Y. Marzouk, T. Moselhy, M. Parno and A. Spantini, Sampling via measure transport: an introduction, in Handbook of
   Uncertainty Quantification (Springer, 2016), doi 10.1007/978-3-319-11259-6_23-1.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from sma_bayes.arrays import Bools, Floats, Ints
from sma_bayes.studies.gap.fitting import FittedHypothesis, held_at

SAMPLES_PER_PARAMETER = 5
"""Samples for each parameter that tell where a curve goes."""
SCALED_ONLY = 1e-6
"""Share of a response's second difference beside its slope, up to which a parameter only scales it."""


@dataclass(frozen=True, slots=True, eq=False)
class _Follower:
    """Sampled coordinates `at`, and where those that are `known` have them go: Gauss-Newton steps times residuals."""

    known: Ints
    at: Ints
    pull: Floats


@dataclass(frozen=True, eq=False)
class FollowingCoordinates:
    """Map ``u(z)``: each group of parameters less what it is moved by those before.

    The map is a shear: its Jacobian determinant is 1.

    Attributes
    ----------
    fitted : FittedHypothesis
        A hypothesis at its mode; without effects nothing moves.
    one_by_one : bool
        Whether each parameter is a group; else those of effects are one and the model's another. Only where noise has
        no memory and a few samples can be predicted without those between, as no effect with a memory lets them.
    """

    fitted: FittedHypothesis
    one_by_one: bool = False
    count: int = field(init=False)
    covariance: Floats = field(init=False, repr=False)
    _told_by: FittedHypothesis = field(init=False, repr=False)
    _followers: tuple[_Follower, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        hypothesis = self.fitted.hypothesis
        starts = [int(at[0]) for at in hypothesis.effect_positions.values()]
        count = int(
            np.sum(hypothesis.space.free_index < min(starts, default=len(hypothesis.space.parameters)))
        )
        set_(self, "count", count)
        few = few_samples(self.fitted) if self.one_by_one else None
        set_(self, "one_by_one", few is not None)
        set_(self, "_told_by", few or self.fitted)
        groups = list(self._groups())
        set_(self, "_followers", tuple(self._follower(groups[:i], groups[i:]) for i in range(1, len(groups))))
        set_(self, "covariance", self._covariance(groups))

    def _groups(self) -> Iterator[Ints]:
        """Parameters that follow those before, in order."""
        model, effects = np.split(np.arange(self.fitted.z.size), [self.count])
        if not self.one_by_one:
            yield from (group for group in (effects, model) if group.size)
            return
        scaling = scales_only(self._told_by)[model]
        yield from np.concatenate([effects, model[~scaling], model[scaling]])[:, None]

    def _follower(self, before: list[Ints], after: list[Ints]) -> _Follower:
        rest = np.concatenate(after)
        precision = self._told_by.precision[np.ix_(rest, rest)]
        pull = np.linalg.solve(precision, self._told_by.jacobian[:, rest].T)
        return _Follower(np.concatenate(before), after[0], np.asarray(pull[: after[0].size], dtype=float))

    def _covariance(self, groups: list[Ints]) -> Floats:
        """Of ``u`` at the mode, shape (D, D): nothing is left between groups."""
        out = np.zeros((self.fitted.z.size,) * 2)
        for i, group in enumerate(groups):
            rest = np.concatenate(groups[i:])
            own = np.linalg.inv(self.fitted.precision[np.ix_(rest, rest)])
            out[np.ix_(group, group)] = own[: group.size, : group.size]
        return out

    def forward(self, z: Floats) -> tuple[Floats, Floats, Bools]:
        """See `Coordinates.forward`."""
        out = np.array(z, dtype=float)
        for follower in self._followers:
            out[:, follower.at] = z[:, follower.at] - self._moved(follower, z)
        return _finite(out)

    def inverse(self, u: Floats) -> tuple[Floats, Floats, Bools]:
        """See `Coordinates.inverse`."""
        out = np.array(u, dtype=float)
        for follower in self._followers:
            out[:, follower.at] += self._moved(follower, out)
        return _finite(out)

    def _moved(self, follower: _Follower, z: Floats) -> Floats:
        """How far parameters go (W, k) for what is known of points (W, D)."""
        out = np.empty((len(z), follower.at.size))
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            for part in self._told_by.batches(len(z)):
                known = np.tile(self.fitted.z, (len(z[part]), 1))
                known[:, follower.known] = z[part][:, follower.known]
                out[part] = _change(self._told_by, known) @ follower.pull.T
        return out


def _finite(x: Floats) -> tuple[Floats, Floats, Bools]:
    fine = np.asarray(np.isfinite(x).all(axis=1))
    return np.where(fine[:, None], x, 0.0), np.zeros(len(x)), fine


def _change(fitted: FittedHypothesis, z: Floats) -> Floats:
    """Whitened residuals (W, N) at sampled coordinates (W, D), less those at the mode."""
    return np.asarray(fitted.whiten_residual(fitted.residual_at(z)) - fitted.whitened)


def few_samples(fitted: FittedHypothesis) -> FittedHypothesis | None:
    """The same hypothesis at the same parameters with every k-th sample only, each of which counts for k.

    None where noise has a memory, or a sample can't be predicted without those before it: at the mode, and one standard
    deviation off in all parameters.

    Parameters
    ----------
    fitted : FittedHypothesis
    """
    hypothesis = fitted.hypothesis
    every = max(1, fitted.whitened.size // (SAMPLES_PER_PARAMETER * fitted.z.size))
    kept = [np.arange(h.n) % every == 0 for h in hypothesis.histories]
    if any(n.memory.any() or n.switching is not None for n in fitted.noise):
        return None
    few = hypothesis.on(kept)
    noise = [
        replace(n.on(kept[b.history]), sd=n.sd / math.sqrt(every))
        for b, n in zip(fitted.blocks, fitted.noise, strict=True)
    ]
    told = held_at(few, fitted.z, tuple(noise))
    rows = np.concatenate([np.flatnonzero(kept[b.history]) + b.at.start for b in fitted.blocks])
    points = fitted.z + np.array([[0.0], [1.0]]) * np.sqrt(np.diag(fitted.covariance))
    whole, apart = fitted.residual_at(points)[:, rows], told.residual_at(points)
    return told if np.allclose(apart, whole, rtol=1e-9, atol=1e-9 * np.ptp(fitted.observed)) else None


def scales_only(fitted: FittedHypothesis) -> Bools:
    """Which parameters (D,) only scale what they do to the response, as levels do whatever their coordinates.

    Parameters
    ----------
    fitted : FittedHypothesis
    """
    step = np.diag(np.sqrt(np.diag(fitted.covariance)))
    bend = _change(fitted, fitted.z + step) + _change(fitted, fitted.z - step)
    slope = fitted.jacobian.T / np.maximum(np.linalg.norm(fitted.jacobian, axis=0), 1e-300)[:, None]
    beside = bend - np.sum(bend * slope, axis=1, keepdims=True) * slope
    size = np.linalg.norm(fitted.jacobian, axis=0) * np.diag(step)
    return np.asarray(np.linalg.norm(beside, axis=1) <= SCALED_ONLY * size)
