"""Noise of unit variance, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from gap_benchmark.spring import Floats


@dataclass(frozen=True, slots=True)
class Noise:
    """A stationary noise of unit variance.

    Attributes
    ----------
    draw : callable
        Generator and number of samples to (n,).
    memory : float
        Correlation of neighbouring samples; AR(1) in the number of the sample.
    growth : float
        Standard deviation at the top of a channel over that at its bottom, less 1.
    """

    draw: Callable[[np.random.Generator, int], Floats]
    memory: float = 0.0
    growth: float = 0.0

    def grown(self, errors: Floats, clean: Floats) -> Floats:
        """Errors (n,) as they are where a channel reads `clean` (n,), of the same mean square."""
        if not self.growth:
            return errors
        size = 1.0 + self.growth * (clean - clean.min()) / np.ptp(clean)
        return np.asarray(errors * size / np.sqrt(np.mean(size**2)))

    def whiten(self, values: Floats) -> Floats:
        """Innovations of unit variance of a series (n,) or of the columns of (n, p), for a noise of unit variance."""
        out = np.array(values, dtype=float)
        if self.memory:
            out[1:] -= self.memory * values[:-1]
            out[1:] /= np.sqrt(1.0 - self.memory**2)
        return out


def _white(rng: np.random.Generator, n: int) -> Floats:
    return rng.standard_normal(n)


def _student(rng: np.random.Generator, n: int) -> Floats:
    return np.asarray(rng.standard_t(3.0, n) / np.sqrt(3.0))  # the variance of Student t is df/(df - 2)


def _ar1(
    memory: float, fresh: Callable[[np.random.Generator, int], Floats] = _white, growth: float = 0.0
) -> Noise:
    def draw(rng: np.random.Generator, n: int) -> Floats:
        innovations = fresh(rng, n)
        innovations[1:] *= np.sqrt(1.0 - memory**2)
        series: Floats = lfilter([1.0], [1.0, -memory], innovations)
        return series

    return Noise(draw, memory, growth)


NOISES: Mapping[str, Noise] = {
    "white": Noise(_white),
    "ar1_0.5": _ar1(0.5),
    "ar1_0.8": _ar1(0.8),
    "ar1_0.9": _ar1(0.9),
    "ar1_0.95": _ar1(0.95),
    "student_t": Noise(_student),
    "student_t_ar1_0.8": _ar1(0.8, _student),
    "growing": Noise(_white, growth=2.0),
    "growing_ar1_0.8": _ar1(0.8, growth=2.0),
}
