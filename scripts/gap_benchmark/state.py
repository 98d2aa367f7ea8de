"""What mechanisms see and change, and the stages of a simulation in which they act."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from gap_benchmark.designs import Course, sweeps
from gap_benchmark.spring import CHANNELS, Floats

Traits = Mapping[str, float]
"""Properties of a mechanism besides its size, drawn for each campaign."""


class Stage(IntEnum):
    """Where in the chain from current to file a mechanism acts."""

    HEAT = 0
    KINETICS = 1
    MECHANICS = 2
    INSTRUMENT = 3
    DIGITISER = 4


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """One condition, finely in time.

    Attributes
    ----------
    course : Course
    z : ndarray, shape (k, m)
        Logit of the fraction of austenite, of k parts of the spring.
    weights : ndarray, shape (k,)
        Shares of the parts; their sum is 1.
    force, displacement : ndarray, shape (m,)
        [N], [m].
    reading : ndarray, shape (m,)
        What the temperature sensor says [degC].
    """

    course: Course
    z: Floats
    weights: Floats
    force: Floats
    displacement: Floats
    reading: Floats

    @property
    def fraction(self) -> Floats:
        """Fraction of austenite of the whole spring, shape (m,)."""
        return self.weights @ expit(self.z)


Act = Callable[[State, float, Traits], State]
Draw = Callable[[np.random.Generator], Traits]


def no_traits(rng: np.random.Generator) -> Traits:
    """Of a mechanism that its size says everything about."""
    return {}


@dataclass(frozen=True, slots=True)
class Mechanism:
    """Something that happens on the rig and that the plain model does not know.

    Attributes
    ----------
    id : str
    stage : Stage
    act : callable
        State, size and traits to the state with the mechanism; of a digitiser, see `Readings`.
    unit : str
        Of the size.
    low, high : float
        Physical range of the size.
    traits : callable
        Draws the other properties.
    limit : float
        Greatest size that makes sense at all; where nothing is said, ten times what is in range is tried.
    """

    id: str
    stage: Stage
    act: Act
    unit: str
    low: float
    high: float
    traits: Draw = no_traits
    limit: float = np.inf


@dataclass(frozen=True, slots=True)
class Hidden:
    """A mechanism of a certain size in a campaign."""

    mechanism: Mechanism
    size: float
    traits: Traits


@dataclass(frozen=True, slots=True, eq=False)
class Readings:
    """One condition as the instruments see it, shape (n,) each, in order of time.

    Attributes
    ----------
    course : Course
    heating : ndarray of bool
        Branch as the measured temperature shows it.
    sweep : ndarray of int
        Number of the sweep, from 0.
    channels : dict
        ``temperature`` [degC], ``force`` [N], ``displacement`` [m].
    """

    course: Course
    heating: NDArray[np.bool_]
    sweep: NDArray[np.int64]
    channels: Mapping[str, Floats]


def simulate(course: Course, hidden: Sequence[Hidden] = ()) -> Readings:
    """Readings of one condition, before noise and digitisers."""
    acts = sorted(hidden, key=lambda h: h.mechanism.stage)
    state = at_rest(course)
    for h in acts:
        if h.mechanism.stage == Stage.HEAT:
            state = at_rest(_turned(h.mechanism.act(state, h.size, h.traits).course))
    for h in acts:
        if h.mechanism.stage == Stage.KINETICS:
            state = h.mechanism.act(state, h.size, h.traits)
    state = with_channels(state)
    for h in acts:
        if h.mechanism.stage in (Stage.MECHANICS, Stage.INSTRUMENT):
            state = h.mechanism.act(state, h.size, h.traits)
    at = course.samples
    channels = {
        "temperature": state.reading[at], "force": state.force[at], "displacement": state.displacement[at]
    }  # fmt: skip
    sweep = sweeps(channels["temperature"], course.sweep[at])
    return Readings(state.course, sweep % 2 == 0, sweep, channels)


def at_rest(course: Course) -> State:
    """State of a spring that follows its temperature at once, and of a true sensor."""
    z = course.spring.logit(course.temperature, course.heating)[None]
    nothing = np.zeros(course.time.size)
    return State(course, z, np.ones(1), nothing, nothing, course.temperature)


def _turned(course: Course) -> Course:
    """A course whose branches begin where its temperature turns."""
    found = sweeps(course.temperature[course.samples], course.sweep[course.samples])
    return replace(course, sweep=np.repeat(found, np.diff([*course.samples, course.time.size])))


def with_channels(state: State) -> State:
    """Force and displacement of the fractions."""
    spring, heating = state.course.spring, state.course.heating
    force, displacement = (state.weights @ spring.read(c, state.z, heating) for c in CHANNELS)
    return replace(state, force=force, displacement=displacement)
