"""First-order followers in time: the heat balance of the wire, a sensor, a load cell that warms up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gap_benchmark.spring import Floats


@dataclass(frozen=True, slots=True)
class Wire:
    """Thermal data of the wire in the heat balance ``C dT/dt = I^2 R - hA (T - Ta)``.

    The defaults are for 45 coils of 3 mm of 0.5 mm wire (paper, Table 1): 0.424 m of wire, 0.54 g at 6450 kg/m3, of
    460 J/(kg K); 80e-8 ohm m; and 38 W/(m2 K) to still air.

    Attributes
    ----------
    capacity : float
        C [J/K].
    loss : float
        hA [W/K].
    resistance : float
        R [ohm].
    mass : float
        [kg].
    """

    capacity: float = 0.247
    loss: float = 0.0253
    resistance: float = 1.73
    mass: float = 0.537e-3


def follow(goal: Floats, time: Floats, lag: float | Floats, start: float, *, held: bool = False) -> Floats:
    """Solve ``lag dy/dt = goal - y`` exactly, for a goal that is straight between instants, or held from each.

    Parameters
    ----------
    goal, time : ndarray, shape (m,)
    lag : float, or ndarray of shape (m - 1,)
        Time constant, of each step if there are many, in the unit of time; positive.
    start : float
        y at the first instant.
    held : bool
        Whether the goal keeps its value until the next instant.
    """
    dt = np.diff(time)
    kept = np.exp(-dt / lag)
    if held:
        add = (1.0 - kept) * goal[:-1]
    else:
        part = -np.expm1(-dt / lag) * lag / dt  # the share of a straight goal that comes too late
        add = goal[:-1] * (part - kept) + goal[1:] * (1.0 - part)
    return scan(kept, add, start)


def scan(kept: Floats, add: Floats, start: float) -> Floats:
    """``y[i+1] = kept[i] y[i] + add[i]``, from ``y[0] = start``."""
    y = start
    out = [y]
    for k, a in zip(kept.tolist(), add.tolist(), strict=True):
        y = k * y + a
        out.append(y)
    return np.array(out)


def warm(
    wire: Wire,
    power: Floats,
    ambient: Floats,
    time: Floats,
    start: float,
    *,
    held: bool,
    loss: Floats | None = None,
) -> Floats:
    """Temperature [degC] of the wire; with `loss` [W/K] (m,) the cooling differs from instant to instant.

    Parameters
    ----------
    power : ndarray, shape (m,)
        I^2 R [W].
    ambient, time : ndarray, shape (m,)
    """
    if loss is None:
        return follow(ambient + power / wire.loss, time, wire.capacity / wire.loss, start, held=held)
    middle = 0.5 * (loss[1:] + loss[:-1])
    heat, room = (x[:-1] if held else 0.5 * (x[1:] + x[:-1]) for x in (power, ambient))
    kept = np.exp(-np.diff(time) * middle / wire.capacity)
    return scan(kept, (1.0 - kept) * (room + heat / middle), start)
