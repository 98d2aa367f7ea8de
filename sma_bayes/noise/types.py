"""What a noise model is, and what it knows of the samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sma_bayes.parameters.space import ParameterFact
from sma_bayes.quantities import Floats
from sma_bayes.records.types import Record


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


class NoiseModel(Protocol):
    """Scatter of observations about the response, for one channel.

    The residual of each sample is first divided by its standard deviation; a noise model is the density of
    the standardised series ``e``. Its first parameter is always ``sd``; the others shape the series.

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
    """

    name: str
    title: str
    needs_time: bool
    remembers: bool
    is_density: bool

    def parameters(self, channel: str, unit: str, time_unit: str) -> tuple[ParameterFact, ...]:
        """Facts about the parameters of one channel, `sd` first."""
        ...

    def information(self, shape: Floats) -> Floats:
        """Share of the log likelihood that counts, shape (...); 1 for a density of the data."""
        ...

    def log_density(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        """Log density of each standardised residual given those before it.

        Parameters
        ----------
        e : ndarray, shape (..., n)
        shape : ndarray, shape (..., k)
            The parameters after `sd`.
        steps : Steps

        Returns
        -------
        ndarray, shape (..., n)
        """
        ...

    def total_log_density(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        """Sum of `log_density` over the samples, shape (...), by the shortest way."""
        ...

    def innovations(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        """Residuals with the memory taken out: independent and of unit variance if the model is right."""
        ...

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
        ...

    def estimate(self, residual: Floats, steps: Steps) -> Floats:
        """Maximum-likelihood estimate of all parameters from one series of residuals (n,): `sd`, then the shape."""
        ...

    def draw(self, rng: np.random.Generator, shape: Floats, steps: Steps) -> Floats:
        """Standardised series drawn from the model, shape (..., n) for `shape` (..., k)."""
        ...


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
