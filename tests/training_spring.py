"""Cycles of a spring that trains by laws of its own: none of them, and no curve, is one of the package's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sma_bayes.records.types import Branch, Condition, Record

SAMPLES = 40
NOISE = 0.004
"""Standard deviation of a reading [spans]."""
STROKE = {"force": 3.0, "displacement": 0.02}
"""[N], [m]"""
FOLLOWS = {"force": 0.5, "displacement": 1.0}
"""How much of the training each channel shows."""
UNITS = {"temperature": "degC", "force": "N", "displacement": "m", "cycle": "1", "segment": "1"}


@dataclass(frozen=True)
class Truth:
    """What trains: numbers of each cycle (cycles, 4) by branch, about which sweeps scatter, and those of the sweeps."""

    state: dict[Branch, np.ndarray]
    sweep: dict[Branch, np.ndarray]


def settled(cycle: np.ndarray, pace: float, slow: float) -> np.ndarray:
    """Two processes side by side: one that is over soon, and one four times as slow."""
    return 1.0 - (1.0 - slow) * np.exp(-cycle / pace) - slow / (1.0 + cycle / (4.0 * pace)) ** 1.5


def draw_truth(rng: np.random.Generator, cycles: int, scatter: float = 1.0) -> Truth:
    """Each number has a size, and all nearly one pace; offset [spans], ln stroke, shift [K], ln width."""
    n = np.arange(cycles, dtype=float)
    pace, slow = rng.uniform(2.0, 8.0), rng.uniform(0.1, 0.5)
    state, sweep = {}, {}
    for branch in Branch:
        own = pace * np.exp(0.15 * rng.standard_normal(4))
        size = np.array([0.2, 0.15, 8.0, 0.3]) * rng.standard_normal(4)
        state[branch] = np.column_stack([s * settled(n, p, slow) for s, p in zip(size, own, strict=True)])
        sd = scatter * np.array([0.003, 0.004, 0.15, 0.01])
        sweep[branch] = state[branch] + sd * rng.standard_normal((cycles, 4))
    return Truth(state, sweep)


def curve(
    numbers: np.ndarray,
    temperature: np.ndarray,
    branch: Branch,
    channel: str,
    turned: float | np.ndarray = 0.0,
) -> np.ndarray:
    """A Gompertz curve with four numbers, shape (..., n); force changes half as much, which changes the stiffness.

    `turned` (...) is the share of the curve that bends at the other end: none of the four numbers changes that.
    """
    numbers = numbers * FOLLOWS[channel]
    a, g, d, w = (numbers[..., i, None] for i in range(4))
    at = (temperature - _middle(branch) - d) / (5.0 * np.exp(w))
    share = np.exp(-np.log(2.0) * np.exp(-at))
    other = 1.0 - np.exp(-np.log(2.0) * np.exp(at))
    share = share + np.asarray(turned)[..., None] * (other - share)
    return STROKE[channel] * (0.5 + a + np.exp(g) * (share - 0.5))


def start_and_finish(numbers: np.ndarray, branch: Branch, turned: float = 0.0) -> tuple[float, float]:
    """Where the steepest tangent to one displacement crosses the levels of its plateaus."""
    t = np.linspace(-100.0, 300.0, 400_001)
    y = curve(numbers, t, branch, "displacement", turned)
    slopes = np.gradient(y, t)
    steepest = np.argmax(np.abs(slopes))
    low, high = (float(t[steepest] + (y[i] - y[steepest]) / slopes[steepest]) for i in (0, -1))
    return low, high


def about_mean(
    numbers: np.ndarray, ends: tuple[float, float], branch: Branch, channel: str
) -> dict[str, np.ndarray]:
    """Offset, stroke, shift and width of sweeps, shape (n,), about the curve with their mean numbers between two ends.

    Each sweep is where the mean one is at its middle, halfway between its values at the ends.
    """
    mean, (_, g, d, w) = numbers.mean(axis=0), numbers.T * FOLLOWS[channel]
    t = np.linspace(*ends, 100_001)
    there = curve(mean, t, branch, channel)
    halfway = float(np.interp(0.5 * (there[0] + there[-1]), there, t))
    by = (halfway - _middle(branch) - d.mean()) / np.exp(w.mean())
    when = _middle(branch) + d + by * np.exp(w)
    level = np.array([curve(n, at[None], branch, channel)[0] for n, at in zip(numbers, when, strict=True)])
    stroke = (there[-1] - there[0]) * np.exp(g - g.mean())
    return {"offset": level, "stroke": stroke, "shift": when - halfway, "width": np.exp(w - w.mean())}


def _middle(branch: Branch) -> float:
    return 60.0 if branch is Branch.HEATING else 45.0


def measured(
    truth: Truth,
    rng: np.random.Generator,
    channels: tuple[str, ...] = ("displacement",),
    noise: float = NOISE,
    ends: tuple[float, float] = (20.0, 95.0),
    turned: float | np.ndarray = 0.0,
) -> list[Record]:
    """One record a branch; force and displacement train alike. `turned` of each cycle, see `curve`."""
    records = []
    for branch in Branch:
        cycles = len(truth.sweep[branch])
        t = np.linspace(*ends, SAMPLES) + rng.uniform(-0.3, 0.3, (cycles, SAMPLES))
        t = t if branch is Branch.HEATING else t[:, ::-1]
        observed = {
            c: curve(truth.sweep[branch], t, branch, c, turned).ravel()
            + noise * STROKE[c] * rng.standard_normal(t.size)
            for c in channels
        }
        cycle = np.repeat(np.arange(1.0, cycles + 1.0), SAMPLES)
        inputs = {"temperature": t.ravel(), "cycle": cycle, "segment": 2.0 * cycle}
        units = {k: v for k, v in UNITS.items() if k in (*inputs, *channels)}
        records.append(
            Record(Condition("bench"), branch, inputs, observed, np.arange(1, cycle.size + 1), units)
        )
    return records
