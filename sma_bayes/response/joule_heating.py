"""Temperature of a wire or spring that a current heats: the Joule-heating balance.

    m c dT/dt = I**2 R - h A (T - Ta)

Divided by the heat capacity, two numbers are left: ``gain = R/(m c)`` and ``loss = h A/(m c)``. Over each step the
heat that the current brings is what its square adds up to, so no switching is lost between two samples. Every stretch
starts at the temperature that suits its readings best: the first one is as noisy as any other, and its error would die
away only with the time constant.

How far a sensor that lags is behind when a stretch starts is unknown as well, but stretches of one condition that warm
start alike, and so do those that cool: after a hold, where it has settled, or on the way. So one share serves all of
them, from 0, where the sensor follows at its distance already, by 1, where it has settled, to 2, where it comes from a
course as steep the other way. A start for each stretch would be as many free numbers, which the evidence does not
count.

A record does not say when between two samples the current was switched, nor whether a reading is the current before or
after its instant. So ``switching`` is the share of a step that passes before the current changes to the next reading:
1 where each reading holds until the next one, 0 where it holds since the one before; up to half a step beyond either
where a reading is the average of a step.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.arrays import Bools, Floats
from sma_bayes.parameters.space import ParameterSpec
from sma_bayes.records.drive import delivered_in_steps
from sma_bayes.records.history import starts

EXCESS: Final = 40.0
"""Excess over the room at which the loss by natural convection is stated [K]."""
LEAST_EXCESS: Final = 0.5
"""Excess below which losses are as at this one [K]."""
KELVIN: Final = 273.15
ROUNDS: Final = 4
"""How often the starts of the stretches and how far the sensor is behind at them are found, given each other."""
LEAST_WEIGHT: Final = 1e-6
"""Squared length below which what fades from the start of a stretch says nothing of it."""


@dataclass(frozen=True)
class JouleHeating:
    """Temperature from current.

    ``theta`` (..., 4): gain [K/(s A^2)], loss [1/s], the ambient temperature [degC], which only counts where
    none was recorded, and switching, the share of a step of the record before the current changes [1].
    """

    name = "joule_heating"
    parameter_names = ("gain", "loss", "ambient", "switching")

    def parameters(self) -> tuple[ParameterSpec, ...]:
        """Facts about the parameters."""
        return (
            ParameterSpec(
                "gain", "K/(s A^2)", "heating rate of 1 A without losses, R/(m c)", channel="temperature"
            ),
            ParameterSpec("loss", "1/s", "rate of cooling, h A/(m c)", channel="temperature"),
            ParameterSpec("ambient", "degC", "temperature of the surroundings", channel="temperature"),
            ParameterSpec(
                "switching", "1", "share of a step before the current changes", channel="temperature"
            ),
        )

    def predict(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Temperature along a history.

        Parameters
        ----------
        theta : ndarray, shape (..., 4)
        inputs : mapping of str to ndarray, shape (n,) or (..., n)
            ``current`` [A], ``time`` [s], ``stretch``, ``temperature`` (for the start of each stretch) [degC];
            ``ambient_temperature`` [degC], ``resistance`` and ``typical_resistance`` [ohm] where they were recorded;
            what the current has delivered, if that was
            kept (see `delivered`). Effects may add ``heat_capacity_factor``, ``loss_factor`` and
            ``resistance_factor``, by which these differ from their constants; ``loss_exponent`` and ``radiated``, see
            `loss_law`; ``heat_taken``, what something else than
            the wire's heat capacity has taken up so far, over that [K]; ``sensor_lag`` [s], of what is read behind the
            alloy, and ``read`` [degC], what that says, where ``temperature`` is what it would say without; and
            ``switching_shift``, by which switching differs in the step that ends at a sample.

        Returns
        -------
        dict
            ``temperature`` (..., n).
        """
        theta = np.asarray(theta, dtype=float)
        gain, loss, ambient, switching = (theta[..., i, None] for i in range(4))
        switched = delivered_in_steps(inputs, switching + inputs.get("switching_shift", np.zeros(1)))
        resistance = inputs.get("resistance_factor", np.ones(1))
        if "resistance" in inputs:
            resistance = resistance * inputs["resistance"] / inputs["typical_resistance"]
        heat = gain * switched * _middle(resistance)
        heat = heat - _step(inputs.get("heat_taken", np.zeros(1)))
        if "sensor_lag" in inputs:
            heat = _late(heat, inputs)
        capacity = _middle(inputs.get("heat_capacity_factor", np.ones(1)))
        room = inputs.get("ambient_temperature", ambient)
        cooled = inputs.get("loss_factor", np.ones(1)) * loss_law(inputs, room)
        passed = loss * _middle(cooled) / capacity * _step(inputs["time"])
        surroundings = _middle(room)
        lost = -np.expm1(-passed)
        late = np.where(passed > 1e-9, lost / np.maximum(passed, 1e-9), 1.0)
        add = lost * surroundings + late * heat / capacity
        first = starts(inputs)
        shape = np.broadcast_shapes(lost.shape, add.shape, first.shape)
        carried = np.broadcast_to(np.where(first, 0.0, 1.0 - lost), shape)
        from_zero = recursion(carried, np.broadcast_to(np.where(first, 0.0, add), shape))
        of_start = _fading(1.0 - lost, first, shape)
        left = inputs.get("read", inputs["temperature"]) - from_zero
        if "sensor_lag" not in inputs:
            return {"temperature": from_zero + of_start * _starts(left, of_start, first)}
        of_lag = _fading(
            np.exp(-_step(inputs["time"]) / np.maximum(inputs["sensor_lag"], 1e-12)), first, shape
        )
        apart = of_lag - of_start * _starts(of_lag, of_start, first)
        warming = _after(heat / capacity + passed * surroundings, inputs, first)
        loss_rate = _after(passed, inputs, first)
        late = np.zeros(1)
        for _ in range(ROUNDS):
            start = _starts(left - late, of_start, first)
            settled = inputs["sensor_lag"] * (warming - loss_rate * start)
            late = _share(left, settled, settled * apart) * settled * of_lag
        return {"temperature": from_zero + of_start * _starts(left - late, of_start, first) + late}


def _speed(heat: Floats, time: Floats) -> Floats:
    """Heat of each step over its length [K/s]; 0 where it has none."""
    dt = _step(time)
    return np.divide(heat, dt, out=np.zeros(np.broadcast_shapes(heat.shape, dt.shape)), where=dt > 0.0)


def _after(heat: Floats, inputs: Mapping[str, Floats], first: Bools) -> Floats:
    """What the first step of each stretch brings, over its length, (..., n); 0 where a stretch has no step."""
    speed, at = _speed(heat, inputs["time"]), np.flatnonzero(first)
    stop = np.append(at[1:], first.size)
    own = np.where(at + 1 < stop, speed[..., np.minimum(at + 1, first.size - 1)], 0.0)
    return np.repeat(own, stop - at, axis=-1)


def _share(left: Floats, settled: Floats, direction: Floats) -> Floats:
    """Share of a direction that suits what is left best, 0 to 2, (..., n); of all that warm, and of all that cool."""
    out = np.zeros(np.broadcast_shapes(left.shape, direction.shape))
    for alike in (settled > 0.0, settled < 0.0):
        own = np.where(alike, direction, 0.0)
        weight = np.maximum(np.sum(own * own, axis=-1, keepdims=True), LEAST_WEIGHT)
        share = np.clip(np.sum(own * left, axis=-1, keepdims=True) / weight, 0.0, 2.0)
        out = np.where(alike, share, out)
    return out


def _fading(kept: Floats, first: Bools, shape: tuple[int, ...]) -> Floats:
    """What is left of 1 at the start of each stretch, shape (..., n), where so much is kept over each step."""
    return recursion(
        np.broadcast_to(np.where(first, 0.0, kept), shape), np.broadcast_to(np.where(first, 1.0, 0.0), shape)
    )


def _late(heat: Floats, inputs: Mapping[str, Floats]) -> Floats:
    """Heat of each step as a sensor that lags sees it, ``lag dP/dt = P_alloy - P``; steady before each stretch.

    The balance is linear: what the lagged power makes is what a sensor reads, but for what fades after the start.
    """
    first, dt = starts(inputs), _step(inputs["time"])
    passed = dt / np.maximum(inputs["sensor_lag"], 1e-12)
    power = _speed(heat, inputs["time"])
    kept = np.exp(-passed)
    following = np.concatenate([power[..., 1:], power[..., -1:]], axis=-1)
    shape = np.broadcast_shapes(power.shape, kept.shape)
    carried, add = np.where(first, 0.0, kept), np.where(first, following, (1.0 - kept) * power)
    end = recursion(np.broadcast_to(carried, shape), np.broadcast_to(add, shape))
    begin = np.concatenate([end[..., :1], end[..., :-1]], axis=-1)
    mean = np.where(passed > 1e-9, -np.expm1(-passed) / np.maximum(passed, 1e-9), 1.0)
    return np.asarray(dt * (power + (begin - power) * mean))


def loss_law(inputs: Mapping[str, Floats], room: Floats) -> Floats:
    """Loss over its constant at the measured temperature: natural convection, and radiation beside it.

    ``(abs(T - Ta)/(40 K))**loss_exponent + radiated (T**2 + Ta**2) (T + Ta)/(4 T0**3)``, in the second term in kelvin.

    Parameters
    ----------
    inputs : mapping of str to ndarray
        See `JouleHeating.predict`.
    room : ndarray
        Ta [degC].
    """
    out = np.ones(1)
    if "loss_exponent" in inputs:
        excess = np.maximum(np.abs(inputs["temperature"] - room), LEAST_EXCESS)
        out = (excess / EXCESS) ** inputs["loss_exponent"]
    if "radiated" in inputs:
        hot, cold = inputs["temperature"] + KELVIN, room + KELVIN
        out = out + inputs["radiated"] * (hot**2 + cold**2) * (hot + cold) / (4.0 * (KELVIN + 20.0) ** 3)
    return out


def _step(x: Floats) -> Floats:
    """Change since the sample before, shape (..., n); 0 of the first one and of what is constant."""
    return np.diff(x, axis=-1, prepend=x[..., :1])


def _middle(x: Floats) -> Floats:
    """Mean over the step that ends at each sample, shape (..., n); of what is constant, itself."""
    if x.shape[-1] == 1:
        return x
    return np.concatenate([x[..., :1], 0.5 * (x[..., 1:] + x[..., :-1])], axis=-1)


def _starts(left: Floats, of_start: Floats, first: Bools) -> Floats:
    """Least-squares temperature at the start of each stretch, shape (..., n), given what it has to explain."""
    at = np.flatnonzero(first)
    pull = np.add.reduceat(of_start * left, at, axis=-1)
    weight = np.add.reduceat(of_start**2, at, axis=-1)
    return np.repeat(pull / np.maximum(weight, LEAST_WEIGHT), np.diff(np.append(at, first.size)), axis=-1)


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
