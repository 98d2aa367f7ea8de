"""The mean sweep, about which offset, stroke, shift and width are told, in draws of the common curve and its numbers.

Curve and numbers of sweeps could change places: a common curve that is a little wider with sweeps that are all a little
narrower is the same to every reading. What is told must not hang on which of these a fit has come to. So it is counted
from the mean sweep, the curve with the mean numbers of the measured sweeps, which is the same for all of them: its
level is halfway between its values at the ends of the measured temperatures, its span is between these, and its middle
is where it is at its level. Errors of the common curve move level, span and middle, and the numbers of each sweep with
them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats, Ints
from sma_bayes.studies.cycles.sweeps import TEMPERATURE_STEP, Strand

NEWTON_STEPS: Final = 4
"""Steps to the middle of the mean sweep, from that of the fitted curve."""
MAX_NEWTON_STEP: Final = 0.1
"""Longest of them [range of the measured temperatures]."""


@dataclass(frozen=True, slots=True, eq=False)
class MeanSweep:
    """The mean sweep of a strand in S draws.

    Attributes
    ----------
    numbers : ndarray, shape (S, 4)
        Means of the numbers of the measured sweeps.
    level, span : ndarray, shape (S,)
        [unit of the channel].
    middle : ndarray, shape (S,)
        [unit of temperature].
    place, value : ndarray, shape (S,)
        The same place on the common curve: temperature and value there.
    """

    numbers: Floats
    level: Floats
    span: Floats
    middle: Floats
    place: Floats
    value: Floats


def mean_sweep(strand: Strand, numbers: Floats, errors: Floats | None, measured: Ints) -> MeanSweep:
    """The mean of the measured sweeps.

    Parameters
    ----------
    strand : Strand
    numbers : ndarray, shape (S, G, 4)
        Of sweeps about the common curve.
    errors : ndarray, shape (S, k), or None
        Of the common curve in the same draws, see `Strand.errors`.
    measured : ndarray of int
        Which of the G sweeps were measured.
    """
    mean = numbers[:, measured].mean(axis=1)
    low, high = strand.ends
    at_ends = strand.curve(mean, np.array([low, high]), errors)
    level, span = at_ends.mean(axis=1), np.abs(at_ends[:, 1] - at_ends[:, 0])
    a, g, d, w = mean.T
    value = strand.level + (level - strand.level - strand.span * a) * np.exp(-g)
    place, longest = np.full(len(mean), strand.middle), MAX_NEWTON_STEP * (high - low)
    for _ in range(NEWTON_STEPS):
        before, here, after = strand.common(
            place[:, None] + np.array([-TEMPERATURE_STEP, 0.0, TEMPERATURE_STEP]), errors
        ).T
        with np.errstate(divide="ignore", invalid="ignore"):
            step = (value - here) / (after - before) * (2.0 * TEMPERATURE_STEP)
        place = place + np.clip(np.nan_to_num(step), -longest, longest)
    middle = strand.middle + d + (place - strand.middle) * np.exp(w)
    return MeanSweep(mean, level, span, middle, place, value)


def about_mean_sweep(strand: Strand, numbers: Floats, errors: Floats | None, measured: Ints) -> Floats:
    """Offset and stroke [unit of the channel], shift and width of sweeps about the mean of the measured ones.

    The offset is the level of a sweep where it has gone as far as the mean sweep at its middle, the shift by how much
    later that is; stroke and width are those of the mean sweep, stretched.

    Parameters
    ----------
    strand, numbers, errors, measured
        See `mean_sweep`.

    Returns
    -------
    ndarray, shape (S, G, 4)
    """
    mean = mean_sweep(strand, numbers, errors, measured)
    a, g, d, w = np.moveaxis(numbers, -1, 0)
    rise, away = (mean.value - strand.level)[:, None], (mean.place - strand.middle)[:, None]
    offset = strand.level + strand.span * a + np.exp(g) * rise
    stroke = mean.span[:, None] * np.exp(g - mean.numbers[:, 1, None])
    shift = strand.middle + d + np.exp(w) * away - mean.middle[:, None]
    return np.stack([offset, stroke, shift, np.exp(w - mean.numbers[:, 3, None])], axis=-1)
