"""What a noise model is, and what it knows of the samples."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from sma_bayes.arrays import Floats
from sma_bayes.noise.information import Information, OfDecorrelated, of_independent_samples
from sma_bayes.parameters.space import QUANTITY, ParameterSpec
from sma_bayes.records.types import Record

ABSCISSAE: Floats = np.sinh(np.linspace(-12.0, 12.0, 801))
"""Innovations at which densities are tabulated whose integrals nobody has worked out; the middle one is zero."""
RELATIVE_STEP = 1e-5
"""Step of the derivative of a log density, as a share of the innovation or of one."""
SMALL_INNOVATION = 1e-3
"""Innovation below which a sample weighs as one that is so far off."""


@dataclass(frozen=True, slots=True, eq=False)
class Steps:
    """How samples follow each other.

    Attributes
    ----------
    first : ndarray of bool, shape (n,)
        True at the first sample of a sweep, which remembers nothing.
    dt : ndarray, shape (n,)
        Time since the sample before it [unit of time]; 1 for every sample where time was not recorded.
    timed : bool
        Whether time was recorded.
    """

    first: NDArray[np.bool_]
    dt: Floats
    timed: bool

    @property
    def longest(self) -> int:
        """Number of samples of the longest sweep."""
        return int(np.diff(np.append(np.flatnonzero(self.first), self.first.size)).max())

    @property
    def typical(self) -> float:
        """Median step in time between neighbours of a sweep [unit of time]; 1 where none passes."""
        dt = self.dt[~self.first]
        return float(np.median(dt[dt > 0.0])) if np.any(dt > 0.0) else 1.0

    def part(self, samples: slice) -> Steps:
        """Steps of some samples, the first of which starts a sweep."""
        return Steps(self.first[samples], self.dt[samples], self.timed)

    @staticmethod
    def of(record: Record) -> Steps:
        """Steps of a record: a new memory starts with every segment."""
        segment = record.inputs["segment"]
        first = np.ones(record.n, dtype=bool)
        first[1:] = np.diff(segment) != 0
        timed = "time" in record.inputs
        dt = np.ones(record.n)
        if timed:
            dt[1:] = np.diff(record.inputs["time"])
            dt[first] = 1.0
            dt = np.maximum(dt, 0.0)
        return Steps(first, dt, timed)

    @staticmethod
    def apart(n: int) -> Steps:
        """Steps of samples each of which starts a sweep of its own."""
        return Steps(np.ones(n, dtype=bool), np.ones(n), False)


class NoiseModel(ABC):
    """Scatter of observations about the response, for one channel.

    The residual of each sample is first divided by its standard deviation; a noise model is the density of
    the standardised series ``e``. Its first parameter is always ``sd``; the others shape the series.

    A new noise model needs `name`, `title`, `log_density` and `draw`; if it has parameters other than ``sd`` also
    `parameters` and `shape_candidates`; where samples depend on each other also `autocorrelated`, `decorrelate`,
    `decorrelate_adjoint` and `correlate` (`sma_bayes.noise.ar1.MemoryNoise` has them for a Gaussian series). The other
    methods have defaults, by numerical integration where need be, which a model overrides where it knows better.

    Attributes
    ----------
    name, title : str
        As an option, and for people.
    needs_time : bool
        Whether time must have been recorded.
    autocorrelated : bool
        Whether a sample depends on the one before it.
    is_density : bool
        Whether the likelihood is a density of the data, so that evidences and criteria can be compared.
    stands_alone : bool
        Whether nothing may follow its name after a plus sign.
    is_gaussian : bool
        Whether what `decorrelate` leaves is normal, so that a Gaussian discrepancy can be integrated out exactly.
    """

    name: str
    title: str
    needs_time: bool = False
    autocorrelated: bool = False
    is_density: bool = True
    is_gaussian: bool = False
    stands_alone: bool = False

    @property
    def feels_temperature(self) -> bool:
        """Whether the error of the thermometer is a parameter; see `sma_bayes.noise.temperature_error`."""
        return False

    def parameters(self, channel: str, unit: str, time_unit: str) -> tuple[ParameterSpec, ...]:
        """Facts about the parameters of one channel, ``sd`` first.

        A fact may bring the `prior` of its parameter, which is in force where a priors file does not speak of it.
        """
        return (sd_fact(channel, unit),)

    def shape_of(self, values: Floats) -> Floats:
        """What shapes the standardised series (..., k), from the parameters (..., 1 + k) of a channel.

        By default those after ``sd``, as they are.
        """
        return values[..., 1:]

    def likelihood_weight(self, shape: Floats) -> Floats:
        """Share of the log likelihood that counts, shape (...); 1 for a density of the data."""
        return np.ones(shape.shape[:-1])

    @abstractmethod
    def log_density(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        """Log density of each standardised residual given those before it.

        Parameters
        ----------
        e : ndarray, shape (..., n)
        shape : ndarray, shape (..., k)
            From `shape_of`; others may follow.
        steps : Steps

        Returns
        -------
        ndarray, shape (..., n)
        """
        ...

    def total_log_density(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        """Sum of `log_density` over the samples, shape (...), by the shortest way."""
        return np.asarray(self.log_density(e, shape, steps).sum(axis=-1))

    def decorrelate(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        """Linear map of series (..., n) that leaves independent samples of one distribution, in order of time.

        The first sample of a sweep stays as it is. By default samples are independent as they are.
        """
        return e

    def decorrelate_adjoint(self, series: Floats, shape: Floats, steps: Steps) -> Floats:
        """Adjoint of `decorrelate`: its matrix transposed, applied to series (..., n)."""
        return series

    def correlate(self, innovation: Floats, shape: Floats, steps: Steps) -> Floats:
        """Series (..., n) that `decorrelate` makes `innovation` of."""
        return innovation

    def memory(self, shape: Floats, steps: Steps) -> float:
        """How many samples count as one: ``(1 + r)/(1 - r)`` for a correlation ``r`` of neighbours; 1 by default."""
        return 1.0

    def score(self, innovation: Floats, shape: Floats) -> Floats:
        """Negative derivative of the log density of what `decorrelate` leaves, shape (..., n)."""
        if self.is_gaussian:
            return innovation
        step = RELATIVE_STEP * np.maximum(1.0, np.abs(innovation))
        steps = Steps.apart(innovation.shape[-1])
        up, down = innovation + step, innovation - step
        rise = self.log_density(up, shape, steps) - self.log_density(down, shape, steps)
        return np.asarray(-rise / (up - down))

    def weight(self, innovation: Floats, shape: Floats) -> Floats:
        """How much samples count: their score over what `decorrelate` leaves of them, shape (..., n).

        1 for normal noise; less far out where tails are heavy.
        """
        if self.is_gaussian:
            return np.ones_like(innovation)
        at = np.where(np.abs(innovation) < SMALL_INNOVATION, SMALL_INNOVATION, innovation)
        return np.asarray(self.score(at, shape) / at)

    def location_information(self, shape: Floats) -> Floats:
        """Fisher information of the location of one sample that `decorrelate` leaves, shape (...)."""
        if self.is_gaussian:
            return np.ones(shape.shape[:-1])
        density, mass = self._tabulated(shape)
        with np.errstate(invalid="ignore"):
            score = np.nan_to_num(np.diff(density, axis=-1) / np.diff(ABSCISSAE))
        return np.asarray((score**2 * mass).sum(axis=-1) / mass.sum(axis=-1))

    def innovations(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        """Residuals with the memory taken out: independent and standard normal if the model is right.

        What `decorrelate` leaves, where it is not normal at the normal quantile of the same probability.
        """
        a = self.decorrelate(e, shape, steps)
        return a if self.is_gaussian else self._normal_quantiles(a, shape)

    def _tabulated(self, shape: Floats) -> tuple[Floats, Floats]:
        """Log density (..., m) of one innovation at `ABSCISSAE`, and the probabilities (..., m - 1) between them."""
        at = np.broadcast_to(ABSCISSAE, (*shape.shape[:-1], ABSCISSAE.size))
        density = self.log_density(at, shape, Steps.apart(ABSCISSAE.size))
        height = np.exp(density)
        return density, 0.5 * (height[..., 1:] + height[..., :-1]) * np.diff(ABSCISSAE)

    def _normal_quantiles(self, a: Floats, shape: Floats) -> Floats:
        """Quantiles (..., n) of the standard normal at the probabilities of innovations (..., n)."""
        _, mass = self._tabulated(shape)
        share = mass / mass.sum(axis=-1, keepdims=True)
        below, above = np.cumsum(share, axis=-1), np.cumsum(share[..., ::-1], axis=-1)[..., ::-1]
        # each from its own tail, for its digits
        inner = np.where(
            below[..., :-1] < 0.5,
            ndtri(np.clip(below[..., :-1], 1e-300, 0.5)),
            -ndtri(np.clip(above[..., 1:], 1e-300, 0.5)),
        )
        quantile = np.concatenate([inner[..., :1], inner, inner[..., -1:]], axis=-1)
        width = np.arcsinh(ABSCISSAE[1]) - np.arcsinh(ABSCISSAE[0])
        position = np.clip((np.arcsinh(a) - np.arcsinh(ABSCISSAE[0])) / width, 0.0, ABSCISSAE.size - 1.0)
        cell = np.minimum(np.nan_to_num(position).astype(np.intp), ABSCISSAE.size - 2)
        quantile = np.broadcast_to(quantile, (*a.shape[:-1], ABSCISSAE.size))
        low, high = (np.take_along_axis(quantile, cell + i, axis=-1) for i in (0, 1))
        return np.asarray(low + (position - cell) * (high - low))

    def information(self, shape: Floats, steps: Steps, inverse: Floats | None = None) -> Information:
        """What samples tell of series along them.

        Parameters
        ----------
        shape : ndarray, shape (W, k)
        steps : Steps
        inverse : ndarray, shape (W, n) or (W, 1), optional
            One over the standard deviation of the noise; 1 by default.
        """
        of_one = self.location_information(shape)
        if not self.autocorrelated:
            return of_independent_samples(steps.first.size, of_one, inverse)
        scale = np.ones((len(shape), 1)) if inverse is None else inverse

        def white(rows: Floats) -> Floats:
            each = np.broadcast_to(rows, (len(shape), *rows.shape[1:]))
            return self.decorrelate(each, shape[:, None, :], steps)

        return OfDecorrelated(white, scale, of_one)

    def shape_candidates(self, steps: Steps) -> Floats:
        """Values (c, k) of the parameters after ``sd``, plausible for such steps, from which `estimate` chooses."""
        return np.empty((1, 0))

    def estimate(self, residual: Floats, steps: Steps) -> Floats:
        """Maximum-likelihood estimate of all parameters from one series of residuals (n,): ``sd``, then the shape."""
        shape = self.shape_candidates(steps)
        size = float(np.sqrt(np.mean(residual**2)))
        sd = size * np.geomspace(0.2, 2.0, 61)
        best, found = -np.inf, np.array([size, *shape[0]])
        for each in shape:
            e = residual / sd[:, None]
            density = self.total_log_density(e, np.tile(each, (sd.size, 1)), steps)
            likelihood = np.nan_to_num(density - residual.size * np.log(sd), nan=-np.inf)
            at = int(np.argmax(likelihood))
            if likelihood[at] > best:
                best, found = float(likelihood[at]), np.array([sd[at], *each])
        return found

    @abstractmethod
    def draw(self, rng: np.random.Generator, shape: Floats, steps: Steps) -> Floats:
        """Standardised series drawn from the model, shape (..., n) for `shape` (..., k)."""
        ...

    def readings(
        self,
        rng: np.random.Generator,
        response: Floats,
        scale: Floats,
        shape: Floats,
        steps: Steps,
        one: float,
    ) -> Floats:
        """Readings (..., n) drawn about a response, as the instrument shows them.

        Parameters
        ----------
        rng : numpy.random.Generator
        response : ndarray, shape (..., n)
        scale : ndarray, shape (..., n) or (..., 1)
            Standard deviation of the noise.
        shape : ndarray, shape (..., k)
        steps : Steps
        one : float
            Some reading of the channel [unit of the channel].
        """
        return np.asarray(response + scale * self.draw(rng, shape, steps))

    def relative_scale(self, shape: Floats, response: Floats) -> Floats | None:
        """Standard deviation of each sample as a multiple of ``sd``, shape (..., n); None where it is 1 throughout.

        Parameters
        ----------
        shape : ndarray, shape (..., k)
        response : ndarray, shape (..., n)
            Response of the channel: 0 at the bottom of its observed range and 1 at the top.
        """
        return None


class OfSeries(NoiseModel):
    """A noise model made of that of a series: its samples depend on each other as those of the series do."""

    series: NoiseModel

    @property
    def needs_time(self) -> bool:  # type: ignore[override]
        """As the series."""
        return self.series.needs_time

    @property
    def autocorrelated(self) -> bool:  # type: ignore[override]
        """As the series."""
        return self.series.autocorrelated

    def decorrelate(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        return self.series.decorrelate(e, shape, steps)

    def memory(self, shape: Floats, steps: Steps) -> float:
        return self.series.memory(shape, steps)

    def decorrelate_adjoint(self, series: Floats, shape: Floats, steps: Steps) -> Floats:
        return self.series.decorrelate_adjoint(series, shape, steps)

    def correlate(self, innovation: Floats, shape: Floats, steps: Steps) -> Floats:
        return self.series.correlate(innovation, shape, steps)


def lag1(residual: Floats, first: NDArray[np.bool_]) -> Floats:
    """Correlation of neighbouring residuals (..., n) within sweeps, whose first samples are marked; 0 where all are."""
    after = np.flatnonzero(~first)
    total = np.sum(residual**2, axis=-1)
    near = np.sum(residual[..., after] * residual[..., after - 1], axis=-1)
    return np.asarray(near / np.where(total > 0, total, 1.0))


def sd_fact(channel: str, unit: str) -> ParameterSpec:
    """The parameter that every noise model begins with."""
    return ParameterSpec(
        f"{channel}_sd", unit, f"standard deviation of the noise of {QUANTITY}", "sd", channel, positive=True
    )
