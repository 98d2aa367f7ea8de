"""Force, displacement and stiffness of a spring whose temperature comes and goes: both branches, and loops inside.

The share of austenite begins a branch with what was reached on the other one, and its difference to the curve of the
branch fades with the transformation that is left,

    s = b(T) + (s1 - b(T1)) f(T),
    f = (1 - h(T))/(1 - h(T1)) on heating,  f = c(T)/c(T1) on cooling,

b the curve that holds, h of heating or c of cooling, T1 where the temperature turned. That is the proportional loop of
Liang and Rogers [1]_ and the solution of the Duhem equation of Ivshin and Pence [2]_, ``ds/dT = s/c dc/dT`` on cooling.
Other rules are in use: with ``play`` nothing transforms until the curve of the other branch is met. After a complete
transformation all are the same.

Force, displacement and stiffness go with the share, as in these models: they are those that the branch has where its
own curve has that share. What branches differ by at the same share fades in the same way, so that nothing jumps but for
a stiffness that is the slope of others.

References
----------
.. [1] C. Liang and C. A. Rogers, One-dimensional thermomechanical constitutive relations for shape memory materials,
   J. Intell. Mater. Syst. Struct. 1 (1990) 207-234.
.. [2] Y. Ivshin and T. J. Pence, A thermomechanical model for a one variant shape memory material, J. Intell. Mater.
   Syst. Struct. 5 (1994) 455-473.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, Literal

import numpy as np
from scipy.special import logit

from sma_bayes.arrays import Bools, Floats, Ints
from sma_bayes.assess.draws import RecordDraws, sharing_calibration
from sma_bayes.assess.unseen_misfit import with_unseen_misfit
from sma_bayes.effects.transformation import SLOPED, ChannelCurve, curves
from sma_bayes.errors import UnknownNameError, near_matches
from sma_bayes.noise import Steps
from sma_bayes.records.types import Branch

Rule = Literal["proportional", "play"]
RULES: Final[tuple[Rule, ...]] = ("proportional", "play")


def rule_named(name: str) -> Rule:
    """Check the name of a rule for minor loops.

    Raises
    ------
    UnknownNameError
        If it is none of them.
    """
    for rule in RULES:
        if rule == name:
            return rule
    raise UnknownNameError(f"unknown rule {name!r}", expected=near_matches(name, RULES))


SHARE: Final = "share"
TEMPERATURE_STEP: Final = 0.1
"""Distance of temperatures at which curves are tabulated [K]; they are straight between."""
MAX_NODES: Final = 3000
NEGLIGIBLE_SHARE: Final = 1e-6
"""Share transformed below which there is nothing left to fade with."""
SHARE_TOLERANCE: Final = 1e-9
"""Difference of shares below which a branch is on its own curve."""
MAX_LOG_ODDS: Final = 20.0
"""Log odds of a share up to which temperatures are looked up by it."""
LOG_ODDS_STEP: Final = 0.02
COLD_PREFIX: Final = "cold "
"""Before the name of a channel: that of martensite alone, along its line, where phases have slopes."""
SPAN_PREFIX: Final = "span "
"""The same of austenite less that."""


@dataclass(frozen=True, slots=True, eq=False)
class BothDraws:
    """Posterior draws of both branches of a condition; they are independent, and paired at random.

    Thermometer and sensors are the same for both, and so are the errors of their calibration.

    Attributes
    ----------
    heating, cooling : RecordDraws
        Of S draws each.
    """

    heating: RecordDraws
    cooling: RecordDraws

    def of(self, branch: Branch) -> RecordDraws:
        """Draws of one branch."""
        return self.heating if branch is Branch.HEATING else self.cooling

    @property
    def condition(self) -> str:
        """Id of the condition."""
        return self.heating.condition.id

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels that both have, stiffness included where it follows from force and displacement."""
        return tuple(c for c in self.heating.quantities if c in self.cooling.quantities)

    @property
    def measured(self) -> tuple[float, float]:
        """Lowest and highest temperature of either branch [unit of temperature]."""
        low = min(self.heating.coldest, self.cooling.coldest)
        return low, max(self.heating.hottest, self.cooling.hottest)

    def drawn(self, size: int, rng: np.random.Generator) -> BothDraws:
        """So many of the draws of either branch, paired at random; some several times where there are fewer."""

        def some(d: RecordDraws) -> RecordDraws:
            fewer = d.size < size
            return d.subset(rng.integers(0, d.size, size) if fewer else rng.permutation(d.size)[:size])

        heating = some(self.heating)
        return BothDraws(heating, sharing_calibration(some(self.cooling), heating))

    def with_unseen_misfit(self, rng: np.random.Generator) -> BothDraws:
        """Curves that may miss what their readings do not show; see `sma_bayes.assess.unseen_misfit`."""
        return BothDraws(*(with_unseen_misfit(d, rng) for d in (self.heating, self.cooling)))

    def derived(self, channel: str) -> bool:
        """Whether a channel follows from the slopes of two others."""
        return channel == "stiffness" and channel not in self.heating.channels


def share_of(draws: RecordDraws, temperature: Floats, *, median: bool = False) -> Floats:
    """Share of austenite on the curve of a branch, by the displacement where there is one, else by the force.

    Parameters
    ----------
    draws : RecordDraws
    temperature : ndarray, shape (m,) or (S, m)
    median : bool
        Of the medians of the parameters, (m,), in place of all draws, (S, m).
    """
    theta = np.median(draws.curve_theta, axis=0) if median else draws.curve_theta
    return list(_phases(draws, theta, temperature).values())[-1].share


def _phases(draws: RecordDraws, theta: Floats, temperature: Floats) -> dict[str, ChannelCurve]:
    """Force and displacement between the lines of their phases."""
    model = draws.posterior.model
    inputs = {"temperature": temperature} | ({SLOPED: np.ones(1)} if model.sloped else {})

    def response(given: Mapping[str, Floats]) -> dict[str, Floats]:
        with np.errstate(over="ignore", invalid="ignore"):
            return model.predict(theta, {"temperature": given["temperature"]})

    return curves(response, inputs)[1]


@dataclass(frozen=True, eq=False)
class CurveTable:
    """Curves of one branch on a fine grid.

    Attributes
    ----------
    low, step : float
        First temperature and distance to the next.
    values : mapping of str to ndarray, shape (S, m)
        By channel, and ``share``; see `COLD_PREFIX` and `SPAN_PREFIX`.
    """

    low: float
    step: float
    values: Mapping[str, Floats]

    @cached_property
    def _places(self) -> Floats:
        """Temperature at even log odds of the share, shape (S, k)."""
        share = np.clip(self.values[SHARE], 1e-12, 1.0 - 1e-12)
        odds = np.maximum.accumulate(logit(share), axis=1)
        grid = self.low + self.step * np.arange(odds.shape[1])
        even = np.arange(-MAX_LOG_ODDS, MAX_LOG_ODDS + LOG_ODDS_STEP, LOG_ODDS_STEP)
        return np.stack([np.interp(even, own, grid) for own in odds])

    def where(self, share: Floats) -> Floats:
        """Temperature at which the curve has a share, of each draw, shape (S,) or (S, m)."""
        odds = logit(np.clip(share, 1e-12, 1.0 - 1e-12))
        place = (odds + MAX_LOG_ODDS) / LOG_ODDS_STEP
        return _between(self._places, place, _rows(len(self._places), place))


def _rows(draws: int, place: Floats) -> Ints:
    """Numbers of the draws, in the shape that goes with places of each draw."""
    return np.arange(draws).reshape(-1, *(1,) * (np.ndim(place) - 1))


def _between(table: Floats, place: Floats, row: Ints) -> Floats:
    """Values of rows of a table (R, k) at places between its columns; at its ends beyond."""
    place = np.minimum(np.maximum(place, 0.0), table.shape[1] - 1.000001)
    below = place.astype(np.intp)
    part = place - below
    first = row * table.shape[1] + below
    flat = table.reshape(-1)
    return np.asarray(flat.take(first) * (1.0 - part) + flat.take(first + 1) * part)


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """Where the alloy stands between its branches, for each of S draws, or for each at m instants.

    Attributes
    ----------
    heating : ndarray of bool
        Whether the curve of heating holds.
    turned_at : ndarray
        Share that the curve of this branch has where the temperature turned.
    reached : ndarray
        Share that was reached there.
    apart : mapping of str to ndarray
        What was reached there less that curve, by channel, and of the share.
    """

    heating: Bools
    turned_at: Floats
    reached: Floats
    apart: Mapping[str, Floats]

    def part(self, draws: slice) -> State:
        """Some of the draws."""
        apart = {name: values[draws] for name, values in self.apart.items()}
        return State(self.heating[draws], self.turned_at[draws], self.reached[draws], apart)

    def joined(self, turned: Bools, other: State) -> State:
        """The same but for draws that have turned."""
        return State(
            np.where(turned, other.heating, self.heating),
            np.where(turned, other.turned_at, self.turned_at),
            np.where(turned, other.reached, self.reached),
            {c: np.where(turned, other.apart[c], values) for c, values in self.apart.items()},
        )


@dataclass(frozen=True, eq=False)
class Spring:
    """Curves of both branches and the rule that joins them.

    Attributes
    ----------
    draws : BothDraws
    tables : mapping of Branch to CurveTable
        On one grid.
    rule : str
        One of `RULES`.
    """

    draws: BothDraws
    tables: Mapping[Branch, CurveTable]
    rule: Rule = "proportional"

    @staticmethod
    def over(draws: BothDraws, low: float, high: float, rule: Rule = "proportional") -> Spring:
        """Tabulate curves between two temperatures."""
        count = int(np.clip((high - low) / TEMPERATURE_STEP, 50, MAX_NODES)) + 1
        grid = np.linspace(low, high, count)
        tables = {}
        for branch in Branch:
            own = draws.of(branch)
            values = {SHARE: share_of(own, grid)}
            values |= {c: own.curve(c, grid) for c in draws.channels if not draws.derived(c)}
            if own.posterior.model.sloped:
                for c, phases in _phases(own, own.curve_theta, grid).items():
                    values |= {COLD_PREFIX + c: phases.cold, SPAN_PREFIX + c: phases.span}
            tables[branch] = CurveTable(low, float(grid[1] - grid[0]), values)
        return Spring(draws, tables, rule)

    def part(self, some: slice, rule: Rule) -> Spring:
        """Some of the draws, under a rule."""
        own = BothDraws(*(d.subset(some) for d in (self.draws.heating, self.draws.cooling)))
        tables = {
            b: replace(t, values={n: v[some] for n, v in t.values.items()}) for b, t in self.tables.items()
        }
        return Spring(own, tables, rule)

    @property
    def kept(self) -> tuple[str, ...]:
        """What is carried over a turn: the share, and channels that are no slope of others."""
        names = self.tables[Branch.HEATING].values
        return tuple(name for name in names if not name.startswith((COLD_PREFIX, SPAN_PREFIX)))

    @property
    def size(self) -> int:
        """Number of draws."""
        return len(self.tables[Branch.HEATING].values[SHARE])

    def begin(self, heating: bool) -> State:
        """On the curve of a branch itself."""
        none = np.zeros(self.size)
        return State(np.full(self.size, heating), none, none, dict.fromkeys(self.kept, none))

    @cached_property
    def _of_both(self) -> Mapping[str, Floats]:
        """Curves of cooling, and below them those of heating, shape (2 S, m)."""
        up, down = (self.tables[b].values for b in (Branch.HEATING, Branch.COOLING))
        return {name: np.concatenate([down[name], up[name]]) for name in up}

    def curve(self, name: str, temperature: Floats, heating: Bools) -> Floats:
        """Curve of the branch that holds; beyond the grid as at its ends."""
        table = self.tables[Branch.HEATING]
        place = (temperature - table.low) / table.step
        return _between(self._of_both[name], place, _rows(self.size, place) + self.size * heating)

    def fade(self, temperature: Floats, state: State) -> Floats:
        """Share of the difference at the turn that is left, from 1 to 0."""
        return self._left(self.curve(SHARE, temperature, state.heating), state)

    def _left(self, share: Floats, state: State) -> Floats:
        """What `fade` tells, by the share on the curve of the branch that holds."""
        rest = np.where(state.heating, 1.0 - share, share)
        whole = np.where(state.heating, 1.0 - state.turned_at, state.turned_at)
        left = np.minimum(np.maximum(rest / np.maximum(whole, NEGLIGIBLE_SHARE), 0.0), 1.0)
        if self.rule == "proportional":
            return left
        whole = state.turned_at - state.reached
        apart = np.abs(whole) > NEGLIGIBLE_SHARE
        return np.where(apart, np.clip((share - state.reached) / np.where(apart, whole, 1.0), 0.0, 1.0), left)

    def share(self, temperature: Floats, state: State) -> Floats:
        """Share of austenite."""
        own = self.curve(SHARE, temperature, state.heating)
        return np.minimum(np.maximum(own + state.apart[SHARE] * self._left(own, state), 0.0), 1.0)

    def alike(self, temperature: Floats, state: State) -> Floats:
        """Temperature at which the branch that holds has the share of austenite that there is."""
        own = self.curve(SHARE, temperature, state.heating)
        share = self.share(temperature, state)
        up, down = (self.tables[b].where(share) for b in (Branch.HEATING, Branch.COOLING))
        there = np.where(state.heating, up, down)
        return np.where(np.abs(share - own) > SHARE_TOLERANCE, there, temperature)

    def value(self, name: str, temperature: Floats, state: State) -> Floats:
        """Channel that is no slope of others at temperatures [its unit]."""
        return np.asarray(
            self.at_share(name, temperature, state) + state.apart[name] * self.fade(temperature, state)
        )

    def at_share(self, name: str, temperature: Floats, state: State) -> Floats:
        """Channel that the branch has at the share of austenite that there is, its phases at the temperature."""
        there = self.alike(temperature, state)
        own = self.curve(name, there, state.heating)
        if COLD_PREFIX + name not in self.tables[Branch.HEATING].values:
            return own
        here, away = (
            self.curve(COLD_PREFIX + name, t, state.heating)
            + self.share(temperature, state) * self.curve(SPAN_PREFIX + name, t, state.heating)
            for t in (temperature, there)
        )
        return np.asarray(own + here - away)

    def turned(self, temperature: Floats, state: State) -> State:
        """State after the temperature has turned here."""
        reached = self.share(temperature, state)
        on_curve = self.curve(SHARE, temperature, ~state.heating)
        fresh = State(
            ~state.heating,
            on_curve,
            reached,
            dict.fromkeys(self.kept, np.zeros_like(reached)) | {SHARE: reached - on_curve},
        )
        apart = {
            name: self.value(name, temperature, state) - self.at_share(name, temperature, fresh)
            for name in self.kept
            if name != SHARE
        }
        return replace(fresh, apart={**fresh.apart, **apart})

    def stiffness(self, temperature: Floats, state: State) -> Floats:
        """Slope dF/dX along the path (S, m), as the branch has it at the share of austenite that there is."""
        there = self.alike(temperature, state)
        up, down = (self.draws.of(b).curve("stiffness", there) for b in (Branch.HEATING, Branch.COOLING))
        return np.where(state.heating, up, down)

    def channel(self, name: str, temperature: Floats, state: State) -> Floats:
        """Channel at temperatures (S, m), stiffness also where it is a slope."""
        return (
            self.stiffness(temperature, state)
            if self.draws.derived(name)
            else self.value(name, temperature, state)
        )

    def reading(self, name: str, temperature: Floats, state: State, rng: np.random.Generator) -> Floats:
        """A new reading of a measured channel (S, m), noise included."""
        clean = self.value(name, temperature, state)
        noises = {}
        for branch in Branch:
            draws = self.draws.of(branch)
            posterior = draws.posterior
            series = posterior.noise.draw(
                rng, posterior.noise_shape(draws.theta, 0, name), Steps.apart(clean.shape[1])
            )
            noises[branch] = series * posterior.noise_scale(draws.theta, 0, name, clean)
            noises[branch] = noises[branch] + posterior.of_new_sweeps(rng, draws.theta, 0, name, temperature)
        return np.asarray(clean + np.where(state.heating, noises[Branch.HEATING], noises[Branch.COOLING]))
