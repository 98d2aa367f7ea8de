"""The spring of the simulated actuator: force and displacement as functions of the transformed fraction.

Written apart from the response models of the package. The state is the logit ``z`` of the fraction of austenite. In
equilibrium ``z = rate (T - midpoint)``, with other numbers on heating than on cooling, and a channel reads
``low + span expit(stretch z + offset)``: a modified sigmoid of temperature on each branch, exactly. Mechanisms change
``z`` or what comes after it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

Floats = NDArray[np.float64]

BRANCHES = ("heating", "cooling")
CHANNELS = ("force", "displacement")


@dataclass(frozen=True, slots=True)
class Curve:
    """One channel on one branch: ``low + span expit(rate (T - midpoint))``.

    Attributes
    ----------
    low, span : float
        In the unit of the channel.
    rate : float
        [1/K].
    midpoint : float
        [degC].
    """

    low: float
    span: float
    rate: float
    midpoint: float

    def at(self, temperature: Floats) -> Floats:
        """Value at temperatures [degC], any shape."""
        return np.asarray(
            self.low + self.span * expit(self.rate * (temperature - self.midpoint)), dtype=float
        )


@dataclass(frozen=True, slots=True)
class Shape:
    """How curves differ from sigmoids, the same in both channels and on both branches.

    With ``u = rate (T - midpoint)`` a channel reads ``low + span y``,

        y = (1 - p) expit(sinh(delta asinh(u) + epsilon)) + p expit(2 (u - apart)) + u (cold (1 - x) + hot x),

    where x is the first of these fractions.

    Attributes
    ----------
    delta, epsilon : float
        Steepness of the tails, and skewness; 1 and 0 for a sigmoid.
    cold, hot : float
        Slope of each phase, in spans for each unit of u.
    share, apart : float
        Share p of a second stage, and how far above the first it comes, in units of u.
    """

    delta: float = 1.0
    epsilon: float = 0.0
    cold: float = 0.0
    hot: float = 0.0
    share: float = 0.0
    apart: float = 0.0

    def of(self, u: Floats) -> Floats:
        """Y at any u."""
        x = expit(np.sinh(self.delta * np.arcsinh(u) + self.epsilon))
        second = self.share * expit(2.0 * (u - self.apart)) if self.share else 0.0
        return np.asarray((1.0 - self.share) * x + second + u * (self.cold + (self.hot - self.cold) * x))


SIGMOID = Shape()


@dataclass(frozen=True, slots=True)
class Spring:
    """Curves by (channel, branch). The fraction of austenite is the one that the force shows.

    Attributes
    ----------
    curves : dict
        Keys are pairs such as ``("force", "heating")``.
    shape : Shape
    """

    curves: dict[tuple[str, str], Curve]
    shape: Shape = SIGMOID

    def span(self, channel: str) -> float:
        """Span of a channel on heating."""
        return self.curves[channel, "heating"].span

    def logit(self, temperature: Floats, heating: NDArray[np.bool_]) -> Floats:
        """Logit of the fraction in equilibrium; `temperature` (..., m), `heating` (m,)."""
        h, c = (self.curves["force", branch] for branch in BRANCHES)
        rate = np.where(heating, h.rate, c.rate)
        return np.asarray(rate * (temperature - np.where(heating, h.midpoint, c.midpoint)), dtype=float)

    def rate(self, heating: NDArray[np.bool_]) -> Floats:
        """Rate of the fraction on the branch of each instant [1/K]."""
        return np.where(heating, self.curves["force", "heating"].rate, self.curves["force", "cooling"].rate)

    def read(self, channel: str, z: Floats, heating: NDArray[np.bool_]) -> Floats:
        """A channel from the logit of the fraction, any leading shape."""
        on = [self._of_state(channel, branch) for branch in BRANCHES]
        low, span, stretch, offset = (np.where(heating, a, b) for a, b in zip(*on, strict=True))
        u = stretch * z + offset
        y = expit(u) if self.shape == SIGMOID else self.shape.of(u)
        return np.asarray(low + span * y, dtype=float)

    def _of_state(self, channel: str, branch: str) -> tuple[float, float, float, float]:
        curve, state = self.curves[channel, branch], self.curves["force", branch]
        stretch = curve.rate / state.rate
        return curve.low, curve.span, stretch, curve.rate * (state.midpoint - curve.midpoint)


def bench_spring(rng: np.random.Generator) -> Spring:
    """A tension spring against a bias spring of 130 N/m, a little different for each seed.

    Force 0.5 to 3.1 N, stroke 20 mm, transformation over some 15 K about 60 degC on heating and 13 K lower on cooling;
    displacement ahead of the force, as in all printed rows of Tables 3 to 5 of the paper.
    """
    force = Curve(0.5, 2.6 * rng.uniform(0.9, 1.1), 0.30 * rng.uniform(0.9, 1.1), 61.0 + rng.uniform(-1, 1))
    stroke = Curve(1e-3, 20e-3 * rng.uniform(0.9, 1.1), 0.27 * rng.uniform(0.9, 1.1), force.midpoint - 3.5)
    width = 13.0 + rng.uniform(-1.0, 1.0)
    return Spring(
        {
            ("force", "heating"): force,
            ("force", "cooling"): replace(force, rate=1.05 * force.rate, midpoint=force.midpoint - width),
            ("displacement", "heating"): stroke,
            ("displacement", "cooling"): replace(
                stroke, rate=1.04 * stroke.rate, midpoint=stroke.midpoint - width + 0.5
            ),
        }
    )


def wide_spring(rng: np.random.Generator) -> Spring:
    """A spring that transforms over some 35 K about 76 degC and 63 degC.

    The wider the transformation, the less an error of temperature of a few tenths of a kelvin does to force and stroke.
    """
    return Spring(
        {
            key: replace(c, rate=0.42 * c.rate, midpoint=c.midpoint + 15.0)
            for key, c in bench_spring(rng).curves.items()
        }
    )


def shaped(spring: Spring, curve: str, rng: np.random.Generator) -> Spring:
    """A spring with curves of one of the kinds in `CURVES`."""
    return replace(spring, shape=CURVES[curve](rng))


CURVES: Mapping[str, Callable[[np.random.Generator], Shape]] = {
    "sigmoid": lambda rng: SIGMOID,
    "skewed": lambda rng: Shape(
        delta=rng.uniform(0.8, 1.3), epsilon=rng.choice([-1.0, 1.0]) * rng.uniform(0.2, 0.6)
    ),
    "slopes": lambda rng: Shape(
        delta=rng.uniform(0.9, 1.2), cold=rng.uniform(0.002, 0.01), hot=rng.uniform(-0.005, 0.01)
    ),
    "two_stages": lambda rng: Shape(share=rng.uniform(0.1, 0.25), apart=rng.uniform(2.5, 4.5)),
}
"""Kinds of curves, by name: sigmoids, and the richer ones that real specimens show."""


def another(spring: Spring, rng: np.random.Generator) -> Spring:
    """The same spring as another condition would show it: asymptotes, rates and midpoints moved."""
    size, quick, shift = rng.uniform(0.8, 1.2), rng.uniform(0.9, 1.1), rng.uniform(-3.0, 3.0)
    return Spring(
        {
            key: Curve(c.low * size, c.span * size, c.rate * quick, c.midpoint + shift)
            for key, c in spring.curves.items()
        },
        spring.shape,
    )
