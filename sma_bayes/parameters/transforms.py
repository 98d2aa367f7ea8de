"""Maps between a parameter and the unbounded coordinate in which it is sampled."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.special import expit, log_expit

from sma_bayes.arrays import Floats


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


@dataclass(frozen=True, slots=True)
class Identity:
    """``x = z``."""

    def constrain(self, z: Floats) -> Floats:
        return np.asarray(z, dtype=float)

    def unconstrain(self, x: Floats) -> Floats:
        return np.asarray(x, dtype=float)

    def log_jacobian(self, z: Floats) -> Floats:
        return np.zeros_like(z)


@dataclass(frozen=True, slots=True)
class Log:
    """``x = sign * exp(z)``."""

    sign: float = 1.0

    def constrain(self, z: Floats) -> Floats:
        return np.asarray(self.sign * np.exp(z))

    def unconstrain(self, x: Floats) -> Floats:
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.log(self.sign * np.asarray(x)))

    def log_jacobian(self, z: Floats) -> Floats:
        return np.asarray(z, dtype=float)


@dataclass(frozen=True, slots=True)
class Logit:
    """``x = low + (high - low)/(1 + exp(-z))``."""

    low: float
    high: float

    def constrain(self, z: Floats) -> Floats:
        return np.asarray(self.low + (self.high - self.low) * expit(z))

    def unconstrain(self, x: Floats) -> Floats:
        x = np.asarray(x)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.log((x - self.low) / (self.high - x)))

    def log_jacobian(self, z: Floats) -> Floats:
        return np.asarray(math.log(self.high - self.low) + log_expit(z) + log_expit(-np.asarray(z)))
