"""The phenomenological law of shape memory alloys with smooth hardening, at constant uniaxial stress.

With ``x`` the share of martensite, the transformation at a stress ``s`` goes along

    T(x, s) = T_none + (T_full - T_none) f(x) + shift(s),    f(x) = (1 + x^p - (1 - x)^q)/2

on cooling (p, q = n1, n2) and on heating (p, q = n3, n4); `T_none` and `T_full` are temperatures at which nothing and
all is martensite. The strain is

    e(T, s) = s/E_A + x [H(s) + s (1/E_M - 1/E_A)] + [alpha_A + x (alpha_M - alpha_A)] (T - T_0)
    H(s) = H_min + (H_max - H_min) (1 - exp(-k s))

and, with ``g(s) = (1 -+ D) H(s) s + s^2 (1/E_M - 1/E_A)/2``, upper sign on cooling, the shift is
``g(s)/(C g'(s_ref))``: the phase boundaries have the slopes C_M and C_A at the reference stress.

References
----------
D. Lagoudas, D. Hartl, Y. Chemisky, L. Machado, P. Popov, "Constitutive model for the numerical analysis of phase
transformation in polycrystalline shape memory alloys", Int. J. Plasticity 32-33 (2012) 155,
https://doi.org/10.1016/j.ijplas.2011.10.009.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from sma_bayes.arrays import Floats

_NODES: Final = np.unique(
    np.concatenate([(grid := np.concatenate([[0.0], np.logspace(-9.0, np.log10(0.5), 160)])), 1.0 - grid])
)
"""Shares at which the law is tabulated, dense at both ends."""


class Moduli(NamedTuple):
    """Young's moduli of both phases [MPa]."""

    austenite: float
    martensite: float

    @property
    def compliance(self) -> float:
        """What the compliance of martensite exceeds that of austenite by [1/MPa]."""
        return 1.0 / self.martensite - 1.0 / self.austenite


def hardening(x: Floats | float, p: Floats | float, q: Floats | float) -> Floats:
    """f(x) above, from 0 to 1.

    Examples
    --------
    >>> hardening(0.5, 1.0, 1.0).item(), hardening(1.0, 0.3, 0.6).item()
    (0.5, 1.0)
    """
    x = np.asarray(x, dtype=float)
    return np.asarray(0.5 * (1.0 + x**p - (1.0 - x) ** q))


def ends(
    none: Floats | float, full: Floats | float, p: Floats | float, q: Floats | float
) -> tuple[Floats, Floats]:
    """Temperatures at which the law itself ends, from those where its tangent at half the transformation does.

    Parameters
    ----------
    none, full : ndarray or float
        Where the tangent reaches no martensite and all of it, as in ASTM E3097 [any unit of temperature].
    p, q : ndarray or float
        Exponents.

    Examples
    --------
    >>> [float(t) for t in ends(20.0, 10.0, 1.0, 1.0)]
    [20.0, 10.0]
    """
    steep = p * 2.0**-p + q * 2.0**-q
    half = 0.5 * (1.0 + 2.0**-p - 2.0**-q)
    per = (np.asarray(full) - none) / steep
    first = none - per * (half - 0.5 * steep)
    return np.asarray(first), np.asarray(first + per)


def share(temperature: Floats, none: float, full: float, p: float, q: float) -> Floats:
    """Share of martensite at temperatures (m,), the ends told by the tangent at half the transformation.

    Raises
    ------
    ValueError
        Unless ``none`` exceeds ``full``.
    """
    if not none > full:
        raise ValueError("no martensite must be at the higher temperature")
    first, last = (float(t) for t in ends(none, full, p, q))
    along = first + (last - first) * hardening(_NODES, p, q)
    return np.asarray(np.interp(temperature, along[::-1], _NODES[::-1]))


def crossed_at(
    cooling: tuple[float, float, float, float], heating: tuple[float, float, float, float]
) -> tuple[float, float]:
    """Greatest shares of martensite and of austenite with which heating is below cooling, 0 if none [1].

    The first is where little martensite is left, the second where little austenite is.

    Parameters
    ----------
    cooling, heating : tuple of float
        Temperatures of no martensite and of all, and exponents there, as in `share`, at the same stress.

    Examples
    --------
    >>> crossed_at((20.0, 10.0, 1.0, 1.0), (40.0, 30.0, 1.0, 1.0))
    (0.0, 0.0)
    >>> max(crossed_at((20.0, 10.0, 1.0, 1.0), (19.0, 13.0, 1.0, 1.0))) > 0.2
    True
    """
    along = []
    for none, full, p, q in (cooling, heating):
        first, last = ends(none, full, p, q)
        along.append(first + (last - first) * hardening(_NODES, p, q))
    below = _NODES[along[1] < along[0]]
    return (
        float(below[below <= 0.5].max(initial=0.0)),
        float((1.0 - below[below >= 0.5]).max(initial=0.0)),
    )


def transformation_strain(stress: Floats | float, least: Floats, most: Floats, k: Floats) -> Floats:
    """H(s) above [1]; the stress in MPa, `k` in 1/MPa."""
    return np.asarray(least + (most - least) * -np.expm1(-k * np.asarray(stress)))


def shift(
    stress: float, reference: float, strain: tuple[Floats, Floats, Floats], slopes: tuple[Floats, Floats],
    moduli: Moduli, *, cooling: bool,
) -> Floats:  # fmt: skip
    """How far a stress moves the transformation of a branch [K].

    Parameters
    ----------
    stress, reference : float
        [MPa].
    strain : tuple of ndarray
        H_min [1], H_max [1], k [1/MPa].
    slopes : tuple of ndarray
        C_A and C_M [MPa/K].
    moduli : Moduli
    cooling : bool
    """
    least, most, k = strain
    own, other = (slopes[1], slopes[0]) if cooling else slopes
    at = transformation_strain(reference, least, most, k)
    rise = at + reference * (most - least) * k * np.exp(-k * reference)
    elastic = moduli.compliance * reference
    weight = 2.0 * other * (rise + elastic) / (own + other) - elastic  # (1 -+ D) times the rise
    work = transformation_strain(stress, least, most, k) * stress * weight / rise
    return np.asarray((work + 0.5 * moduli.compliance * stress**2) / (own * (weight + elastic)))


def entropy(
    reference: float, strain: tuple[Floats, Floats, Floats], slopes: tuple[Floats, Floats], moduli: Moduli
) -> Floats:
    """Entropy of the transformation that the slopes C_A and C_M stand for [MPa/K]; parameters as in `shift`."""
    least, most, k = strain
    rise = transformation_strain(reference, *strain) + reference * (most - least) * k * np.exp(-k * reference)
    return np.asarray(
        2.0 * slopes[0] * slopes[1] * (rise + moduli.compliance * reference) / (slopes[0] + slopes[1])
    )


def beside_expansions(
    temperature: Floats, stress: float, entropy_change: Floats | float, difference: float, common: float
) -> Floats:
    """Where a transformation is once the work of the stress on the difference of the expansions counts, too.

    With it the driving force has ``s (alpha_M - alpha_A) (T - T_0)`` beside the work on the transformation strain.

    Parameters
    ----------
    temperature : ndarray
        Where it is without that, at the same stress [K].
    stress : float
        s [MPa].
    entropy_change : ndarray or float
        See `entropy`.
    difference : float
        ``alpha_M - alpha_A`` [1/K].
    common : float
        T_0, to which the strain refers [K].

    Examples
    --------
    >>> float(beside_expansions(np.array(330.0), 100.0, 0.2, 0.0, 400.0))
    330.0
    >>> round(float(beside_expansions(np.array(330.0), 100.0, 0.2, -4e-5, 400.0)), 2)
    331.37
    """
    return np.asarray(common + (temperature - common) / (1.0 - stress * difference / entropy_change))
