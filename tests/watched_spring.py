"""Cycles of a spring, quiet or with a fault, made by mechanisms that are none of the package's formulae.

The transformed share of `GRAINS` is that of many grains with skewed temperatures (Gumbel); sweeps repeat as a rig does,
readings have noise with a memory, and the thermometer errs. `PLAIN` is a spring that is fitted in seconds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

HEADER = "time_s,temperature_C,force_N,displacement_mm"
TOML = """\
[campaign]
name = "rig"
[columns]
time = { name = "time_s", unit = "s" }
temperature = { name = "temperature_C", unit = "degC" }
{force}displacement = { name = "displacement_mm", unit = "mm" }
[[condition]]
id = "rig"
file = "fitted.csv"
"""
FORCE = 'force = { name = "force_N", unit = "N" }\n'
AMBIENT = 22.0
NOISE = {"force": 0.006, "displacement": 0.04}
"""Standard deviations of readings [N, mm]."""

Cycle = dict[str, np.ndarray]
Fault = Callable[[int, Cycle], Cycle]
"""Changes what the sensors read in the n-th cycle since its onset (from 1)."""


def grains(away: np.ndarray) -> np.ndarray:
    """Transformed share against the temperature from the middle: skewed, and some of it along a straight line."""
    skewed = np.exp(-np.exp(-(away + 2.0) / 5.5))
    return np.asarray(0.93 * skewed + 0.07 * np.clip((away + 30.0) / 60.0, 0.0, 1.0))


def logistic(away: np.ndarray) -> np.ndarray:
    """The published curve."""
    return np.asarray(1.0 / (1.0 + np.exp(-away / 4.0)))


@dataclass(frozen=True)
class Rig:
    """A spring and the rig that it is measured on.

    `shift` [K], `stroke` and `zero` (over the stroke) are standard deviations from sweep to sweep.
    """

    share: Callable[[np.ndarray], np.ndarray]
    channels: tuple[str, ...]
    samples: int
    memory: float
    thermometer: float
    shift: float
    stroke: float
    zero: float

    def cycle(self, rng: np.random.Generator, *, worn: float = 0.0, moved: float = 0.0) -> Cycle:
        """What the sensors read in one cycle.

        `worn` is the share of the alloy that does not transform any more and stays martensite, `moved` the rise of all
        transformation temperatures [K].
        """
        parts: dict[str, list[np.ndarray]] = {k: [] for k in ("temperature", "force", "displacement")}
        for step, middle in ((1, 60.0), (-1, 47.0)):
            t = np.linspace(25.0, 95.0, self.samples)[::step] + rng.uniform(-0.3, 0.3, self.samples)
            s = self.share(t - middle - moved - self.shift * rng.standard_normal()) * (1.0 - worn)
            s = (1.0 + self.stroke * rng.standard_normal()) * s
            zero = self.zero * rng.standard_normal()
            clean = {"force": 0.6 + 3.0 * (s + zero), "displacement": 2.0 + 18.0 * (s - zero)}
            for channel, values in clean.items():
                white = rng.standard_normal(self.samples + 20)
                noise = lfilter([np.sqrt(1.0 - self.memory**2)], [1.0, -self.memory], white)[20:]
                parts[channel].append(values + NOISE[channel] * noise)
            parts["temperature"].append(t + self.thermometer * rng.standard_normal(self.samples))
        read = {k: np.concatenate(v) for k, v in parts.items()}
        return {"time": np.arange(2.0 * self.samples), **read}

    def campaign(self, folder: Path, rng: np.random.Generator, cycles: int) -> Path:
        """A campaign of so many quiet cycles."""
        write(folder / "fitted.csv", [self.cycle(rng) for _ in range(cycles)])
        text = TOML.replace("{force}", FORCE if "force" in self.channels else "")
        (folder / "campaign.toml").write_text(text, encoding="utf-8")
        return folder


GRAINS = Rig(grains, ("force", "displacement"), 60, 0.5, 0.15, 0.15, 0.004, 0.004)
PLAIN = Rig(logistic, ("displacement",), 25, 0.0, 0.0, 0.02, 0.001, 0.001)


def write(path: Path, cycles: list[Cycle]) -> Path:
    """Write cycles as a logger does, one after the other."""
    lines, begins = [HEADER], 0.0
    for c in cycles:
        rows = zip(c["time"] + begins, c["temperature"], c["force"], c["displacement"], strict=True)
        lines += [",".join(f"{v:.6g}" for v in row) for row in rows]
        begins += float(c["time"][-1]) + 1.0
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def quiet(n: int, read: Cycle) -> Cycle:
    """No fault."""
    return read


def offset_drift(n: int, read: Cycle) -> Cycle:
    """The zero of the displacement sensor creeps, fast at first."""
    return {**read, "displacement": read["displacement"] + 0.12 * n**0.7}


def force_gain(n: int, read: Cycle) -> Cycle:
    """A bridge of the load cell has come loose: 4 % less, and a little bent."""
    return {**read, "force": 0.96 * read["force"] - 0.0005 * read["force"] ** 2}


def loose_thermocouple(n: int, read: Cycle) -> Cycle:
    """The thermocouple reads between metal and air."""
    return {**read, "temperature": read["temperature"] - 0.03 * (read["temperature"] - AMBIENT)}
