"""Modes of a density and their Laplace approximation, by Newton steps on batched finite differences.

One iteration evaluates the density at ``2 D + D (D - 1)`` points in one batch, which gives gradient and
Hessian for any density without derivatives of its parts. A density that has them says how wide it is where the climb
begins, so that the first differences are of the right length: from a good start one step is then enough.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TypeAlias, TypeVar

import numpy as np

from sma_bayes.arrays import Floats, Ints
from sma_bayes.sampling.density import Density, Linearised, linearised_at

DIFFERENCE_STEP = 0.1
"""Steps of differences, in standard deviations along the axes of the covariance found so far."""
LEAST_SD, GREATEST_SD = 1e-5, 3.0
"""Least and greatest standard deviation along any direction, in widths."""
CLIMB_TOLERANCE = 5e-3
"""Of the log density that a climb may leave: what the last step had promised, or what it did not keep."""
SD_TOLERANCE, GAIN_SD_TOLERANCE = 0.5, 0.05
"""Relative change of standard deviations from step to step with which a climb may end, and with which what a step gains
against its promise tells how much is left. On a bend the two may agree by chance."""
NEGLIGIBLE_LOG_MASS = 20.0
"""A mode whose mass is lower than that of the best one by this power of e is left out."""

_Result = TypeVar("_Result")
_Asking: TypeAlias = Generator[Floats, Floats, _Result]
"""What yields points (W, D) to be evaluated and is sent their log density (W,)."""


@dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """A local maximum.

    Attributes
    ----------
    z : ndarray, shape (D,)
    log_prob : float
    covariance : ndarray, shape (D, D)
        Inverse of the negative Hessian, floored so that no direction is wider than the prior.
    evaluations : int
    """

    z: Floats
    log_prob: float
    covariance: Floats
    evaluations: int

    @property
    def mass(self) -> float:
        """Log of what the approximation integrates to, but for a constant."""
        return self.log_prob + 0.5 * float(np.linalg.slogdet(self.covariance)[1])

    @property
    def ln_integral(self) -> float:
        """Log of what the approximation integrates to: Laplace's evidence."""
        return self.mass + 0.5 * self.z.size * float(np.log(2.0 * np.pi))


def distinct_modes(modes: Sequence[Mode]) -> tuple[Mode, ...]:
    """Modes that are apart and not without mass, best first."""
    kept: list[Mode] = []
    for mode in sorted(modes, key=lambda m: m.mass, reverse=True):
        apart = (np.linalg.solve(m.covariance, mode.z - m.z) @ (mode.z - m.z) for m in kept)
        if not kept or (mode.mass > kept[0].mass - NEGLIGIBLE_LOG_MASS and all(d > 1.0 for d in apart)):
            kept.append(mode)
    return tuple(kept)


def find_mode(density: Density, start: Floats, width: Floats, *, steps: int = 40) -> Mode | None:
    """Climb to the mode nearest to a start.

    Parameters
    ----------
    density : Density
    start : ndarray, shape (D,)
    width : ndarray, shape (D,)
        Greatest plausible standard deviation in each coordinate, such as that of the prior.
    steps : int
        Greatest number of Newton steps.

    Returns
    -------
    Mode or None
        None if the density is zero at the start.
    """
    return find_modes(density, [start], width, steps=steps)[0]


def find_modes(
    density: Density, starts: Sequence[Floats], width: Floats, *, steps: int = 40
) -> list[Mode | None]:
    """Climb to the modes nearest to several starts, all at once: a batch has what each climb asks for next.

    Parameters
    ----------
    density : Density
    starts : sequence of ndarray, each of shape (D,)
    width : ndarray, shape (D,)
    steps : int
        Of each climb; see `find_mode`.

    Returns
    -------
    list of Mode or None
        For each start; None where the density is zero there.
    """
    climbs = [_climb(density, start, width, steps) for start in starts]
    modes: list[Mode | None] = [None] * len(climbs)
    asked = {k: next(climb) for k, climb in enumerate(climbs)}
    while asked:
        ends = np.cumsum([len(points) for points in asked.values()])
        values = np.split(density.log_prob(np.concatenate(list(asked.values()))), ends[:-1])
        for k, value in zip(tuple(asked), values, strict=True):
            try:
                asked[k] = climbs[k].send(value)
            except StopIteration as end:
                modes[k] = end.value
                del asked[k]
    return modes


def _climb(density: Density, start: Floats, width: Floats, steps: int) -> _Asking[Mode | None]:
    """Climb to a mode: yields points (W, D), is sent their log density (W,), and returns the mode."""
    z = start.astype(float).copy()
    evaluations = 0
    linearised = linearised_at(density, z)
    covariance = np.diag(width**2) if linearised is None else _covariance(linearised, width)
    before, along = _spread(covariance, width)
    for _ in range(steps):
        axes = along * np.minimum(before, 1.0)
        value, gradient, curvature, count = yield from _differences(z, DIFFERENCE_STEP * axes)
        if not np.isfinite(value):  # at the start: no step goes where the density is zero
            return None
        gradient, curvature = gradient / DIFFERENCE_STEP, curvature / DIFFERENCE_STEP**2
        root = axes @ _inverse_root(curvature)
        spread, along = _spread(root @ root.T, width)
        root = along * spread
        covariance = root @ root.T
        slope = np.linalg.solve(axes, root).T @ gradient
        lengths = 0.5 ** np.arange(10)
        trial = yield z + lengths[:, None] * (root @ slope)
        evaluations += count + lengths.size
        best = int(np.argmax(trial))
        gain = max(float(trial[best]) - value, 0.0)
        if gain > 0.0:
            z = z + lengths[best] * (root @ slope)
            value = float(trial[best])
        with np.errstate(over="ignore"):  # of a density that is all but a step there is no end of promises
            promised = 0.5 * float(slope @ slope)
        changed = float(np.max(np.abs(spread / before - 1.0)))
        left = abs(promised - gain) if changed < GAIN_SD_TOLERANCE else promised
        if changed < SD_TOLERANCE and left < CLIMB_TOLERANCE:
            break
        before = spread
    return Mode(z, value, 0.5 * (covariance + covariance.T), evaluations)


def _covariance(linearised: Linearised, width: Floats) -> Floats:
    """What the linearised response leaves uncertain; widths squared where it says nothing."""
    with np.errstate(all="ignore"):
        in_widths = linearised.information() * np.outer(width, width)
    if not np.isfinite(in_widths).all():
        return np.diag(width**2)
    # along a ridge it may be singular but for the prior, to within rounding
    root = width[:, None] * _inverse_root(in_widths)
    return np.asarray(root @ root.T)


def _spread(covariance: Floats, width: Floats) -> tuple[Floats, Floats]:
    """Standard deviations in widths along the axes of a covariance, within their bounds, and the axes (columns)."""
    scaled, vector = np.linalg.eigh(covariance / np.outer(width, width))
    return np.sqrt(np.clip(scaled, LEAST_SD**2, GREATEST_SD**2)), width[:, None] * vector


def _inverse_root(curvature: Floats) -> Floats:
    """Root ``R`` with ``R R' = |C|**-1`` of a symmetric matrix, its eigenvalues taken as positive."""
    eigenvalue, vector = np.linalg.eigh(curvature)
    return np.asarray(vector / np.sqrt(np.maximum(np.abs(eigenvalue), 1e-12)))


@cache
def _pairs(d: int) -> tuple[Ints, Ints]:
    """Rows and columns above the diagonal."""
    i, j = np.triu_indices(d, 1)
    return i, j


def _differences(z: Floats, axes: Floats) -> _Asking[tuple[float, Floats, Floats, int]]:
    """Value, gradient and negative Hessian by central differences along axes (columns), and how many points it took.

    Yields the points and is sent their log density. The density counts as flat where it is zero, and throughout where
    it is zero at `z`.
    """
    d = z.size
    i, j = _pairs(d)
    single = axes.T
    pair = single[i] + single[j]
    f = yield np.concatenate([z[None], z + single, z - single, z + pair, z - pair])
    value = float(f[0])
    f = np.where(np.isfinite(f), f, value if np.isfinite(value) else 0.0)
    up, down, both_up, both_down = np.split(f[1:], (d, 2 * d, 2 * d + i.size))
    hessian = np.diag(up - 2.0 * f[0] + down)
    mixed = 0.5 * (both_up - up[i] - up[j] + 2.0 * f[0] - down[i] - down[j] + both_down)
    hessian[i, j] = mixed
    hessian[j, i] = mixed
    return value, 0.5 * (up - down), -hessian, f.size
