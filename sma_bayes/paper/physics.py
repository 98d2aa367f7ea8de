"""Physics that the printed numbers must obey: geometry, spring rate, stress, Joule heat, quantisation.

All functions are plain arithmetic in SI units. They take arrays as well as numbers, and also pint quantities,
whose units then come out right.

References
----------
A. M. Wahl, *Mechanical Springs*, 2nd ed., McGraw-Hill (1963): spring rate, shear stress and curvature factor of
round wire. F. P. Incropera et al., *Fundamentals of Heat and Mass Transfer*, 6th ed., Wiley (2007): steady
convective balance.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.paper.specifications import TABLE_1, specification


@dataclass(frozen=True, slots=True)
class Helix:
    """Close-coiled helical spring of round wire.

    Attributes
    ----------
    wire_diameter, coil_diameter : float
        Diameter d of the wire and mean diameter D of the coil [m].
    coils : float
        Number n of active coils [1].
    """

    wire_diameter: float
    coil_diameter: float
    coils: float

    @property
    def section(self) -> float:
        """Cross-section of the wire, ``π d²/4`` [m**2]."""
        return pi / 4 * self.wire_diameter**2

    @property
    def length(self) -> float:
        """Length of the wire without pitch, ``π D n`` [m]."""
        return pi * self.coil_diameter * self.coils

    @property
    def volume(self) -> float:
        """Volume of the wire [m**3]."""
        return self.section * self.length

    @property
    def surface(self) -> float:
        """Surface of the wire without its ends, ``π d`` times the length [m**2]."""
        return pi * self.wire_diameter * self.length


PUBLISHED_HELIX: Final = Helix(
    specification(TABLE_1, "wire_diameter", "m"),
    specification(TABLE_1, "coil_diameter", "m"),
    specification(TABLE_1, "coils", "1"),
)
"""The spring of Table 1. Whether its coil diameter is the mean one is not printed; it is taken to be."""


def spring_rate(shear_modulus: float, helix: Helix) -> float:
    """Stiffness of a helical spring, ``k = G d⁴/(8 D³ n)`` (Wahl 1963).

    Parameters
    ----------
    shear_modulus : float
        G [Pa].
    helix : Helix

    Returns
    -------
    float
        k [N/m].

    Examples
    --------
    >>> round(spring_rate(29.5e9, PUBLISHED_HELIX), 1)
    189.7
    """
    return shear_modulus * helix.wire_diameter**4 / (8 * helix.coil_diameter**3 * helix.coils)


def apparent_shear_modulus(stiffness: float, helix: Helix) -> float:
    """Shear modulus that a stiffness needs, ``G = 8 D³ n k/d⁴``: the inverse of `spring_rate`.

    Parameters
    ----------
    stiffness : float
        k [N/m].
    helix : Helix

    Returns
    -------
    float
        G [Pa].

    Examples
    --------
    >>> round(apparent_shear_modulus(519.28, PUBLISHED_HELIX) / 1e9, 1)
    80.8
    """
    return stiffness * 8 * helix.coil_diameter**3 * helix.coils / helix.wire_diameter**4


def shear_modulus(young_modulus: float, poisson_ratio: float) -> float:
    """Shear modulus of an isotropic solid, ``G = E/(2 (1 + ν))`` [unit of E].

    Examples
    --------
    >>> round(shear_modulus(28.0, 0.33), 2)
    10.53
    """
    return young_modulus / (2 * (1 + poisson_ratio))


def shear_stress(force: float, helix: Helix) -> float:
    """Nominal shear stress in the wire, ``τ = 8 F D/(π d³)``, without the factor for curvature (Wahl 1963).

    Parameters
    ----------
    force : float
        F [N].
    helix : Helix

    Returns
    -------
    float
        τ [Pa].

    Examples
    --------
    >>> round(shear_stress(0.980665, PUBLISHED_HELIX) / 1e6, 1)
    59.9
    """
    return 8 * force * helix.coil_diameter / (pi * helix.wire_diameter**3)


def wahl_factor(helix: Helix) -> float:
    """Factor of curvature and direct shear, ``(4C - 1)/(4C - 4) + 0.615/C`` with ``C = D/d`` [1] (Wahl 1963).

    Examples
    --------
    >>> wahl_factor(PUBLISHED_HELIX)
    1.2525
    """
    index = helix.coil_diameter / helix.wire_diameter
    return (4 * index - 1) / (4 * index - 4) + 0.615 / index


def wire_resistance(resistivity: float, helix: Helix) -> float:
    """Resistance of the wire from end to end, resistivity times length over section.

    Parameters
    ----------
    resistivity : float
        [ohm m].
    helix : Helix

    Returns
    -------
    float
        [ohm].

    Examples
    --------
    >>> round(wire_resistance(80e-8, PUBLISHED_HELIX), 3)
    1.728
    """
    return resistivity * helix.length / helix.section


def steady_rise(current: float, resistance: float, heat_transfer: float, surface: float) -> float:
    """Steady rise of temperature by Joule heat that convection carries away, ``I² R/(h A)`` (Incropera 2007).

    Parameters
    ----------
    current : float
        I [A].
    resistance : float
        R [ohm].
    heat_transfer : float
        h [W/(m² K)].
    surface : float
        A [m**2].

    Returns
    -------
    float
        [K].

    Examples
    --------
    >>> round(steady_rise(2.0, 1.0, 50.0, 1e-3), 1)
    80.0
    """
    return current**2 * resistance / (heat_transfer * surface)


def quantisation_step(span: float, bits: int) -> float:
    """One step of a converter that divides a span into ``2**bits`` codes [unit of the span].

    Examples
    --------
    >>> quantisation_step(20.0, 14)
    0.001220703125
    """
    return span * 2.0**-bits


def biased_path(stiffness: Floats, bias: float, stretch: float) -> tuple[Floats, Floats]:
    """Force and elongation of a spring whose stiffness changes while a bias spring holds its end.

    Both springs are linear at any one temperature. The ends of the pair stay in place, so the elongations add
    up to `stretch`, and the node between the springs is in balance: ``k X = bias (stretch - X)``.

    Parameters
    ----------
    stiffness : ndarray, shape (n,)
        k of the spring along the sweep [N/m].
    bias : float
        Stiffness of the bias spring [N/m].
    stretch : float
        Sum of both elongations [m].

    Returns
    -------
    force, elongation : ndarray, shape (n,)
        F [N] and X [m]. ``dF/dX`` along this path is ``-bias`` at every k.

    Examples
    --------
    >>> force, elongation = biased_path(np.array([20.0, 150.0]), 130.0, 0.01)
    >>> float(np.round(np.diff(force) / np.diff(elongation), 6)[0])
    -130.0
    """
    elongation = bias * stretch / (np.asarray(stiffness) + bias)
    return stiffness * elongation, elongation
