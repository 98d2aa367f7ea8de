"""Prior distributions: densities, draws, and the coordinate in which a parameter with such a prior is sampled.

A parameter is sampled on the whole real line: ``z = x`` where its support is unbounded, ``z = ln(sign x)`` on a
half line that ends at zero, ``z = ln((x - low)/(high - x))`` on an interval. The density in ``z`` includes the
Jacobian of that map.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Protocol, runtime_checkable

import numpy as np
from scipy.special import betaincinv, gammaincinv, gammaln, log_ndtr, ndtri, ndtri_exp, stdtrit

from sma_bayes.arrays import Floats
from sma_bayes.catalogue import Catalogue
from sma_bayes.errors import PriorError
from sma_bayes.normal import HALF_LN_2PI
from sma_bayes.parameters.transforms import Identity, Log, Probit, Transform

LEAST_DF = 0.25
"""Degrees of freedom below which draws of Student's t are beyond what floating-point numbers can be reckoned with."""


@runtime_checkable
class Distribution(Protocol):
    """What every prior offers; arrays of any shape in, the same shape out."""

    @property
    def transform(self) -> Transform:
        """Map between the parameter and the coordinate in which it is sampled."""
        ...

    def log_density(self, x: Floats) -> Floats:
        """Natural logarithm of the density at `x`; minus infinity outside the support."""
        ...

    def quantile(self, p: Floats) -> Floats:
        """Quantile function, for draws, plots and intervals."""
        ...

    def rescaled(self, scale: float, shift: float = 0.0) -> Distribution:
        """Distribution of ``shift + scale * x``, `scale` positive."""
        ...


def _positive(name: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0.0):
        raise PriorError(f"{name} = {value!r}", expected=f"a finite positive {name}")


def _finite(name: str, value: float) -> None:
    if not math.isfinite(value):
        raise PriorError(f"{name} = {value!r}", expected=f"a finite {name}")


def _no_shift(family: str, shift: float) -> None:
    if shift != 0.0:
        raise PriorError(
            f"a {family} prior can't be moved away from zero",
            expected="a scale without a position, such as span(displacement)",
            remedy="use family = 'normal' for a position",
        )


@dataclass(frozen=True, slots=True)
class Normal:
    """Normal distribution, sampled as it is."""

    mean: float
    sd: float

    def __post_init__(self) -> None:
        _finite("mean", self.mean)
        _positive("sd", self.sd)

    @property
    def transform(self) -> Transform:
        return Identity()

    def log_density(self, x: Floats) -> Floats:
        u = (x - self.mean) / self.sd
        return np.asarray(-0.5 * u * u - math.log(self.sd) - HALF_LN_2PI)

    def quantile(self, p: Floats) -> Floats:
        return np.asarray(self.mean + self.sd * ndtri(p))

    def rescaled(self, scale: float, shift: float = 0.0) -> Normal:
        return Normal(shift + scale * self.mean, scale * self.sd)


@dataclass(frozen=True, slots=True)
class LogNormal:
    """Log-normal distribution of ``sign * x``, sampled as its logarithm.

    Attributes
    ----------
    median : float
        Median of the magnitude, positive.
    sigma : float
        Standard deviation of the natural logarithm.
    sign : float
        +1 or -1: the side of zero on which the parameter lies.
    """

    median: float
    sigma: float
    sign: float = 1.0

    def __post_init__(self) -> None:
        _positive("median", self.median)
        _positive("sigma", self.sigma)
        if self.sign not in (-1.0, 1.0):
            raise PriorError(f"sign = {self.sign!r}", expected="1 or -1")

    @property
    def transform(self) -> Transform:
        return Log(self.sign)

    def log_density(self, x: Floats) -> Floats:
        magnitude = self.sign * np.asarray(x)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = (np.log(magnitude) - math.log(self.median)) / self.sigma
            value = -0.5 * u * u - math.log(self.sigma) - HALF_LN_2PI - np.log(magnitude)
        return np.where(magnitude > 0.0, value, -np.inf)

    def quantile(self, p: Floats) -> Floats:
        p = np.asarray(p) if self.sign > 0 else 1.0 - np.asarray(p)
        return np.asarray(self.sign * self.median * np.exp(self.sigma * ndtri(p)))

    def rescaled(self, scale: float, shift: float = 0.0) -> LogNormal:
        _no_shift("lognormal", shift)
        return LogNormal(scale * self.median, self.sigma, self.sign)


@dataclass(frozen=True, slots=True)
class HalfNormal:
    """Normal distribution folded at zero, sampled as its logarithm."""

    sd: float

    def __post_init__(self) -> None:
        _positive("sd", self.sd)

    @property
    def transform(self) -> Transform:
        return Log(1.0)

    def log_density(self, x: Floats) -> Floats:
        u = np.asarray(x) / self.sd
        return np.where(u >= 0, -0.5 * u * u - math.log(self.sd) - HALF_LN_2PI + math.log(2.0), -np.inf)

    def quantile(self, p: Floats) -> Floats:
        return np.asarray(self.sd * ndtri(0.5 * (1.0 + np.asarray(p))))

    def rescaled(self, scale: float, shift: float = 0.0) -> HalfNormal:
        _no_shift("half_normal", shift)
        return HalfNormal(scale * self.sd)


@dataclass(frozen=True, slots=True)
class Gamma:
    """Gamma distribution beyond `low`: ``(x-low)**(shape-1) exp(-(x-low)/scale)``, sampled as ``ln(x - low)``."""

    shape: float
    scale: float
    low: float = 0.0

    def __post_init__(self) -> None:
        _positive("shape", self.shape)
        _positive("scale", self.scale)
        _finite("low", self.low)

    @property
    def transform(self) -> Transform:
        return Log(1.0, self.low)

    def log_density(self, x: Floats) -> Floats:
        x = np.asarray(x) - self.low
        with np.errstate(divide="ignore", invalid="ignore"):
            value = (self.shape - 1.0) * np.log(x / self.scale) - x / self.scale
        value = value - math.log(self.scale) - gammaln(self.shape)
        return np.where(x > 0.0, value, -np.inf)

    def quantile(self, p: Floats) -> Floats:
        return np.asarray(self.low + self.scale * gammaincinv(self.shape, p))

    def rescaled(self, scale: float, shift: float = 0.0) -> Gamma:
        _no_shift("gamma", shift)
        return Gamma(self.shape, scale * self.scale, scale * self.low)


@dataclass(frozen=True, slots=True)
class Uniform:
    """Uniform distribution on an interval, sampled as its probit."""

    low: float
    high: float

    def __post_init__(self) -> None:
        _finite("low", self.low)
        _finite("high", self.high)
        if not self.low < self.high:
            raise PriorError(f"low = {self.low!r}, high = {self.high!r}", expected="low below high")

    @property
    def transform(self) -> Transform:
        return Probit(self.low, self.high)

    def log_density(self, x: Floats) -> Floats:
        inside = (np.asarray(x) >= self.low) & (np.asarray(x) <= self.high)
        return np.where(inside, -math.log(self.high - self.low), -np.inf)

    def quantile(self, p: Floats) -> Floats:
        return np.asarray(self.low + (self.high - self.low) * np.asarray(p))

    def rescaled(self, scale: float, shift: float = 0.0) -> Uniform:
        return Uniform(shift + scale * self.low, shift + scale * self.high)


@dataclass(frozen=True, slots=True)
class TruncatedNormal:
    """Normal distribution kept between two bounds, sampled as its probit."""

    mean: float
    sd: float
    low: float
    high: float

    def __post_init__(self) -> None:
        _finite("mean", self.mean)
        _positive("sd", self.sd)
        Uniform(self.low, self.high)

    @property
    def transform(self) -> Transform:
        return Probit(self.low, self.high)

    def _bounds(self) -> tuple[float, float, float]:
        a, b = (self.low - self.mean) / self.sd, (self.high - self.mean) / self.sd
        flip = -1.0 if a > 0 else 1.0  # work in the tail where the distribution function has its digits
        return (a, b, 1.0) if flip > 0 else (-b, -a, -1.0)

    def log_density(self, x: Floats) -> Floats:
        a, b, _ = self._bounds()
        log_mass = log_ndtr(b) + math.log1p(-math.exp(log_ndtr(a) - log_ndtr(b)))
        u = (np.asarray(x) - self.mean) / self.sd
        inside = (np.asarray(x) >= self.low) & (np.asarray(x) <= self.high)
        return np.where(inside, -0.5 * u * u - HALF_LN_2PI - math.log(self.sd) - log_mass, -np.inf)

    def quantile(self, p: Floats) -> Floats:
        a, b, side = self._bounds()
        p = np.asarray(p) if side > 0 else 1.0 - np.asarray(p)
        with np.errstate(divide="ignore"):  # logarithms, because both bounds may lie far out in the tail
            log_p = np.logaddexp(np.log1p(-p) + log_ndtr(a), np.log(p) + log_ndtr(b))
        return np.asarray(np.clip(self.mean + side * self.sd * ndtri_exp(log_p), self.low, self.high))

    def rescaled(self, scale: float, shift: float = 0.0) -> TruncatedNormal:
        return TruncatedNormal(
            shift + scale * self.mean, scale * self.sd, shift + scale * self.low, shift + scale * self.high
        )


@dataclass(frozen=True, slots=True)
class StudentT:
    """Student's t distribution with location and scale, sampled as it is."""

    df: float
    mean: float
    scale: float

    def __post_init__(self) -> None:
        _positive("df", self.df)
        if self.df < LEAST_DF:
            raise PriorError(
                f"df = {self.df!r}", expected=f"at least {LEAST_DF:g}; 1 is a Cauchy distribution"
            )
        _finite("mean", self.mean)
        _positive("scale", self.scale)

    @property
    def transform(self) -> Transform:
        return Identity()

    def log_density(self, x: Floats) -> Floats:
        u = (np.asarray(x) - self.mean) / self.scale
        norm = gammaln(0.5 * (self.df + 1)) - gammaln(0.5 * self.df) - 0.5 * math.log(math.pi * self.df)
        return np.asarray(norm - math.log(self.scale) - 0.5 * (self.df + 1) * np.log1p(u * u / self.df))

    def quantile(self, p: Floats) -> Floats:
        low = np.asarray(p) == 0.0  # where scipy's quantile has the wrong sign
        return np.asarray(self.mean + self.scale * np.where(low, -np.inf, stdtrit(self.df, p)))

    def rescaled(self, scale: float, shift: float = 0.0) -> StudentT:
        return StudentT(self.df, shift + scale * self.mean, scale * self.scale)


@dataclass(frozen=True, slots=True)
class Beta:
    """Beta distribution stretched to an interval, sampled as its probit."""

    a: float
    b: float
    low: float = 0.0
    high: float = 1.0

    def __post_init__(self) -> None:
        _positive("a", self.a)
        _positive("b", self.b)
        Uniform(self.low, self.high)

    @property
    def transform(self) -> Transform:
        return Probit(self.low, self.high)

    def log_density(self, x: Floats) -> Floats:
        width = self.high - self.low
        u = (np.asarray(x) - self.low) / width
        norm = gammaln(self.a + self.b) - gammaln(self.a) - gammaln(self.b) - math.log(width)
        with np.errstate(divide="ignore", invalid="ignore"):
            value = norm + (self.a - 1.0) * np.log(u) + (self.b - 1.0) * np.log1p(-u)
        return np.where((u > 0.0) & (u < 1.0), value, -np.inf)

    def quantile(self, p: Floats) -> Floats:
        return np.asarray(self.low + (self.high - self.low) * betaincinv(self.a, self.b, p))

    def rescaled(self, scale: float, shift: float = 0.0) -> Beta:
        return Beta(self.a, self.b, shift + scale * self.low, shift + scale * self.high)


FAMILIES: Catalogue[type] = Catalogue(
    "prior family",
    {
        "normal": Normal,
        "lognormal": LogNormal,
        "half_normal": HalfNormal,
        "gamma": Gamma,
        "uniform": Uniform,
        "truncated_normal": TruncatedNormal,
        "student_t": StudentT,
        "beta": Beta,
    },
)


def family_name(prior: Distribution) -> str:
    """Name of a distribution's family, as in a priors file."""
    return next(name for name, kind in FAMILIES.items() if type(prior) is kind)


def numbers(prior: Distribution) -> dict[str, float]:
    """The numbers of a distribution, by name."""
    return {f.name: float(getattr(prior, f.name)) for f in fields(prior)}  # type: ignore[arg-type]
