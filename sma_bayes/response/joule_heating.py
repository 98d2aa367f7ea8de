"""Temperature of a wire or spring that a current heats: the Joule-heating balance.

    m c dT/dt = I**2 R - h A (T - Ta)

Divided by the heat capacity, two numbers are left: ``gain = R/(m c)`` and ``loss = h A/(m c)``. Between samples current
and ambient temperature are held, so each step is exact. Every stretch starts at the temperature that suits its readings
best: the first one is as noisy as any other, and its error would die away only with the time constant.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sma_bayes.parameters.space import ParameterFact
from sma_bayes.quantities import Floats
from sma_bayes.records.history import starts

Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class JouleHeating:
    """Temperature from current.

    ``theta`` (..., 3): gain [K/(s A^2)], loss [1/s], and the ambient temperature [degC], which only counts where
    none was recorded.
    """

    name = "joule_heating"
    parameter_names = ("gain", "loss", "ambient")

    def parameters(self) -> tuple[ParameterFact, ...]:
        """Facts about the parameters."""
        return (
            ParameterFact(
                "gain", "K/(s A^2)", "heating rate of 1 A without losses, R/(m c)", channel="temperature"
            ),
            ParameterFact("loss", "1/s", "rate of cooling, h A/(m c)", channel="temperature"),
            ParameterFact("ambient", "degC", "temperature of the surroundings", channel="temperature"),
        )

    def predict(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Temperature along a history.

        Parameters
        ----------
        theta : ndarray, shape (..., 3)
        inputs : mapping of str to ndarray, shape (n,) or (..., n)
            ``current`` [A], ``time`` [s], ``stretch``, ``temperature`` (for the start of each stretch) [degC];
            ``ambient_temperature`` [degC] where it was recorded. Effects may add ``heat_capacity_factor`` and
            ``loss_factor``, by which heat capacity and loss differ from their constants.

        Returns
        -------
        dict
            ``temperature`` (..., n).
        """
        theta = np.asarray(theta, dtype=float)
        gain, loss, ambient = (theta[..., i, None] for i in range(3))
        capacity = inputs.get("heat_capacity_factor", np.ones(1))
        rate = loss * inputs.get("loss_factor", np.ones(1)) / capacity
        heating = gain * inputs["current"] ** 2 / capacity
        surroundings = inputs.get("ambient_temperature", ambient)
        dt = np.diff(inputs["time"], prepend=inputs["time"][..., :1])
        shape = np.broadcast_shapes(rate.shape, heating.shape, np.shape(surroundings), dt.shape)
        rate, heating = np.broadcast_to(rate, shape), np.broadcast_to(heating, shape)
        goal = surroundings + heating / np.maximum(rate, 1e-300)
        kept = np.exp(-rate[..., :-1] * dt[..., 1:])  # what is held over a step is what its start says
        step = (1.0 - kept) * goal[..., :-1]
        first = starts(inputs)
        ahead = [*[(0, 0)] * (len(shape) - 1), (1, 0)]
        carried = np.where(first, 0.0, np.pad(kept, ahead))
        from_zero = recursion(carried, np.where(first, 0.0, np.pad(step, ahead)))
        of_start = recursion(carried, np.broadcast_to(np.where(first, 1.0, 0.0), shape))
        start = _starts(inputs["temperature"] - from_zero, of_start, first)
        return {"temperature": from_zero + of_start * start}


def _starts(left: Floats, of_start: Floats, first: Bools) -> Floats:
    """Least-squares temperature at the start of each stretch, shape (..., n), given what it has to explain."""
    at = np.flatnonzero(first)
    pull = np.add.reduceat(of_start * left, at, axis=-1)
    weight = np.add.reduceat(of_start**2, at, axis=-1)
    return np.repeat(pull / weight, np.diff(np.append(at, first.size)), axis=-1)


def recursion(kept: Floats, add: Floats) -> Floats:
    """``y[i] = kept[i] y[i - 1] + add[i]`` along the last axis, with ``kept[0] = 0``.

    Two steps of it are one step of the same kind, so all values come from ``log2 n`` rounds that double the stride.
    """
    kept, y = kept.copy(), add.copy()
    stride = 1
    while stride < y.shape[-1]:
        y[..., stride:] += kept[..., stride:] * y[..., :-stride]
        kept[..., stride:] *= kept[..., :-stride].copy()
        stride *= 2
    return y
