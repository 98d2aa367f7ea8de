"""Maps between a parameter and the unbounded coordinate in which it is sampled."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.special import ndtr, ndtri

from sma_bayes.arrays import Floats
from sma_bayes.normal import HALF_LN_2PI


class Transform(Protocol):
    """A smooth map from the real line onto the support of a parameter."""

    def constrain(self, z: Floats) -> Floats:
        """Parameter at the sampled coordinate `z`."""
        ...

    def unconstrain(self, x: Floats) -> Floats:
        """Sampled coordinate of the parameter `x`; not finite outside the support."""
        ...

    def log_jacobian(self, z: Floats) -> Floats:
        """Natural logarithm of ``|dx/dz|`` at `z`."""
        ...

    def label(self, name: str) -> str:
        """Sampled coordinate of a parameter of that name, for people."""
        ...


@dataclass(frozen=True, slots=True)
class Identity:
    """``x = z``."""

    def constrain(self, z: Floats) -> Floats:
        return np.asarray(z, dtype=float)

    def unconstrain(self, x: Floats) -> Floats:
        return np.asarray(x, dtype=float)

    def log_jacobian(self, z: Floats) -> Floats:
        return np.zeros_like(z)

    def label(self, name: str) -> str:
        return name


@dataclass(frozen=True, slots=True)
class Log:
    """``x = bound + sign * exp(z)``."""

    sign: float = 1.0
    bound: float = 0.0

    def constrain(self, z: Floats) -> Floats:
        return np.asarray(self.bound + self.sign * np.exp(z))

    def unconstrain(self, x: Floats) -> Floats:
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.log(self.sign * (np.asarray(x) - self.bound)))

    def log_jacobian(self, z: Floats) -> Floats:
        return np.asarray(z, dtype=float)

    def label(self, name: str) -> str:
        return f"ln({name} - {self.bound:g})" if self.bound else f"ln {name}"


@dataclass(frozen=True, slots=True)
class Probit:
    """``x = low + (high - low) Phi(z)``, `Phi` the standard normal distribution function.

    A posterior that piles up at a bound falls off beyond like a normal distribution, where it would go on like an
    exponential one in the logit.
    """

    low: float
    high: float

    def constrain(self, z: Floats) -> Floats:
        return np.asarray(self.low + (self.high - self.low) * ndtr(z))

    def unconstrain(self, x: Floats) -> Floats:
        x, width = np.asarray(x), self.high - self.low
        below, above = (x - self.low) / width, (self.high - x) / width
        nearer = ndtri(np.minimum(below, above))  # from the nearer bound, for its digits
        return np.asarray(np.where(below < above, nearer, -nearer))

    def log_jacobian(self, z: Floats) -> Floats:
        z = np.asarray(z, dtype=float)
        return np.asarray(math.log(self.high - self.low) - HALF_LN_2PI - 0.5 * z * z)

    def label(self, name: str) -> str:
        return f"probit {name}"
