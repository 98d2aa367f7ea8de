"""Physics of the cross-checks: units by pint, limits, and inverses."""

from __future__ import annotations

import numpy as np
import pytest
from pint import UnitRegistry

from sma_bayes.paper.physics import (
    PUBLISHED_HELIX,
    Helix,
    apparent_shear_modulus,
    biased_path,
    quantisation_step,
    shear_modulus,
    shear_stress,
    spring_rate,
    steady_rise,
    wahl_factor,
    wire_resistance,
)

U = UnitRegistry()
HELIX = Helix(0.5 * U.mm, 3.0 * U.mm, 45 * U.dimensionless)
"""The published spring with units."""


def test_the_published_spring_is_that_of_lines_202_to_204() -> None:
    assert (PUBLISHED_HELIX.wire_diameter, PUBLISHED_HELIX.coil_diameter) == (5.0e-4, 3.0e-3)
    assert PUBLISHED_HELIX.coils == 45


@pytest.mark.parametrize(
    ("with_units", "unit", "plain"),
    [
        (lambda: HELIX.length, "m", PUBLISHED_HELIX.length),
        (lambda: HELIX.volume, "m**3", PUBLISHED_HELIX.volume),
        (lambda: HELIX.surface, "m**2", PUBLISHED_HELIX.surface),
        (lambda: spring_rate(30 * U.GPa, HELIX), "N/m", spring_rate(30e9, PUBLISHED_HELIX)),
        (
            lambda: apparent_shear_modulus(1.9 * U.N / U.cm, HELIX),
            "Pa",
            apparent_shear_modulus(190, PUBLISHED_HELIX),
        ),
        (lambda: shear_stress(100 * U.gram * U.g_0, HELIX), "Pa", shear_stress(0.980665, PUBLISHED_HELIX)),
        (
            lambda: wire_resistance(80 * U.microohm * U.cm, HELIX),
            "ohm",
            wire_resistance(8e-7, PUBLISHED_HELIX),
        ),
        (
            lambda: steady_rise(2 * U.A, 1.5 * U.ohm, 54.5 * U.W / U.m**2 / U.delta_degC, 6 * U.cm**2),
            "kelvin",
            steady_rise(2.0, 1.5, 54.5, 6e-4),
        ),
        (lambda: wahl_factor(HELIX), "dimensionless", wahl_factor(PUBLISHED_HELIX)),
    ],
)
def test_units_come_out_right_by_themselves(with_units, unit: str, plain: float) -> None:
    assert with_units().to(unit).magnitude == pytest.approx(plain, rel=1e-9)


def test_rate_and_modulus_are_inverses() -> None:
    assert apparent_shear_modulus(spring_rate(23.4e9, PUBLISHED_HELIX), PUBLISHED_HELIX) == pytest.approx(
        23.4e9
    )


def test_the_rate_follows_from_castigliano() -> None:
    """Energy of torsion alone, ``F² D² L/(8 G J)`` with ``J = π d⁴/32``, gives the compliance."""
    g, d, big_d = 30e9, PUBLISHED_HELIX.wire_diameter, PUBLISHED_HELIX.coil_diameter
    polar = np.pi * d**4 / 32
    compliance = big_d**2 * PUBLISHED_HELIX.length / (4 * g * polar)
    assert spring_rate(g, PUBLISHED_HELIX) == pytest.approx(1 / compliance)


def test_stress_is_torque_over_section_modulus() -> None:
    d = PUBLISHED_HELIX.wire_diameter
    torque = 1.0 * PUBLISHED_HELIX.coil_diameter / 2
    assert shear_stress(1.0, PUBLISHED_HELIX) == pytest.approx(torque / (np.pi * d**3 / 16))


def test_a_straight_bar_needs_no_factor_of_curvature() -> None:
    assert wahl_factor(Helix(1e-6, 1.0, 1)) == pytest.approx(1, abs=1e-5)


def test_an_incompressible_solid_has_a_third_of_the_modulus() -> None:
    assert shear_modulus(3.0, 0.5) == pytest.approx(1.0)


def test_a_converter_of_one_bit_has_two_steps() -> None:
    assert quantisation_step(20.0, 1) == 10.0


def test_the_slope_of_a_biased_path_is_the_bias_and_not_the_spring() -> None:
    k = np.geomspace(1.0, 1e4, 50)
    force, elongation = biased_path(k, 130.0, 0.01)
    np.testing.assert_allclose(force, 130.0 * (0.01 - elongation), rtol=1e-12)
    np.testing.assert_allclose(np.diff(force) / np.diff(elongation), -130.0, rtol=1e-9)
    np.testing.assert_allclose(force / elongation, k, rtol=1e-12)
