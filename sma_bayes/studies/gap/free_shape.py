"""Curves that are free to have any shape, the same in every sweep and condition that they serve.

A specimen whose curve is no sigmoid leaves residuals that are a function of the temperature of the alloy on each
branch: of the measured one, or, where effects shift it, of the one at which the simulation is asked for its curve. So
the splines that let a curve bend are functions of that temperature.

Half of their knots lie at equal steps of temperature, half at equal steps of what a channel covers, so that they are
close where it transforms.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.transformation import FAR
from sma_bayes.studies.gap.fitting import FittedHypothesis
from sma_bayes.studies.gap.hypothesis import Hypothesis
from sma_bayes.studies.gap.splines import bspline_basis

MAX_SPLINES = 20
"""Splines of a channel on a branch, at most."""
LEAST_TEMPERATURES_PER_SPLINE = 3
"""Temperatures for each of these, at least."""
COARSE_SPLINES = 8
"""Splines of a curve that bends more smoothly."""
LEAST_SPLINES = 4
"""Splines below which a curve is not bent."""
GRID_POINTS = 400
"""Temperatures at which a curve is followed."""


def free_curves(fitted: FittedHypothesis, sizes: Mapping[str, float]) -> dict[str, tuple[Floats, Floats]]:
    """Let every curve of a fitted hypothesis bend.

    Parameters
    ----------
    fitted : FittedHypothesis
    sizes : mapping of str to float
        Standard deviation of the noise of each channel that may bend [unit of the channel].

    Returns
    -------
    dict of str to tuple of ndarray, shapes (N, k) and (N, j)
        By the channel that bends: splines of a standard deviation of its noise, many and few. Channels of which no
        branch has enough temperatures are left out.
    """
    found: dict[str, list[tuple[Floats, Floats]]] = {c: [] for c in sizes}
    for members in served_together(fitted.hypothesis):
        alloy = [alloy_temperature(fitted, i) for i in members]
        for sign in (1.0, -1.0):
            on = [fitted.hypothesis.histories[i].inputs["branch"] == sign for i in members]
            temperature = np.concatenate([t[own] for t, own in zip(alloy, on, strict=True)])
            count = min(np.unique(temperature).size // LEAST_TEMPERATURES_PER_SPLINE, MAX_SPLINES)
            if count < LEAST_SPLINES or np.ptp(temperature) == 0.0:
                continue
            for channel, place in _places(fitted, members[0], temperature, sign).items():
                if channel in sizes:
                    rows = _rows(fitted, members, on, channel)
                    many, few = (
                        np.zeros((fitted.whitened.size, k)) for k in (count, min(COARSE_SPLINES, count))
                    )
                    many[rows] = sizes[channel] * bspline_basis(place, many.shape[1])
                    few[rows] = sizes[channel] * bspline_basis(place, few.shape[1])
                    found[channel].append((many, few))
    return {
        channel: (
            np.concatenate([m for m, _ in parts], axis=1),
            np.concatenate([f for _, f in parts], axis=1),
        )
        for channel, parts in found.items()
        if parts
    }


def alloy_temperature(fitted: FittedHypothesis, history: int) -> Floats:
    """Temperatures at which the simulation is asked for its curve along a history, once all effects have acted, (n,).

    The median, where an effect asks at several, as along a spring with cool ends; phases are asked for far away, which
    doesn't count.
    """
    measured = fitted.hypothesis.histories[history].inputs["temperature"]
    if not fitted.hypothesis.effects:
        return measured
    asked: list[Floats] = []

    def watch(out: Mapping[str, Floats], given: Mapping[str, Floats]) -> dict[str, Floats]:
        temperature = np.broadcast_to(given["temperature"], measured.shape)
        if np.median(np.abs(temperature - measured)) < 0.5 * FAR:
            asked.append(temperature)
        return dict(out)

    fitted.hypothesis.predict(fitted.theta, history, bend=watch)
    return np.median(asked, axis=0) if asked else measured


def served_together(hypothesis: Hypothesis) -> list[list[int]]:
    """Histories that one set of curves serves, by their places."""
    found: dict[tuple[int, ...], list[int]] = {}
    for i, layout in enumerate(hypothesis.layout):
        found.setdefault(tuple(layout.tolist()), []).append(i)
    return list(found.values())


def _places(fitted: FittedHypothesis, member: int, temperature: Floats, sign: float) -> dict[str, Floats]:
    """Where temperatures (n,) lie among the knots of each channel, from 0 to 1."""
    hypothesis = fitted.hypothesis
    grid = np.linspace(temperature.min(), temperature.max(), GRID_POINTS)
    even, out = np.linspace(0.0, 1.0, GRID_POINTS), {}
    for channel, curve in hypothesis.simulation.curves(
        fitted.theta[hypothesis.layout[member]], grid, sign
    ).items():
        covered = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(curve)))])
        place = 0.5 * (even + covered / covered[-1]) if covered[-1] > 0.0 else even
        out[channel] = np.interp(temperature, grid, place)
    return out


def _rows(fitted: FittedHypothesis, members: Sequence[int], on: Sequence[Floats], channel: str) -> Floats:
    """Places of the samples of some histories and a channel in stacked vectors, those that are `on`."""
    start = {b.history: b.at.start for b in fitted.blocks if b.channel == channel}
    return np.concatenate([start[i] + np.flatnonzero(own) for i, own in zip(members, on, strict=True)])
