"""Noise of unit variance, drawn series by series, and what readings suffer besides."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.signal import lfilter

from calibration.curves import Floats

Noise = Callable[[np.random.Generator, Floats], Floats]
"""Generator and the share of the transformation that has passed at each sample (n,) -> series (n,)."""


def white(rng: np.random.Generator, passed: Floats) -> Floats:
    """Independent and normal."""
    return rng.standard_normal(passed.size)


def autoregressive(phi: float) -> Noise:
    """Stationary AR(1), ``e[i] = phi e[i-1] + sqrt(1 - phi**2) w[i]``."""

    def draw(rng: np.random.Generator, passed: Floats) -> Floats:
        w = np.sqrt(1.0 - phi * phi) * rng.standard_normal(passed.size)
        w[:1] /= np.sqrt(1.0 - phi * phi)
        return np.asarray(lfilter([1.0], [1.0, -phi], w))

    return draw


def student(df: float) -> Noise:
    """Independent, Student's t scaled to unit variance."""

    def draw(rng: np.random.Generator, passed: Floats) -> Floats:
        return np.asarray(rng.standard_t(df, passed.size) * np.sqrt((df - 2.0) / df))

    return draw


def growing(least: float = 0.25) -> Noise:
    """Independent and normal, its standard deviation growing with the response from `least` of the greatest to it.

    The mean variance over a transformation that has passed at an even rate is 1.
    """
    scale = 1.0 / np.sqrt((1.0 + least + least * least) / 3.0)

    def draw(rng: np.random.Generator, passed: Floats) -> Floats:
        sd = scale * (least + (1.0 - least) * np.clip(passed, 0.0, 1.0))
        return np.asarray(sd * rng.standard_normal(passed.size))

    return draw


def rounded(values: Floats, step: float) -> Floats:
    """Readings of a converter of that step [unit of the values]."""
    return np.asarray(step * np.round(values / step))
