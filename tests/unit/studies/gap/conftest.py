"""A rig of its own for tests: no formula, solver or random draw is shared with the package."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.signal import lfilter
from scipy.stats import multivariate_normal

from sma_bayes.arrays import Floats
from sma_bayes.effects.types import Response, Scales
from sma_bayes.parameters.distributions import Normal
from sma_bayes.parameters.space import Parameter, ParameterSpace
from sma_bayes.records.history import History, histories
from sma_bayes.records.types import Branch, Campaign, Condition, Record
from sma_bayes.studies.gap.hypothesis import Hypothesis
from sma_bayes.studies.gap.noise import BlockNoise

UNITS = {"temperature": "degC", "time": "s", "force": "N", "displacement": "m"}
CURVES = {"displacement": (0.01, 0.02, 0.28, 3.0), "force": (1.0, 2.0, 0.22, 0.0)}
"""Value far below the transformation, span, rate [1/K], and how far the midpoint is above `MIDPOINT` [K]."""
MIDPOINT = {Branch.HEATING: 62.0, Branch.COOLING: 51.0}


@dataclass(frozen=True)
class Rig:
    """A campaign of springs heated by a raised cosine, and what is wrong with it.

    Attributes
    ----------
    channels : tuple of str
    cycles, samples : int
        Cycles of a condition, samples of a sweep.
    periods, loads, peaks : tuple of float
        Of each condition [s], [N], [degC].
    sd : float
        Of the noise, over the span of each channel.
    memory : float
        Correlation of neighbouring samples of the noise.
    lag : float
        Time constant of the sensor [s].
    shift : float
        By how much a newton raises the midpoints [K/N].
    power : float
        Of the load to which they rise; 1 in the catalogue.
    step : float
        By which each channel jumps in the middle of every record, over its span.
    hum : float
        Amplitude over its span of a sine of 0.37 Hz in each channel.
    drift : float
        Rise of each channel a cycle, over its span.
    bump : float
        By which each channel is off in the third cycle alone, at most, over its span.
    shape : callable, optional
        Share transformed, of the rate times the kelvins above the midpoint and of whether it heats; logistic if not
        given.
    seed : int
    """

    channels: tuple[str, ...] = ("displacement",)
    cycles: int = 3
    samples: int = 40
    periods: tuple[float, ...] = (30.0, 60.0, 150.0)
    loads: tuple[float, ...] = (1.5, 1.0, 2.0)
    peaks: tuple[float, ...] = (95.0, 105.0, 85.0)
    sd: float = 0.004
    memory: float = 0.0
    lag: float = 0.0
    shift: float = 0.0
    power: float = 1.0
    step: float = 0.0
    hum: float = 0.0
    drift: float = 0.0
    bump: float = 0.0
    shape: Callable[[Floats, NDArray[np.bool_]], Floats] | None = None
    seed: int = 0

    def campaign(self) -> Campaign:
        rng = np.random.default_rng([self.seed, 99])
        records = [r for i in range(len(self.periods)) for r in self._condition(i, rng)]
        return Campaign("rig", "rig", "0" * 64, tuple(records))

    def _condition(self, number: int, rng: np.random.Generator) -> list[Record]:
        load, omega = self.loads[number], 2.0 * np.pi / self.periods[number]
        middle, swing = 0.5 * (self.peaks[number] + 25.0), 0.5 * (self.peaks[number] - 25.0)
        sweeps = 2 * self.cycles
        turn = np.pi * (np.arange(sweeps * self.samples) + 0.5) / self.samples
        # a first-order sensor in a steady oscillation reads it smaller and later, by a factor and a phase
        behind = np.arctan(omega * self.lag)
        reading = middle - swing * np.cos(behind) * np.cos(turn)
        metal, rising = middle - swing * np.cos(turn + behind), np.sin(turn + behind) > 0.0
        sweep = np.repeat(np.arange(sweeps), self.samples)
        hum = self.hum * np.sin(2.0 * np.pi * 0.37 * turn / omega + 1.0)
        observed = {
            c: self._channel(c, metal, rising, load, sweep, rng) + hum * CURVES[c][1] for c in self.channels
        }
        out = []
        for branch, parity in ((Branch.HEATING, 0), (Branch.COOLING, 1)):
            on = sweep % 2 == parity
            inputs = {
                "temperature": reading[on],
                "time": turn[on] / omega,
                "cycle": 1.0 + sweep[on] // 2,
                "segment": (sweep[on] // 2).astype(float),
            }
            what = Condition(f"c{number}", load=load)
            row = np.flatnonzero(on) + 2
            out.append(Record(what, branch, inputs, {c: v[on] for c, v in observed.items()}, row, UNITS))
        return out

    def _channel(
        self,
        channel: str,
        metal: Floats,
        rising: Floats,
        load: float,
        sweep: Floats,
        rng: np.random.Generator,
    ) -> Floats:
        low, span, rate, above = CURVES[channel]
        midpoint = np.where(rising, MIDPOINT[Branch.HEATING], MIDPOINT[Branch.COOLING]) + above
        above = rate * (metal - midpoint - self.shift * load**self.power)
        share = 0.5 * (1.0 + np.tanh(0.5 * above)) if self.shape is None else self.shape(above, rising)
        fresh = rng.standard_normal(metal.size)
        fresh[1:] *= np.sqrt(1.0 - self.memory**2)
        noise = self.sd * lfilter([1.0], [1.0, -self.memory], fresh)
        wrong = self.step * (np.arange(metal.size) >= metal.size // 2) + self.drift * (sweep // 2)
        wrong = wrong + self.bump * (sweep // 2 == 2) * share * (1.0 - share) * 4.0
        return np.asarray(low + span * (share + noise + wrong))


@pytest.fixture(scope="session")
def rig() -> Callable[..., Rig]:
    """Make a rig."""
    return Rig


@dataclass(frozen=True)
class Straight:
    """A response that is linear in its parameters, so that every Gaussian integral has a closed form."""

    channels = ("displacement",)
    sloped = False

    def predict(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        return {"displacement": theta @ design(inputs["temperature"]).T}

    def curves(self, theta: Floats, temperature: Floats, branch: float) -> dict[str, Floats]:
        return self.predict(theta, {"temperature": temperature})


def design(temperature: Floats) -> Floats:
    """Columns of a parabola in temperature, shape (n, 3)."""
    x = (temperature - 60.0) / 35.0
    return np.stack([np.ones_like(x), x, x**2], axis=-1)


@dataclass(frozen=True)
class Added:
    """An effect that adds a multiple of a function of the inputs."""

    id: str
    column: Callable[[Mapping[str, Floats]], Floats]
    sd: float = 1.0
    title = "something is added"
    equation = "X = X0 + a f"
    reference = "made up"
    needs = ("channel",)

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        return (Parameter("a", "m", "size", Normal(0.0, self.sd), "made up"),)

    def apply(self, response: Response, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        out = response(inputs)
        return {**out, "displacement": out["displacement"] + theta * self.column(inputs)}


@dataclass(frozen=True)
class Line:
    """A hypothesis that is linear in its parameters, noise that is known, and the same as dense matrices.

    Attributes
    ----------
    hypothesis : Hypothesis
    noise : tuple of BlockNoise
    y : ndarray, shape (N,)
    x : ndarray, shape (N, 3)
    prior_mean, prior_sd : ndarray, shape (3,)
    covariance : ndarray, shape (N, N)
        Of the noise.
    """

    hypothesis: Hypothesis
    noise: tuple[BlockNoise, ...]
    y: Floats
    x: Floats
    prior_mean: Floats
    prior_sd: Floats
    covariance: Floats

    def log_evidence(self, *, extra: Floats | None = None, kept: NDArray[np.bool_] | None = None) -> float:
        """Log density of the measurements, all parameters integrated out; `extra` adds to their covariance."""
        on = np.ones(self.y.size, dtype=bool) if kept is None else kept
        whole = self.covariance + self.x @ np.diag(self.prior_sd**2) @ self.x.T
        if extra is not None:
            whole = whole + extra
        mean = self.x @ self.prior_mean
        return float(multivariate_normal(mean[on], whole[np.ix_(on, on)]).logpdf(self.y[on]))


def known_noise(history: History, sd: float, phi: float) -> BlockNoise:
    """AR(1) noise that starts anew with every sweep."""
    first = np.diff(history.inputs["stretch"], prepend=-1.0) != 0
    return BlockNoise(sd, np.where(first, 0.0, phi))


def dense(noise: Sequence[BlockNoise]) -> Floats:
    """Covariance matrix of noise, by the recursion ``cov(i, j) = memory(i) cov(i - 1, j)``."""
    blocks = []
    for own in noise:
        c = np.eye(own.memory.size)
        for i in range(1, len(c)):
            c[i, :i] = own.memory[i] * c[i - 1, :i]
        blocks.append(own.sd**2 * (np.tril(c) + np.tril(c, -1).T))
    return np.asarray(block_diag(*blocks))


@pytest.fixture(scope="session")
def covariance_of() -> Callable[[Sequence[BlockNoise]], Floats]:
    return dense


@pytest.fixture(scope="session")
def added() -> Callable[..., Added]:
    """Make an effect that adds something."""
    return Added


@pytest.fixture(scope="session")
def make_line() -> Callable[..., Line]:
    """Make a linear hypothesis, with measurements drawn from its own prior and noise."""

    def make(
        *,
        seed: int = 0,
        phi: float = 0.5,
        prior_sd: tuple[float, float, float] = (2.0, 3.0, 1.0),
        n: int = 15,
    ) -> Line:
        rng = np.random.default_rng([seed, 5])
        some = histories(Rig(cycles=2, samples=n, periods=(30.0, 60.0)).campaign())
        noise = tuple(known_noise(h, 0.3 + 0.2 * i, phi) for i, h in enumerate(some))
        x = np.concatenate([design(h.inputs["temperature"]) for h in some])
        mean, sd = np.array([1.0, -2.0, 0.5]), np.array(prior_sd)
        covariance = dense(noise)
        y = x @ (mean + sd * rng.standard_normal(3)) + np.linalg.cholesky(covariance) @ rng.standard_normal(
            len(x)
        )
        parts = np.split(y, np.cumsum([h.n for h in some])[:-1])
        some = tuple(replace(h, observed={"displacement": p}) for h, p in zip(some, parts, strict=True))
        space = ParameterSpace(
            tuple(
                Parameter(f"p{i}", "m", "", Normal(m, s))
                for i, (m, s) in enumerate(zip(mean, sd, strict=True))
            )
        )
        everything = (np.arange(3), np.arange(3))
        hypothesis = Hypothesis(some, Straight(), (), space, everything, Scales.of(some), 3)
        return Line(hypothesis, noise, y, x, mean, sd, covariance)

    return make
