"""True response curves against temperature, each with its derivative."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.optimize import least_squares
from scipy.special import expit

Floats = NDArray[np.float64]
PUBLISHED = ("span", "rate", "midpoint", "offset")
"""Parameters of the published curve: A1 to A4 of displacement, B1 to B4 of force."""
_BISECTIONS = 60


@dataclass(frozen=True, slots=True)
class Curve:
    """A response of one channel.

    Attributes
    ----------
    value, slope : callable
        Temperatures [degC] of any shape to the response [unit of the channel], and to its derivative [that per K].
    """

    value: Callable[[Floats], Floats]
    slope: Callable[[Floats], Floats]

    def plus(self, other: Curve) -> Curve:
        """The sum of two."""
        return Curve(
            lambda t: self.value(t) + other.value(t),
            lambda t: self.slope(t) + other.slope(t),
        )


def logistic(span: float, rate: float, midpoint: float, offset: float) -> Curve:
    """The published curve, ``offset + span/(1 + exp(-rate (T - midpoint)))``.

    Examples
    --------
    >>> float(logistic(2.0, 0.3, 50.0, 1.0).value(np.array(50.0)))
    2.0
    """

    def slope(t: Floats) -> Floats:
        s = expit(rate * (t - midpoint))
        return np.asarray(span * rate * s * (1.0 - s))

    return Curve(lambda t: np.asarray(offset + span * expit(rate * (t - midpoint))), slope)


def richards(span: float, rate: float, midpoint: float, offset: float, nu: float) -> Curve:
    """Richards' curve, ``offset + span (1 + nu exp(-rate (T - midpoint)))**(-1/nu)``; the logistic at ``nu = 1``.

    F. J. Richards, "A flexible growth function for empirical use", J. Exp. Bot. 10 (1959) 290,
    doi 10.1093/jxb/10.2.290.
    """

    def log_part(t: Floats) -> Floats:
        return np.asarray(np.logaddexp(0.0, np.log(nu) - rate * (t - midpoint)))

    def slope(t: Floats) -> Floats:
        passed = np.exp(-log_part(t) / nu)
        outstanding = expit(np.log(nu) - rate * (t - midpoint))
        return np.asarray(span * rate / nu * passed * outstanding)

    return Curve(lambda t: np.asarray(offset + span * np.exp(-log_part(t) / nu)), slope)


def hardening(span: float, start: float, finish: float, offset: float, n1: float, n2: float) -> Curve:
    """Smooth hardening: the transformed fraction s solves ``T = start + (finish - start) (1 + s**n1 - (1 - s)**n2)/2``.

    That is the hardening function of D. Lagoudas, D. Hartl, Y. Chemisky, L. Machado, P. Popov, "Constitutive model for
    the numerical analysis of phase transformation in polycrystalline shape memory alloys", Int. J. Plasticity 32-33
    (2012) 155, doi 10.1016/j.ijplas.2011.10.009, at constant stress: nothing happens before the start and after the
    finish, and exponents below 1 make both smooth.

    Parameters
    ----------
    start, finish : float
        Temperatures [degC] at which the fraction leaves 0 and reaches 1.
    n1, n2 : float
        Exponents in (0, 1] of start and finish.
    """

    def fraction(t: Floats) -> Floats:
        wanted = np.clip((t - start) / (finish - start), 0.0, 1.0)
        low, high = np.zeros_like(wanted), np.ones_like(wanted)
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            above = 0.5 * (1.0 + middle**n1 - (1.0 - middle) ** n2) > wanted
            low, high = np.where(above, low, middle), np.where(above, middle, high)
        return np.asarray(np.where(wanted <= 0.0, 0.0, np.where(wanted >= 1.0, 1.0, 0.5 * (low + high))))

    def slope(t: Floats) -> Floats:
        s = fraction(np.asarray(t, dtype=float))
        inside = (s > 0.0) & (s < 1.0)
        at = np.where(inside, s, 0.5)
        width = 0.5 * (finish - start) * (n1 * at ** (n1 - 1.0) + n2 * (1.0 - at) ** (n2 - 1.0))
        return np.asarray(np.where(inside, span / width, 0.0))

    return Curve(lambda t: np.asarray(offset + span * fraction(np.asarray(t, dtype=float))), slope)


def added(first: Curve, second: Curve) -> Curve:
    """Sum of two curves."""
    return Curve(lambda t: first.value(t) + second.value(t), lambda t: first.slope(t) + second.slope(t))


def phase_slopes(span: float, rate: float, midpoint: float, offset: float, cold: float, hot: float) -> Curve:
    """Each phase with a slope of its own: ``offset + c (T - T0) + s (span + (h - c) (T - T0))``, s the logistic.

    Parameters
    ----------
    cold, hot : float
        Slopes c and h [unit of the channel per K] far below and far above the midpoint T0.
    """

    def value(t: Floats) -> Floats:
        x = t - midpoint
        return np.asarray(offset + cold * x + expit(rate * x) * (span + (hot - cold) * x))

    def slope(t: Floats) -> Floats:
        x = t - midpoint
        s = expit(rate * x)
        return np.asarray(cold + s * (hot - cold) + rate * s * (1.0 - s) * (span + (hot - cold) * x))

    return Curve(value, slope)


def two_steps(
    span: float, rate: float, midpoint: float, offset: float, share: float, apart: float, sharper: float
) -> Curve:
    """A second transformation of `share` of the span, `apart` [K] above the first and `sharper` times as fast."""
    return added(
        logistic((1.0 - share) * span, rate, midpoint, offset),
        logistic(share * span, sharper * rate, midpoint + apart, 0.0),
    )


def mean_of(curves: Sequence[Curve]) -> Curve:
    """Mean of several curves at each temperature."""
    return Curve(
        lambda t: np.asarray(np.mean([c.value(t) for c in curves], axis=0)),
        lambda t: np.asarray(np.mean([c.slope(t) for c in curves], axis=0)),
    )


def tabulated(temperature: Floats, values: Floats) -> Curve:
    """Monotone cubic through a table of increasing temperatures, straight beyond its ends (P(chip), C1)."""
    inner = PchipInterpolator(temperature, values)
    derivative = inner.derivative()
    low, high = float(temperature[0]), float(temperature[-1])

    def slope(t: Floats) -> Floats:
        return np.asarray(derivative(np.clip(t, low, high)))

    def value(t: Floats) -> Floats:
        inside = np.clip(t, low, high)
        return np.asarray(inner(inside) + derivative(inside) * (t - inside))

    return Curve(value, slope)


def ratio(force: Curve, displacement: Curve) -> Curve:
    """Stiffness along the path, ``K = F'/X'``; its own slope by central differences.

    Where neither moves, 0/0, it is NaN.
    """

    def value(t: Floats) -> Floats:
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(force.slope(t) / displacement.slope(t))

    step = 1e-4
    return Curve(value, lambda t: (value(t + step) - value(t - step)) / (2.0 * step))


def nearest_published(curve: Curve, temperature: Floats) -> dict[str, float]:
    """Parameters of the published curve nearest to a curve: least sum of squares over the temperatures.

    R. Tuo, C. F. J. Wu, "Efficient calibration for imperfect computer models", Ann. Stat. 43 (2015) 2331,
    doi 10.1214/15-AOS1314, call them the L2 calibration.

    Parameters
    ----------
    temperature : ndarray, shape (n,)
        Measured temperatures [degC].

    Returns
    -------
    dict
        By the names in `PUBLISHED`; rate positive.
    """
    y = curve.value(temperature)
    low, high = float(temperature.min()), float(temperature.max())
    rising = np.sign(y[np.argmax(temperature)] - y[np.argmin(temperature)]) or 1.0
    size = float(np.ptp(y)) or 1.0

    def left(p: Floats) -> Floats:
        return (p[0] * expit(np.exp(p[1]) * (temperature - p[2])) + p[3] - y / size).astype(float)

    starts = [
        (
            rising,
            np.log(k / (high - low)),
            low + share * (high - low),
            float(y[np.argmin(temperature)]) / size,
        )
        for k in (8.0, 20.0)
        for share in (0.35, 0.5, 0.65)
    ]
    found = min((least_squares(left, s, x_scale="jac", xtol=1e-14, ftol=1e-14, gtol=1e-14) for s in starts),
                key=lambda f: f.cost)  # fmt: skip
    span, log_rate, midpoint, offset = found.x.tolist()
    return dict(zip(PUBLISHED, (span * size, float(np.exp(log_rate)), midpoint, offset * size), strict=True))


def span_over(curves: Mapping[str, Curve], low: float, high: float) -> dict[str, float]:
    """Range of each channel between two temperatures [unit of the channel]."""
    t = np.linspace(low, high, 401)
    return {c: float(np.ptp(curve.value(t))) for c, curve in curves.items()}
