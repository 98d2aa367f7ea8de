"""Campaigns as they would be planned: conditions, drive, sampling.

In a slow sweep (`standard` and its kin) the power rises and falls as a raised cosine, so that the rate dT/dt differs
along the sweep and between conditions, by frequency and peak; currents are set, not sampled, so temperature is an
input only. In `thermal`, the paper's square wave, and in `thermal_slow` the current is sampled and held from sample to
sample, and temperature is an outcome with noise of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gap_benchmark.heating import Wire, warm
from gap_benchmark.spring import Floats, Spring, another, bench_spring, wide_spring

GRAVITY = 9.80665
FINE = 4
"""Steps of the simulation between two samples."""
SEARCH = 400
"""Steps a period in which turning points are looked for."""

Sampling = Callable[[float, float, bool, np.random.Generator], Floats]
"""Instants [s] of a branch from its start to its end, told whether it is heating; the first is the start."""


@dataclass(frozen=True, slots=True)
class Setting:
    """What is set in one condition.

    Attributes
    ----------
    id : str
    load : float
        [N].
    frequency : float
        [Hz].
    peaks : tuple of float
        Steady temperature [degC] of the greatest power of each cycle, at the mean ambient temperature.
    duty : float
        Share of the period in which a square drive is on; 0.5 for a raised cosine.
    ambient : float
        Mean [degC].
    """

    id: str
    load: float
    frequency: float
    peaks: tuple[float, ...]
    ambient: float
    duty: float = 0.5


@dataclass(frozen=True, slots=True)
class Design:
    """A planned campaign.

    Attributes
    ----------
    settings : tuple of Setting
    sampling : callable
    square : bool
        Whether the drive is a square wave; else a raised cosine.
    sampled : bool
        Whether the current is sampled, and held until the next sample; else it is only known as it was set.
    spring : callable
        Draws a spring.
    pooled : bool
        Whether all conditions show the same curves.
    noise : float
        Standard deviation of the noise, over the span of the channel.
    temperature_noise : float
        Of a temperature reading [K].
    """

    settings: tuple[Setting, ...]
    sampling: Sampling
    square: bool = False
    sampled: bool = False
    spring: Callable[[np.random.Generator], Spring] = bench_spring
    pooled: bool = True
    noise: float = 0.005
    temperature_noise: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """What happens to the wire in one condition, finely in time.

    Attributes
    ----------
    setting : Setting
    spring : Spring
    wire : Wire
    time, current, ambient, temperature : ndarray, shape (m,)
        [s], [A], [degC] recorded, [degC] of the metal at the middle of the spring.
    sweep : ndarray of int, shape (m,)
        Number of the sweep between extremes of the temperature, from 0; even ones are heating.
    samples : ndarray of int, shape (n,)
        Which of the m instants are sampled.
    held : bool
        Whether current and ambient temperature are held from one instant to the next.
    zero : float
        Ambient temperature [degC] at which the load cell was zeroed.
    """

    setting: Setting
    spring: Spring
    wire: Wire
    time: Floats
    current: Floats
    ambient: Floats
    temperature: Floats
    sweep: NDArray[np.int64]
    samples: NDArray[np.int64]
    held: bool
    zero: float

    @property
    def heating(self) -> NDArray[np.bool_]:
        """Whether the metal is on its heating branch."""
        on: NDArray[np.bool_] = self.sweep % 2 == 0
        return on

    @property
    def cycle(self) -> Floats:
        """Number of the cycle, from 1."""
        return np.asarray(1.0 + self.sweep // 2, dtype=float)

    @property
    def power(self) -> Floats:
        """I^2 R [W]."""
        return self.current**2 * self.wire.resistance

    @property
    def rate(self) -> Floats:
        """dT/dt of the metal [K/s]."""
        return np.asarray(np.gradient(self.temperature, self.time), dtype=float)


def even(start: float, stop: float, heating: bool, rng: np.random.Generator, n: int = 100) -> Floats:
    """A hundred equal steps a branch."""
    return np.linspace(start, stop, n, endpoint=False)


def uneven(start: float, stop: float, heating: bool, rng: np.random.Generator) -> Floats:
    """Fewer samples on heating than on cooling, with steps that differ up to fivefold."""
    steps = rng.uniform(0.4, 2.0, 60 if heating else 140)
    share: Floats = np.concatenate([[0.0], np.cumsum(steps)[:-1]]) / steps.sum()
    return start + (stop - start) * share


def courses(design: Design, seed: int) -> tuple[Course, ...]:
    """Simulate the heating of every condition of a design.

    Parameters
    ----------
    design : Design
    seed : int
        Of the spring, of the room and of uneven sampling.
    """
    rng = np.random.default_rng([seed, 1])
    spring = design.spring(rng)
    springs = [spring if design.pooled else another(spring, rng) for _ in design.settings]
    phase = rng.uniform(0.0, 2.0 * np.pi)
    return tuple(
        _course(design, s, spring, phase + 2.0 * i, rng)
        for i, (s, spring) in enumerate(zip(design.settings, springs, strict=True))
    )


def _course(
    design: Design, setting: Setting, spring: Spring, phase: float, rng: np.random.Generator
) -> Course:
    wire = Wire()
    period = 1.0 / setting.frequency
    turns = _turns(design, setting, wire, phase)
    instants = [design.sampling(a, b, i % 2 == 0, rng) for i, (a, b) in enumerate(pairwise(turns))]
    sampled = np.concatenate(instants)
    ends = np.append(sampled[1:], turns[-1])
    time = (sampled[:, None] + (ends - sampled)[:, None] * np.arange(FINE) / FINE).ravel()
    applied = np.repeat(sampled, FINE) if design.sampled else time
    ambient = _room(setting, phase, applied, period * len(setting.peaks))
    power = _power(design, setting, wire, applied)
    temperature = warm(wire, power, ambient, time, ambient[0], held=design.sampled)
    planned = np.repeat(np.arange(len(instants)), [i.size for i in instants])
    branch = np.repeat(sweeps(temperature[::FINE], planned), FINE)
    return Course(
        setting, spring, wire, time, np.sqrt(power / wire.resistance), ambient, temperature,
        sweep=branch, samples=np.arange(sampled.size) * FINE, held=design.sampled, zero=22.0,
    )  # fmt: skip


def sweeps(reading: Floats, planned: NDArray[np.int64]) -> NDArray[np.int64]:
    """Number the sweeps of a reading, from 0, heating first.

    They begin at its extremes, one near the start of each of the `planned` sweeps; all arrays (n,).
    """
    starts = np.flatnonzero(np.diff(planned)) + 1
    reach = int(np.min(np.diff([0, *starts, reading.size]))) // 2
    found = np.zeros(reading.size, dtype=np.int64)
    for start in starts.tolist():
        near = reading[start - reach : start + reach]
        falls = planned[start] % 2 == 1
        found[start - reach + int(np.argmax(near) if falls else np.argmin(near))] = 1
    return np.cumsum(found)


def _room(setting: Setting, phase: float, time: Floats, length: float) -> Floats:
    """Ambient temperature: a slow wave, not in step with the cycles."""
    return setting.ambient + 1.5 * np.sin(2.0 * np.pi * 1.37 * time / length + phase)


def _power(design: Design, setting: Setting, wire: Wire, time: Floats) -> Floats:
    turn = time * setting.frequency
    turn = np.where(np.abs(turn - np.round(turn)) < 1e-9, np.round(turn), turn)
    cycle = np.minimum(np.floor(turn).astype(int), len(setting.peaks))
    peaks = np.array([*setting.peaks, setting.peaks[0]])
    top = (peaks[cycle] - setting.ambient) * wire.loss
    on = turn - np.floor(turn) < setting.duty - 1e-9
    share = on.astype(float) if design.square else np.sin(np.pi * turn) ** 2
    return np.asarray(top * share, dtype=float)


def _turns(design: Design, setting: Setting, wire: Wire, phase: float) -> list[float]:
    """Instants at which the temperature turns, from the start to the last minimum."""
    period, cycles = 1.0 / setting.frequency, len(setting.peaks)
    if design.square:
        starts = [(k * period, (k + setting.duty) * period) for k in range(cycles)]
        return [t for pair in starts for t in pair] + [cycles * period]
    time = np.arange((cycles + 0.5) * SEARCH) * period / SEARCH
    ambient = _room(setting, phase, time, period * cycles)
    temperature = warm(wire, _power(design, setting, wire, time), ambient, time, ambient[0], held=False)
    turns = [0.0]
    for k in range(cycles):
        top = k * SEARCH + int(np.argmax(temperature[k * SEARCH : (k + 1) * SEARCH]))
        foot = top + int(np.argmin(temperature[top : top + SEARCH]))
        turns += [float(time[top]), float(time[foot])]
    return turns


def _settings(
    frequencies: tuple[float, float, float],
    peaks: tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]],
    duties: tuple[float, float, float] = (0.5, 0.5, 0.5),
) -> tuple[Setting, ...]:
    """Three conditions; load, frequency and room do not go hand in hand."""
    grams, rooms = (150, 100, 200), (22.5, 24.0, 20.5)
    return tuple(
        Setting(f"{g}g", 1e-3 * g * GRAVITY, f, p, room, duty)
        for g, f, p, room, duty in zip(grams, frequencies, peaks, rooms, duties, strict=True)
    )


SLOW = (1.0e-3, 1.7e-3, 2.8e-3)
STANDARD = _settings(SLOW, ((80.0,) * 5, (100.0,) * 5, (120.0,) * 5))
ONCE = _settings(SLOW, ((80.0,), (100.0,), (120.0,)))
LADDER = _settings(
    SLOW, ((64.0, 70.0, 76.0, 84.0, 95.0), (68.0, 76.0, 84.0, 95.0, 110.0), (72.0, 80.0, 90.0, 105.0, 120.0))
)
PULSES = _settings((0.01,) * 3, ((110.0,) * 5, (125.0,) * 5, (140.0,) * 5), (0.5, 0.4, 0.35))
HOURS = _settings((3e-4, 5e-4, 8e-4), ((110.0,) * 5, (125.0,) * 5, (140.0,) * 5))

DESIGNS = {
    "standard": Design(STANDARD, even),
    "unequal_sampling": Design(STANDARD, uneven),
    "single_condition": Design(STANDARD[1:2], even),
    "unpooled": Design(STANDARD, even, pooled=False),
    "one_cycle": Design(ONCE, even),
    "ladder": Design(LADDER, even),
    "thermal": Design(
        PULSES, even, square=True, sampled=True, spring=wide_spring, noise=0.01, temperature_noise=0.15
    ),
    "thermal_slow": Design(HOURS, even, sampled=True, spring=wide_spring, noise=0.02, temperature_noise=0.3),
}
"""Designs by name. `ladder` varies the peak temperature from cycle to cycle, with incomplete transformation."""
