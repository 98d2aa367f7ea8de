"""How large innovations are: heavy tails, sizes that grow with the response, sizes that come and go."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from sma_bayes.arrays import Floats

GROWTH_STANDARD_ERRORS = 5.0
"""Standard errors from which the size of innovations counts as changing with the response; such as does not, once in a
million."""
DEGREES_OF_FREEDOM = (2.0, 3.0, 5.0, 9.0)
"""Degrees of freedom of Student's t that are tried where tails are heavier than normal."""
HEAVY_TAILS_GAIN = 10.0
"""Gain of log likelihood from which on tails count as heavy."""
LEAST_WIDTH = 0.1
"""Least width of a t distribution over the standard deviation; narrower ones are those of readings that repeat."""
OUTLIERS_SET_ASIDE = 3
"""Greatest innovations of a record that don't make its tails heavy."""
EM_ROUNDS = 20
"""How often weight and width of a t distribution are found in turn."""
SIZE_STANDARD_ERRORS = 3.0
"""Standard errors from which on the size of innovations remembers that of the sample before: then tails are those of
noise that comes and goes, or of a misfit, and no distribution of single readings."""


@dataclass(frozen=True, slots=True)
class HeavyTails:
    """Student's t of some innovations u, with k degrees of freedom and unit width.

    A change d of them has the score ``psi(u) d`` with ``psi(u) = (k + 1) u/(k + u**2)``, and the information ``i d**2``
    with ``i = (k + 1)/(k + 3)``. Normal innovations ``psi(u)/i`` of variance ``1/i`` have both. Scales of each
    innovation, ``sqrt(u/psi(u))``, have the same score and an information of 1: what is estimated with them scatters
    more than they say, by ``sqrt(1/i)``. What is left out, ``u - psi(u)/i``, is uncorrelated with ``psi(u)``. Such
    pseudo-observations: P. J. Huber, Robust Statistics (Wiley, 1981), section 7.8; the information: K. L. Lange, R. J.
    A. Little and J. M. G. Taylor, J. Am. Stat. Assoc. 84 (1989) 881-896.

    Attributes
    ----------
    degrees : float
        Of freedom, k.
    scale : ndarray, shape (n,)
        Of each innovation.
    """

    degrees: float
    scale: Floats

    @property
    def information(self) -> float:
        """On a change of an innovation, i; 1 for normal ones."""
        return (self.degrees + 1.0) / (self.degrees + 3.0)

    def counted(self, u: Floats) -> Floats:
        """What counts of innovations of unit width, ``psi(u)/i``, shape (n,)."""
        return (self.degrees + 1.0) * u / (self.degrees + u**2) / self.information


def heavy_tails(innovations: Floats, noisy: NDArray[np.bool_] | slice = slice(None)) -> HeavyTails | None:
    """The likeliest of Student's t distributions; None where the normal distribution describes innovations.

    Heavy tails are those of many: the `OUTLIERS_SET_ASIDE` greatest innovations have no say, as a jump of the specimen
    or the rig makes one, and is no noise.

    Parameters
    ----------
    innovations : ndarray, shape (n,)
        Of a common scale.
    noisy : ndarray of bool, shape (n,), optional
        Those whose distribution is asked for.
    """
    usual = innovations[noisy]
    usual = usual[np.argsort(np.abs(usual))[: max(usual.size - OUTLIERS_SET_ASIDE, 1)]]
    width = float(np.sqrt(np.mean(usual**2))) or 1.0
    best, found = stats.norm.logpdf(usual, scale=width).sum() + HEAVY_TAILS_GAIN, None
    for degrees in DEGREES_OF_FREEDOM:
        own = width
        for _ in range(EM_ROUNDS):
            weight = (degrees + 1.0) / (degrees + (usual / own) ** 2)
            own = float(np.sqrt(np.mean(weight * usual**2))) or 1.0
        value = stats.t.logpdf(usual, degrees, scale=own).sum()
        if value > best and own > LEAST_WIDTH * width:
            scale = np.sqrt((degrees + (innovations / own) ** 2) / (degrees + 1.0))
            best, found = value, HeavyTails(degrees, scale)
    return found


@dataclass(frozen=True, slots=True)
class Growth:
    """How the size of innovations changes with the response, by regression of the logarithm of their magnitude.

    Attributes
    ----------
    slope : float
        From the least response to the greatest: ln of the ratio.
    error : float
        Standard error of it, of normal innovations of one size, whose ln magnitude has a standard deviation of
        pi/sqrt(8); infinite where the response is constant.
    hump : float
        By how much the ln size halfway is above the line. What a model misses is largest where the curve is steep.
    """

    slope: float
    error: float
    hump: float

    @property
    def is_noise(self) -> bool:
        """Whether it is beyond doubt, and more a change with the response than one where the curve is steep."""
        return abs(self.slope) > GROWTH_STANDARD_ERRORS * self.error and abs(self.hump) < abs(self.slope)


def growth(innovations: Floats, response: Floats) -> Growth:
    """How the size of innovations (n,) changes with the response (n,)."""
    span = float(np.ptp(response))
    if not span > 0.0:
        return Growth(0.0, math.inf, 0.0)
    x = (response - response.min()) / span
    size = _ln_size(innovations)
    columns = np.stack([np.ones(x.size), x, 4.0 * x * (1.0 - x)], axis=1)
    precision = columns.T @ columns
    if np.linalg.cond(precision) > 1e10:  # of two levels no hump can be told
        return Growth(0.0, math.inf, 0.0)
    inverse = np.linalg.inv(precision)
    _, slope, hump = (inverse @ (columns.T @ size)).tolist()
    return Growth(slope, math.pi / math.sqrt(8.0) * math.sqrt(inverse[1, 1]), hump)


def remember_size(innovations: Floats) -> bool:
    """Whether an innovation is large or small as the one before is, by more than chance leaves."""
    size = _ln_size(innovations)
    size = size - size.mean()
    correlation = float(size[1:] @ size[:-1]) / max(float(size @ size), 1e-300)
    return correlation * math.sqrt(size.size) > SIZE_STANDARD_ERRORS


def _ln_size(innovations: Floats) -> Floats:
    """Logarithm of the magnitude of each innovation, those of nearly nothing held at a thousandth of the usual one."""
    return np.log(np.maximum(np.abs(innovations), 1e-3 * (np.sqrt(np.mean(innovations**2)) or 1.0)))
