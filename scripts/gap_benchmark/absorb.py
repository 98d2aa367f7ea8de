"""What is left of a mechanism once the plain model has been refitted: its size in sigma.

Force and displacement are modified sigmoids of the measured temperature on each branch, with parameters common to all
conditions or of each; temperature, where it is an outcome, is the solution of the heat balance for the recorded
current and ambient temperature, with two parameters. Written apart from the package.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.special import expit

from gap_benchmark.heating import follow
from gap_benchmark.noise import Noise
from gap_benchmark.spring import BRANCHES, CHANNELS, Floats
from gap_benchmark.state import Readings

Model = Callable[[Floats], tuple[Floats, Floats]]
"""Parameters (p,) to the values (n,) and their derivatives (n, p)."""

ITERATIONS = 60
PRECISE = 1e-10


def leftover(
    readings: Sequence[Readings], noise: Noise, sd: Mapping[str, float], *, pooled: bool
) -> dict[str, list[Floats]]:
    """Whitened residuals of each channel and condition after the refit.

    Parameters
    ----------
    readings : sequence of Readings
        Without noise.
    noise : Noise
    sd : mapping of str to float
        Standard deviation of the noise of each channel; channels that are not named are no outcome.
    pooled : bool
        Whether all conditions share their parameters.
    """
    groups = [list(readings)] if pooled else [[r] for r in readings]
    out: dict[str, list[Floats]] = {channel: [] for channel in sd}
    for group in groups:
        for channel in sd:
            model, start = _sigmoids(group, channel) if channel in CHANNELS else _balance(group)
            out[channel] += _refit(model, start, group, channel, noise, sd[channel])
    return out


def size_in_sigma(residuals: Mapping[str, Sequence[Floats]]) -> float:
    """Norm of whitened residuals over all samples and channels."""
    return float(np.sqrt(sum(float(r @ r) for parts in residuals.values() for r in parts)))


def _refit(
    model: Model, start: Floats, group: Sequence[Readings], channel: str, noise: Noise, sd: float
) -> list[Floats]:
    """Least squares of the whitened residuals by Gauss and Newton's method with halved steps."""
    data = np.concatenate([r.channels[channel] for r in group])
    cuts = np.cumsum([r.heating.size for r in group])[:-1]

    def whitened(values: Floats) -> list[Floats]:
        return [noise.whiten(part) / sd for part in np.split(values, cuts)]

    theta = start
    values, slopes = model(theta)
    residual = np.concatenate(whitened(data - values))
    for _ in range(ITERATIONS):
        scale = np.linalg.norm(slopes, axis=0)
        step = np.linalg.lstsq(np.concatenate(whitened(slopes / scale)), residual, rcond=1e-12)[0] / scale
        share, loss = 1.0, float(residual @ residual)
        while share > 1e-6:
            values, slopes = model(theta + share * step)
            trial = np.concatenate(whitened(data - values))
            if float(trial @ trial) <= loss:
                break
            share *= 0.5
        else:
            break
        theta, residual = theta + share * step, trial
        if loss - float(trial @ trial) <= PRECISE * max(loss, 1e-12):
            break
    return [np.array(part) for part in np.split(residual, cuts)]


def _sigmoids(group: Sequence[Readings], channel: str) -> tuple[Model, Floats]:
    temperature = np.concatenate([r.channels["temperature"] for r in group])
    heating = np.concatenate([r.heating for r in group])
    data = np.concatenate([r.channels[channel] for r in group])
    spring = group[0].course.spring
    start = np.concatenate(
        [
            _guess(temperature[own], data[own], spring.curves[channel, branch].rate)
            for branch, own in zip(BRANCHES, (heating, ~heating), strict=True)
        ]
    )

    def model(theta: Floats) -> tuple[Floats, Floats]:
        low, span, rate, middle = np.where(heating, theta[:4, None], theta[4:, None])
        x = expit(rate * (temperature - middle))
        bend = span * x * (1.0 - x)
        slopes = np.stack([np.ones_like(x), x, bend * (temperature - middle), -bend * rate], axis=1)
        own = heating[:, None]
        return low + span * x, np.concatenate([slopes * own, slopes * ~own], axis=1)

    return model, start


def _guess(temperature: Floats, data: Floats, rate: float) -> Floats:
    """Asymptotes from the outer readings; the midpoint from the readings next to half way."""
    low, high = np.quantile(data, [0.01, 0.99]).tolist()
    half = np.argsort(np.abs(data - 0.5 * (low + high)))[:5]
    return np.array([low, high - low, rate, float(np.mean(temperature[half]))])


def _balance(group: Sequence[Readings]) -> tuple[Model, Floats]:
    """Heat balance with ``log R/C`` and ``log hA/C`` free, from the first reading on."""
    wire = group[0].course.wire
    start = np.log([wire.resistance / wire.capacity, wire.loss / wire.capacity])

    def values(theta: Floats) -> Floats:
        gain, loss = np.exp(theta)
        parts = []
        for r in group:
            c, at = r.course, r.course.samples
            goal = c.ambient[at] + gain / loss * c.current[at] ** 2
            parts.append(follow(goal, c.time[at], 1.0 / loss, float(r.channels["temperature"][0]), held=True))
        return np.concatenate(parts)

    def model(theta: Floats) -> tuple[Floats, Floats]:
        step = 1e-5
        slopes = [(values(theta + step * e) - values(theta - step * e)) / (2.0 * step) for e in np.eye(2)]
        return values(theta), np.stack(slopes, axis=1)

    return model, start
