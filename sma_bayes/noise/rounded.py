"""Independent normal noise, then rounding to the steps of the instrument.

A reading ``y`` of an instrument that shows whole multiples of a step ``q`` says that the value before rounding lay
within ``q/2`` of it, so its probability about a response ``mu`` with noise of standard deviation ``s`` is

    P(y) = Phi((y + q/2 - mu)/s) - Phi((y - q/2 - mu)/s),

that of interval-censored data (D. F. Heitjan, "Inference from grouped continuous data: a review", Statistical Science
4 (1989) 164). ``P/q`` is the density that is used: as a function of ``e = (y - mu)/s`` that of the sum of a standard
normal and a uniform variable of width ``h = q/s``. It is log-concave, and normal as ``h`` goes to zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.special import erfcx, ndtr, ndtri

from sma_bayes.arrays import Floats
from sma_bayes.noise.base import NoiseModel, Steps
from sma_bayes.normal import HALF_LN_2PI
from sma_bayes.parameters.space import QUANTITY, ParameterSpec

INVISIBLE_STEP = 1e-4
"""Step in standard deviations of the noise below which rounding does not show."""
INTERVAL_MARGIN = 35.0
"""Standard deviations within the interval from which nothing lies beyond its edge."""
ROOT_HALF_PI, ROOT_HALF = float(np.sqrt(0.5 * np.pi)), float(np.sqrt(0.5))
TABULATED_DECADES = (-3.0, 6.0)
"""Powers of ten between which the information is tabulated; beyond it goes on as at the ends."""
PER_DECADE = 40


@dataclass(frozen=True)
class Rounded(NoiseModel):
    """Samples scatter independently and normally before they are rounded; ``sd`` is that before rounding.

    The step is a fixed parameter of the channel; zero where its readings are not multiples of one.
    """

    name = "rounded"
    title = "independent Gaussian, rounded to steps"
    stands_alone = True

    def parameters(self, channel: str, unit: str, time_unit: str) -> tuple[ParameterSpec, ...]:
        step = ParameterSpec(
            f"{channel}_step",
            unit,
            f"step to which readings of {QUANTITY} are rounded",
            "step",
            channel,
            prior={
                "fixed": 1.0,
                "relative_to": "step(channel)",
                "source": "the readings, all of them multiples of it",
            },
        )
        return (*super().parameters(channel, unit, time_unit), step)

    def shape_of(self, values: Floats) -> Floats:
        return np.asarray(values[..., 1:] / values[..., :1])

    def log_density(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        h, near, left, _ = _edges(e, shape)
        return np.asarray(np.log(left / h) - 0.5 * near * near - HALF_LN_2PI)

    def score(self, innovation: Floats, shape: Floats) -> Floats:
        _, _, left, ratio = _edges(innovation, shape)
        return np.asarray(np.sign(innovation) * (1.0 - ratio) / left)

    def location_information(self, shape: Floats) -> Floats:
        at, information = _information()
        return np.asarray(np.exp(np.interp(np.log10(np.maximum(shape[..., 0], 1e-300)), at, information)))

    def innovations(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        h = np.maximum(shape[..., 0, None], INVISIBLE_STEP)
        far, near = -np.abs(e) - 0.5 * h, -np.abs(e) + 0.5 * h
        below = (_integral(near) - _integral(far)) / h
        return np.asarray(-np.sign(e) * ndtri(np.clip(below, 1e-300, 0.5)))

    def shape_candidates(self, steps: Steps) -> Floats:
        return np.array([[0.5], [3.0], [10.0]])

    def draw(self, rng: np.random.Generator, shape: Floats, steps: Steps) -> Floats:
        size = (*shape.shape[:-1], steps.dt.size)
        return np.asarray(rng.standard_normal(size) + shape[..., 0, None] * rng.uniform(-0.5, 0.5, size))

    def readings(
        self,
        rng: np.random.Generator,
        response: Floats,
        scale: Floats,
        shape: Floats,
        steps: Steps,
        one: float,
    ) -> Floats:
        value = response + scale * rng.standard_normal(np.shape(response))
        step = scale * shape[..., 0, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            shown = one + step * np.round((value - one) / step)
        return np.asarray(np.where(step > 0.0, shown, value))


def _edges(e: Floats, shape: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Step in standard deviations, nearer edge of the interval, and its probability over the normal density there.

    Last the ratio of the normal density at the farther edge to that at the nearer one. Ratios of tails to densities
    stay finite however far the edges are.
    """
    h = np.maximum(shape[..., 0, None], INVISIBLE_STEP)
    size = np.abs(e)
    near = np.maximum(size - 0.5 * h, -INTERVAL_MARGIN)
    ratio = np.exp(-h * size)
    return h, near, _tail(near) - ratio * _tail(size + 0.5 * h), ratio


def _tail(x: Floats) -> Floats:
    """Probability beyond `x` of a standard normal over its density there."""
    return np.asarray(ROOT_HALF_PI * erfcx(x * ROOT_HALF))


def _integral(x: Floats) -> Floats:
    """Integral of the standard normal distribution function up to `x`."""
    return np.asarray(x * ndtr(x) + np.exp(-0.5 * x * x - HALF_LN_2PI))


@cache
def _information() -> tuple[Floats, Floats]:
    """Powers of ten of the step, and there the logarithm of the Fisher information of the location of a sample.

    Both edges of the interval count: by symmetry twice the expectation over the upper half.
    """
    low, high = TABULATED_DECADES
    at = np.linspace(low, high, int((high - low) * PER_DECADE) + 1)
    h = 10.0 ** at[:, None]
    x = np.linspace(0.0, 1.0, 4001)
    inner = np.minimum(0.5 * h, 40.0)
    e = 0.5 * h + (
        x * (inner + 40.0) - inner
    )  # from the middle, or where the edge is no longer seen, outwards
    noise = Rounded()
    density = noise.log_density(e, h, Steps.apart(x.size))
    integrand = noise.score(e, h) ** 2 * np.exp(density)
    return at, np.log(2.0 * np.trapezoid(integrand, e, axis=1))
