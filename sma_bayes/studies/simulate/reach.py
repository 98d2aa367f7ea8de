"""The steady current that gives a wanted value: heated from cold, once the temperature no longer changes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.assess.draws import RecordDraws
from sma_bayes.assess.inverse import Met, Passage, finer, met, passages, search_grid
from sma_bayes.quantities import convert
from sma_bayes.studies.simulate.balance import HeatBalance
from sma_bayes.studies.simulate.spring import share_of

GRID_POINTS: Final = 801
"""Temperatures between the room and the hottest measured one at which steady currents are computed."""
MAX_SHARE_UNREACHED: Final = 0.05
"""Share of the draws that need not get to the hottest measured temperature within the currents that are searched."""


@dataclass(frozen=True, slots=True, eq=False)
class Steady:
    """Steady temperatures of a spring that a constant current heats from cold.

    Attributes
    ----------
    draws : RecordDraws
        Of the heating branch.
    read : ndarray, shape (S, m)
        Temperatures that the thermometer says [degC], rising.
    needed : ndarray, shape (S, m)
        Least current that heats so far [A], never falling.
    """

    draws: RecordDraws
    read: Floats
    needed: Floats

    @property
    def greatest(self) -> float:
        """Current at which nearly all draws are as hot as was measured [A]."""
        return float(np.quantile(self.needed[:, -1], 1.0 - MAX_SHARE_UNREACHED))

    def temperature(self, current: Floats) -> Floats:
        """Steady temperature at currents (m,) or (S, m); at most the hottest measured one [degC]."""
        given = np.broadcast_to(current, (len(self.read), np.shape(current)[-1]))
        rows = zip(given, self.needed, self.read, strict=True)
        return np.stack([np.interp(i, needed, read) for i, needed, read in rows])

    def beyond(self, current: Floats) -> Floats:
        """Where a current would heat beyond what was measured."""
        given = np.broadcast_to(current, (len(self.read), np.shape(current)[-1]))
        return np.asarray(given > self.needed[:, -1:])


def steady(draws: RecordDraws, balance: HeatBalance) -> Steady:
    """Steady states from the room to the hottest temperature that was measured while heating.

    Parameters
    ----------
    draws : RecordDraws
        Of the heating branch.
    balance : HeatBalance
        As many draws.
    """
    coolest = np.minimum(balance.room, draws.hottest - 1e-3)
    read = coolest[:, None] + np.linspace(0.0, 1.0, GRID_POINTS) * (draws.hottest - coolest)[:, None]
    share = share_of(draws, read)
    needed = np.empty_like(read)
    for j in range(GRID_POINTS):
        alloy = balance.of_alloy(read[:, j], balance.room)
        lost = balance.loss_rate(alloy, balance.room) * np.maximum(alloy - balance.room, 0.0)
        needed[:, j] = np.sqrt(lost / balance.heating(1.0, share[:, j]))
    return Steady(draws, read, np.maximum.accumulate(needed, axis=1))


@dataclass(frozen=True, slots=True, eq=False)
class Reached:
    """Which steady currents give a wanted value.

    Attributes
    ----------
    passages : tuple of Passage
        Currents at which each draw passes the value [A].
    reachable : float
        Share of the draws that do within the measured temperatures [1].
    met : Met
        How surely the value is met within the tolerance, current by current, the misfit of the heat balance included.
    greatest : float
        Up to which currents were searched [A].
    """

    passages: tuple[Passage, ...]
    reachable: float
    met: Met
    greatest: float


def reached(
    states: Steady,
    sd: float,
    channel: str,
    unit: tuple[str, str],
    target: float,
    bounds: tuple[float, float],
    rng: np.random.Generator,
) -> Reached:
    """Find the currents that give a value.

    Parameters
    ----------
    states : Steady
    sd : float
        How far a temperature may be from that of the balance, standard deviation [K].
    channel : str
    unit : tuple of str
        Of the channel, and of what follows.
    target, bounds : float, tuple of float
    rng : numpy.random.Generator
    """
    own = states.draws

    def value(temperature: Floats) -> Floats:
        return convert(own.curve(channel, temperature), *unit)

    grid = search_grid(0.0, states.greatest)
    found = passages(lambda current: value(states.temperature(current)), grid, target)
    places = np.concatenate([p.draws for p in found]) if found else np.empty(0)
    grid = finer(grid, places[np.isfinite(places)])
    off = sd * rng.standard_normal((own.size, 1))
    values = np.where(states.beyond(grid), np.nan, value(states.temperature(grid) + off))
    passing = np.zeros(own.size, dtype=bool)
    for p in found:
        passing |= np.isfinite(p.draws)
    return Reached(found, float(np.mean(passing)), met(grid, values, bounds), states.greatest)
