"""Springs that change from cycle to cycle, by formulae of the catalogue and by others that come near to them.

For `measure_plan.py foreign`: an advised experiment goes on with the mechanism that the spring has, whatever
explanations were fitted to it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats

Inputs = Mapping[str, Floats]
"""Temperature [degC], time [s], cycle and branch (1 heating, -1 cooling) of a history, in the order of time."""
CYCLES, SWEEP = 3, np.linspace(25.0, 75.0, 25)
STEPS: Final = (2.0, 4.0)
"""Seconds from reading to reading, of odd and of even cycles."""
LONGEST_STEP: Final = 4.0
"""Longest step that counts as a time at a temperature, over the median step; breaks are rest."""


@dataclass(frozen=True)
class Size:
    """How much a spring changes, and how fast.

    Attributes
    ----------
    change : float
        [mm].
    pace : float
        [cycles].
    noise : float
        Standard deviation of a reading [mm].
    """

    change: float
    pace: float
    noise: float

    @staticmethod
    def drawn(rng: np.random.Generator) -> Size:
        return Size(rng.uniform(0.3, 1.5), rng.uniform(0.7, 3.0), float(rng.choice([0.1, 0.2])))


def share(inputs: Inputs) -> Floats:
    """Transformed share, by the published curve."""
    middle = np.where(inputs["branch"] > 0.0, 52.0, 46.0)
    return np.asarray(1.0 / (1.0 + np.exp(-0.32 * (inputs["temperature"] - middle))))


def drift(inputs: Inputs, size: Size) -> Floats:
    """Exponential, as `training_drift` has it."""
    return np.asarray(size.change * -np.expm1((1.0 - inputs["cycle"]) / size.pace))


def two_processes(inputs: Inputs, size: Size) -> Floats:
    """A fast and a slow one."""
    done = 1.0 - inputs["cycle"]
    fast, slow = np.expm1(done / size.pace), np.expm1(done / (8.0 * size.pace))
    return np.asarray(-size.change * (0.6 * fast + 0.4 * slow))


def creep(inputs: Inputs, size: Size) -> Floats:
    """Steady, as `hot_creep` has it."""
    return 0.004 * size.change * _while_hot(inputs, np.ones(inputs["time"].size))


def primary_creep(inputs: Inputs, size: Size) -> Floats:
    """Hardening with time, as creep does at first."""
    return 0.01 * size.change * _while_hot(inputs, (1.0 + inputs["time"] / (60.0 * size.pace)) ** -0.6)


def logarithmic_stroke(inputs: Inputs, size: Size) -> Floats:
    """A stroke that grows with the logarithm of the cycles, most at its hot end."""
    return np.asarray(1.2 * size.change * share(inputs) ** 2 * np.log1p((inputs["cycle"] - 1.0) / size.pace))


def _while_hot(inputs: Inputs, slowed: Floats) -> Floats:
    step = np.diff(inputs["time"], prepend=inputs["time"][0])
    step = np.minimum(step, LONGEST_STEP * np.median(step))
    return np.asarray(np.cumsum(slowed * np.exp((inputs["temperature"] - 75.0) / 8.0) * step))


MECHANISMS: Final[dict[str, Callable[[Inputs, Size], Floats]]] = {
    m.__name__: m for m in (drift, creep, two_processes, primary_creep, logarithmic_stroke)
}


def displacement(mechanism: str, inputs: Inputs, size: Size) -> Floats:
    """Of a spring that changes [mm]."""
    return np.asarray(10.0 + 20.0 * share(inputs) + MECHANISMS[mechanism](inputs, size))


def measured_first() -> dict[str, Floats]:
    """Inputs of three cycles, each twice as fast or half as fast as the one before."""
    up = SWEEP
    cycle: Floats = np.repeat(np.arange(1.0, CYCLES + 1.0), 2 * up.size)
    step = np.where(cycle % 2.0 == 1.0, *STEPS)
    return {
        "temperature": np.tile(np.concatenate([up, up[::-1]]), CYCLES),
        "time": np.cumsum(step),
        "cycle": cycle,
        "branch": np.tile(np.repeat([1.0, -1.0], up.size), CYCLES),
    }
