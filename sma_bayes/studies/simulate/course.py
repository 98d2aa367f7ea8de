"""The course of a simulation: temperature and branch in time, for each draw."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.arrays import Bools, Floats
from sma_bayes.errors import MeasurementError
from sma_bayes.limits import PROFILE_TIME
from sma_bayes.studies.simulate.balance import HeatBalance
from sma_bayes.studies.simulate.profile import CurrentProfile
from sma_bayes.studies.simulate.spring import Spring, State

EVEN_INSTANTS: Final = 401
"""Even instants at which a course is told, beside those of the profile."""
MAX_INSTANTS: Final = 2000
"""From so many on those of the profile are left out."""
MAX_TEMPERATURE_STEP: Final = 0.5
"""Greatest change of temperature in a step of the integration [K]."""
MAX_STEP_OF_LOSS: Final = 0.1
"""Its greatest length, in time constants of loss."""
MAX_STEP_OF_THERMOMETER: Final = 0.5
"""The same in time constants of the thermometer."""
MIDPOINT_ROUNDS: Final = 4
"""How often a step is computed from the middle that it gave before."""
TURN_TOLERANCE: Final = 0.02
"""How far the temperature comes back before it counts as turned [K]."""
MAX_STEP_AGAINST_BRANCH: Final = 1.2 * TURN_TOLERANCE
"""Greatest change of temperature in a step against the branch that holds [K]."""
STATIONARY_STEP: Final = 1e-7
"""Change of temperature below which a slope stands for a difference [K]."""


@dataclass(frozen=True, slots=True)
class Start:
    """Where a simulation begins.

    Attributes
    ----------
    name : str
        ``cold`` or ``hot``: at the temperature of the room, which the alloy has come to from below all transformation,
        or from above it; ``heating`` or ``cooling``: on that branch.
    temperature : float or None
        What the thermometer says [degC]; None for the room.
    """

    name: str
    temperature: float | None = None

    @property
    def on_heating(self) -> bool:
        """Whether the curve of heating holds."""
        return self.name in ("cold", "heating")


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedCourse:
    """Temperature and branch in time.

    Attributes
    ----------
    time, current : ndarray, shape (m,)
        [s], [A].
    temperature : ndarray, shape (S, m)
        As the thermometer of the campaign would say [degC].
    state : State
        At these instants, arrays (S, m).
    turns : ndarray of int, shape (S,)
        How often the temperature turned.
    inside : ndarray of int, shape (S,)
        How often with at least `MINOR_LOOP_MARGIN` of the transformation both behind it and before it.
    """

    time: Floats
    current: Floats
    temperature: Floats
    state: State
    turns: Floats
    inside: Floats


MINOR_LOOP_MARGIN: Final = 0.05
"""Share from either end between which a turn makes a minor loop."""


def instants(profile: CurrentProfile) -> Floats:
    """Instants at which a course is told."""
    even = np.linspace(profile.time[0], profile.time[-1], EVEN_INSTANTS)
    return np.union1d(even, profile.time) if profile.time.size <= MAX_INSTANTS else even


def temperatures(profile: CurrentProfile, balance: HeatBalance, start: Start) -> tuple[float, float]:
    """Temperatures beyond which no draw gets under a profile [degC]."""
    rooms = [balance.room] if profile.ambient is None else [np.full(1, v) for v in np.unique(profile.ambient)]
    coldest, hottest = min(r.min() for r in rooms), max(r.max() for r in rooms)
    power = float(np.max(profile.current**2))
    most = (
        balance.gain
        * power
        * np.maximum(balance.resistance_factor(np.zeros(1)), balance.resistance_factor(np.ones(1)))
    )
    rise = float(np.max(most / balance.loss_rate(np.full(1, hottest + 40.0), np.full(1, hottest))))
    begun = [] if start.temperature is None else [start.temperature]
    return float(min([coldest, *begun])) - 2.0, float(max([hottest + max(rise, 40.0), *begun])) + 2.0


def require_length(profile: CurrentProfile, balance: HeatBalance) -> None:
    """Refuse a profile that lasts too long to be followed.

    Raises
    ------
    MeasurementError
        If it does.
    """
    constants = profile.duration * float(np.median(balance.loss))
    if constants > PROFILE_TIME.value:
        raise MeasurementError(
            f"{profile.duration:g} s, {constants:.3g} time constants of the heat balance",
            file=profile.name,
            expected=f"at most {PROFILE_TIME.value:g}",
            remedy="simulate a part of it",
        )


@dataclass(slots=True, eq=False)
class _Now:
    """What changes from step to step, arrays (S,): temperatures of alloy, second mass, thermometer, its extreme."""

    alloy: Floats
    beside: Floats
    read: Floats
    farthest: Floats
    state: State
    turns: Floats
    inside: Floats


def follow(spring: Spring, balance: HeatBalance, profile: CurrentProfile, start: Start) -> SimulatedCourse:
    """Integrate the heat balance along a profile, the share of austenite on the branches of the spring.

    Each step is the exact one of coefficients at its middle, what the transformation takes up counted from end to end.

    Parameters
    ----------
    spring, balance
        Of as many draws.
    profile : CurrentProfile
    start : Start
    """
    told = instants(profile)
    edges = np.union1d(told, profile.time)
    current = profile.held(profile.current, told)
    now = _begin(spring, balance, profile, start)
    temperature, states = [now.read], [now.state]
    kept = np.isin(edges, told)
    for begin, end, keep in zip(edges[:-1], edges[1:], kept[1:], strict=True):
        at = np.array([begin])
        amperes = float(profile.held(profile.current, at)[0])
        room = (
            balance.room
            if profile.ambient is None
            else np.full(balance.size, profile.held(profile.ambient, at)[0])
        )
        left = float(end - begin)
        while left > 0.0:
            dt = min(left, _length(spring, balance, now, amperes, room))
            dt = left if left - dt < 1e-9 * (end - begin) else dt
            _step(spring, balance, now, amperes, room, dt)
            left -= dt
        if keep:
            temperature.append(now.read)
            states.append(now.state)
    return SimulatedCourse(
        told, current, np.stack(temperature, axis=1), _stacked(states), now.turns, now.inside
    )


def _stacked(states: list[State]) -> State:
    return State(
        np.stack([s.heating for s in states], axis=1),
        np.stack([s.turned_at for s in states], axis=1),
        np.stack([s.reached for s in states], axis=1),
        {name: np.stack([s.apart[name] for s in states], axis=1) for name in states[0].apart},
    )


def _begin(spring: Spring, balance: HeatBalance, profile: CurrentProfile, start: Start) -> _Now:
    room = balance.room if profile.ambient is None else np.full(balance.size, profile.ambient[0])
    read = room if start.temperature is None else np.full(balance.size, start.temperature)
    alloy = balance.of_alloy(read, room)
    none = np.zeros(balance.size)
    return _Now(alloy, alloy, read, read, spring.begin(start.on_heating), none, none)


def _net(
    balance: HeatBalance, alloy: Floats, beside: Floats, share: Floats, amperes: float, room: Floats
) -> Floats:
    """Rate at which the alloy would warm up if nothing transformed [K/s]."""
    out = balance.heating(amperes, share) - balance.loss_rate(alloy, room) * (alloy - room)
    return np.asarray(out - balance.second * (alloy - beside) / np.maximum(balance.second_time, 1e-9))


def _length(spring: Spring, balance: HeatBalance, now: _Now, amperes: float, room: Floats) -> float:
    """Length of the next step [s]."""
    share = spring.share(now.read, now.state)
    speed = _net(balance, now.alloy, now.beside, share, amperes, room) / _capacity(spring, balance, now)
    most = np.where((speed > 0.0) == now.state.heating, MAX_TEMPERATURE_STEP, MAX_STEP_AGAINST_BRANCH)
    fastest = float(np.max(np.abs(speed) / most))
    dt = min(1.0 / max(fastest, 1e-12), MAX_STEP_OF_LOSS / float(np.max(balance.loss_rate(now.alloy, room))))
    if balance.second.any():
        dt = min(dt, MAX_STEP_OF_LOSS * float(np.quantile(balance.second_time, 0.05)))
    return min(dt, MAX_STEP_OF_THERMOMETER * float(np.median(balance.lag))) if balance.lag.any() else dt


def _capacity(spring: Spring, balance: HeatBalance, now: _Now) -> Floats:
    """Heat capacity with what the transformation takes up, over that without."""
    if not balance.latent.any():
        return np.ones(1)
    by = 0.05
    up, down = (spring.share(now.read + d, now.state) for d in (by, -by))
    return np.asarray(
        1.0 + balance.latent * np.maximum(up - down, 0.0) / (2.0 * by) / (1.0 + balance.contact)
    )


def _step(spring: Spring, balance: HeatBalance, now: _Now, amperes: float, room: Floats, dt: float) -> None:
    """Go on by a step."""
    share = spring.share(now.read, now.state)
    before = now.alloy
    alloy = before + dt * _net(balance, before, now.beside, share, amperes, room) / _capacity(
        spring, balance, now
    )
    read = _sensed(balance, now, alloy, room, dt)
    for _ in range(MIDPOINT_ROUNDS):
        middle = 0.5 * (before + alloy)
        loss = balance.loss_rate(middle, room)
        heat = balance.heating(amperes, spring.share(0.5 * (now.read + read), now.state))
        beside = now.beside - np.expm1(-dt / np.maximum(balance.second_time, 1e-9)) * (middle - now.beside)
        heat = heat - balance.second * (beside - now.beside) / dt
        taken = balance.latent * (spring.share(read, now.state) - share)
        moved = alloy - before
        capacity = np.ones(before.size)
        if balance.latent.any() and not balance.lag.any():
            small = np.abs(moved) < STATIONARY_STEP
            capacity = 1.0 + taken / np.where(small, 1.0, moved)
            capacity = np.where(small, _capacity(spring, balance, now), capacity) if small.any() else capacity
            capacity = np.maximum(capacity, 1.0)
        elif balance.latent.any():
            heat = heat - taken / dt
        passed = loss * dt / capacity
        late = np.where(passed > 1e-12, -np.expm1(-passed) / np.maximum(passed, 1e-12), 1.0)
        alloy = before + late * dt * (heat - loss * (before - room)) / capacity
        read = _sensed(balance, now, alloy, room, dt)
    now.beside = now.beside - np.expm1(-dt / np.maximum(balance.second_time, 1e-9)) * (
        0.5 * (before + alloy) - now.beside
    )
    now.alloy, now.read = alloy, read
    _turn(spring, now)


def _sensed(balance: HeatBalance, now: _Now, alloy: Floats, room: Floats, dt: float) -> Floats:
    """What the thermometer says at the end of a step in which the alloy warms up evenly."""
    if not balance.lag.any():
        return balance.read(alloy, room)
    source, rise = balance.read(now.alloy, room), balance.read(alloy, room) - balance.read(now.alloy, room)
    steps = dt / np.maximum(balance.lag, 1e-9)
    mean = -np.expm1(-steps) / np.maximum(steps, 1e-12)
    return np.asarray(source + rise * (1.0 - mean) + (now.read - source) * np.exp(-steps))


def _turn(spring: Spring, now: _Now) -> None:
    """Note how far the temperature has come, and change branches where it has come back."""
    heating = now.state.heating
    now.farthest = np.where(heating, np.maximum(now.farthest, now.read), np.minimum(now.farthest, now.read))
    back: Bools = np.where(heating, now.farthest - now.read, now.read - now.farthest) > TURN_TOLERANCE
    if not back.any():
        return
    share = spring.share(now.farthest, now.state)
    now.turns = now.turns + back
    now.inside = now.inside + (back & (share > MINOR_LOOP_MARGIN) & (share < 1.0 - MINOR_LOOP_MARGIN))
    now.state = now.state.joined(back, spring.turned(now.farthest, now.state))
    now.farthest = np.where(back, now.read, now.farthest)
