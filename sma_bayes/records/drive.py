"""What a current has delivered, which no averaging of rows may lose."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sma_bayes.arrays import Floats

DELIVERED: Final = ("delivered_two_before", "delivered_before", "delivered_after", "delivered_two_after")
"""Inputs: integrals of the squared current over time [A^2 s], with each reading taken as the current of the step before
the last, the step before, the step after its instant, and the one after that."""
SWITCHING_SHARE = 0.1
"""Least part of the greatest change within a step from which on a change of the current counts as a switching."""
LEAST_SAMPLES_PER_SWITCHING = 8
"""Fewest samples, on average, from one switching to the next for their instants to be told one by one."""


def delivered(time: Floats, power: Floats) -> dict[str, Floats]:
    """Integrals of a power over time at each row, for each step that a reading may belong to; see `DELIVERED`.

    Averages of them over blocks of rows belong to averages of the temperature over the same blocks, as the heat balance
    is linear in both; those of the current do not, where it is switched within a block.

    Parameters
    ----------
    time : ndarray, shape (..., n)
        [s]; where it runs backwards nothing is delivered.
    power : ndarray, shape (..., n)
    """
    n = time.shape[-1]
    steps = np.maximum(np.diff(time, axis=-1, prepend=time[..., :1]), 0.0)
    step = np.arange(n)
    reading = {
        name: np.clip(step + ahead, 0, n - 1) for name, ahead in zip(DELIVERED, (1, 0, -1, -2), strict=True)
    }
    return {name: np.cumsum(power[..., at] * steps, axis=-1) for name, at in reading.items()}


def delivered_in_steps(inputs: Mapping[str, Floats], switching: Floats) -> Floats:
    """What the current delivers in the step that ends at each sample [A^2 s], shape (..., n).

    Parameters
    ----------
    inputs : mapping of str to ndarray, shape (n,) or (..., n)
        See `History`; where they do not have `DELIVERED` it is made of ``current`` and ``time``.
    switching : ndarray, shape (..., n) or (..., 1)
        Share of a step that passes before the current changes to the next reading: 1 where each reading holds until the
        next, 0 where it holds since the last; below 0 and above 1 it changes in the steps beside.
    """
    found = inputs if DELIVERED[0] in inputs else delivered(inputs["time"], inputs["current"] ** 2)
    first, before, after, last = (
        np.diff(found[name], axis=-1, prepend=found[name][..., :1]) for name in DELIVERED
    )
    out = before + np.clip(switching, 0.0, 1.0) * (after - before)
    if np.all((switching >= 0.0) & (switching <= 1.0)):
        return np.asarray(out)
    early, late = np.clip(switching, -1.0, 0.0), np.clip(switching - 1.0, 0.0, 1.0)
    return np.asarray(out + early * (before - first) + late * (last - after))


def switched_at(inputs: Mapping[str, Floats]) -> NDArray[np.intp]:
    """Samples at which the steps end in which the current was switched; none where it hardly ever stays the same.

    Parameters
    ----------
    inputs : mapping of str to ndarray, shape (n,)
        See `History`.
    """
    if not {"current", "time"} <= set(inputs):
        return np.empty(0, dtype=np.intp)
    after, before = (delivered_in_steps(inputs, np.full(1, share)) for share in (1.0, 0.0))
    change = np.abs(after - before)
    found = np.flatnonzero(change > SWITCHING_SHARE * max(float(change.max()), 1e-300))
    return found if found.size * LEAST_SAMPLES_PER_SWITCHING <= change.size else found[:0]
