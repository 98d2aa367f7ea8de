"""What a noise model is, and what it knows of the samples."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sma_bayes.parameters.space import ParameterFact
from sma_bayes.quantities import Floats
from sma_bayes.records.types import Record

HALF_LN_2PI = 0.9189385332046727


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

    A new noise model needs `name`, `title`, `log_density` and `draw`, and `parameters` if it has others than
    ``sd``; where samples depend on each other also `decorrelate`. The other methods have defaults, which a model
    overrides where it knows better.

    Attributes
    ----------
    name, title : str
        As an option, and for people.
    needs_time : bool
        Whether time must have been recorded.
    remembers : bool
        Whether a sample depends on the one before it.
    is_density : bool
        Whether the likelihood is a density of the data, so that evidences and criteria can be compared.
    is_gaussian : bool
        Whether what `decorrelate` leaves is normal, so that a Gaussian discrepancy can be integrated out exactly.
    """

    name: str
    title: str
    needs_time: bool = False
    remembers: bool = False
    is_density: bool = True
    is_gaussian: bool = False

    @property
    def feels_temperature(self) -> bool:
        """Whether the error of the thermometer is a parameter; see `sma_bayes.noise.temperature_error`."""
        return False

    @property
    def is_plain(self) -> bool:
        """Whether all samples have the same standard deviation."""
        return True

    def parameters(self, channel: str, unit: str, time_unit: str) -> tuple[ParameterFact, ...]:
        """Facts about the parameters of one channel, ``sd`` first.

        A fact may bring the `prior` of its parameter, which is in force where a priors file does not speak of it.
        """
        return (sd_fact(channel, unit),)

    def information(self, shape: Floats) -> Floats:
        """Share of the log likelihood that counts, shape (...); 1 for a density of the data."""
        return np.ones(shape.shape[:-1])

    @abstractmethod
    def log_density(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        """Log density of each standardised residual given those before it.

        Parameters
        ----------
        e : ndarray, shape (..., n)
        shape : ndarray, shape (..., k)
            The parameters after ``sd``; others may follow them.
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

        Its Jacobian does not depend on ``e``. By default samples are independent as they are.
        """
        return e

    def decorrelate_adjoint(self, series: Floats, shape: Floats, steps: Steps) -> Floats:
        """Adjoint of `decorrelate`: its matrix transposed, applied to series (..., n)."""
        return series

    def correlate(self, innovation: Floats, shape: Floats, steps: Steps) -> Floats:
        """Series (..., n) that `decorrelate` makes `innovation` of."""
        return innovation

    def score(self, innovation: Floats, shape: Floats) -> Floats:
        """Negative derivative of the log density of what `decorrelate` leaves, shape (..., n); normal by default."""
        return innovation

    def location_information(self, shape: Floats) -> Floats:
        """Fisher information of the location of one sample that `decorrelate` leaves, shape (...); 1 by default."""
        return np.ones(shape.shape[:-1])

    def innovations(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        """Residuals with the memory taken out: independent and standard normal if the model is right."""
        return self.decorrelate(e, shape, steps)

    def weighted_gram(self, rows: Floats, shape: Floats, steps: Steps) -> Floats:
        """Inner products of series, weighted by the information that noise of unit sd leaves.

        Parameters
        ----------
        rows : ndarray, shape (m, n)
            Series along the samples.
        shape : ndarray, shape (W, k)

        Returns
        -------
        ndarray, shape (W, m, m)
            ``rows @ inv(R) @ rows.T`` for Gaussian noise of correlation R; its expectation under the noise's own
            density otherwise.
        """
        if not self.remembers:
            return np.asarray(self.location_information(shape)[:, None, None] * (rows @ rows.T))
        white = self.decorrelate(
            np.broadcast_to(rows, (len(shape), *rows.shape)), shape[:, None, :], steps
        )
        return np.asarray(self.location_information(shape)[:, None, None] * (white @ np.swapaxes(white, 1, 2)))

    def shape_candidates(self, steps: Steps) -> Floats:
        """Values (c, k) of the parameters after ``sd`` from which `estimate` chooses."""
        return np.empty((1, 0))

    def estimate(self, residual: Floats, steps: Steps) -> Floats:
        """Maximum-likelihood estimate of all parameters from one series of residuals (n,): ``sd``, then the shape."""
        shape = self.shape_candidates(steps)
        size = float(np.sqrt(np.mean(residual**2)))
        sd = size * np.geomspace(0.2, 2.0, 61)
        best, found = -np.inf, np.array([size, *shape[0]])
        for each in shape:
            e = residual / sd[:, None]
            likelihood = self.total_log_density(e, np.tile(each, (sd.size, 1)), steps) - residual.size * np.log(sd)
            at = int(np.nanargmax(likelihood))
            if likelihood[at] > best:
                best, found = float(likelihood[at]), np.array([sd[at], *each])
        return found

    @abstractmethod
    def draw(self, rng: np.random.Generator, shape: Floats, steps: Steps) -> Floats:
        """Standardised series drawn from the model, shape (..., n) for `shape` (..., k)."""
        ...

    def relative_scale(self, shape: Floats, response: Floats) -> Floats | None:
        """Standard deviation of each sample as a multiple of ``sd``, shape (..., n); None where it is 1 throughout.

        Parameters
        ----------
        shape : ndarray, shape (..., k)
        response : ndarray, shape (..., n)
            Response of the channel: 0 at the bottom of its observed range and 1 at the top.
        """
        return None


def lag1(residual: Floats, steps: Steps) -> Floats:
    """Correlation of neighbouring residuals (..., n) within sweeps; 0 where all are."""
    after = np.flatnonzero(~steps.first)
    total = np.sum(residual**2, axis=-1)
    near = np.sum(residual[..., after] * residual[..., after - 1], axis=-1)
    return np.asarray(near / np.where(total > 0, total, 1.0))


def sd_fact(channel: str, unit: str) -> ParameterFact:
    """The parameter that every noise model begins with."""
    return ParameterFact(
        f"{channel}_sd", unit, f"standard deviation of the noise of {channel}", "sd", channel
    )
