"""A difference of expansions that is none: what is told of it, and constants whose curves are those of the card."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import expit

from sma_bayes.studies.card.apart import CROSSED, crossing_of, kept_apart
from sma_bayes.studies.card.exports import simcoon_material
from sma_bayes.studies.card.features import logits
from sma_bayes.studies.card.law import Moduli, shift
from sma_bayes.studies.card.pooling import Constant, PooledConstants
from sma_bayes.studies.card.workflow import crossing_caution, expansion_caution

CONSTANTS = {
    "E_A": 60e3, "E_M": 40e3, "alpha_A": -1e-5, "alpha_M": -5e-5, "H_min": 0.005, "H_max": 0.04, "k": 0.01,
    "sigma_crit": 0.0, "C_A": 8.0, "C_M": 6.0, "Ms": 330.0, "Mf": 315.0, "As": 345.0, "Af": 358.0,
    "n1": 0.3, "n2": 0.2, "n3": 0.25, "n4": 0.4,
}  # fmt: skip
REFERENCE, COMMON = 120.0, 400.0


def material(**other: float) -> dict[str, float]:
    values = CONSTANTS | other
    card = PooledConstants({n: Constant(v, np.full(2, v)) for n, v in values.items()}, REFERENCE)
    found = simcoon_material(card, COMMON)
    assert found["T_init"] == COMMON
    return dict(zip(found["symbols"], found["props"], strict=True))


def test_phases_that_expand_alike_have_the_constants_of_the_card() -> None:
    found = material(alpha_M=-1e-5)
    assert {n: found[n] for n in CONSTANTS} == CONSTANTS | {"alpha_M": -1e-5}


@pytest.mark.parametrize("stress", [40.0, 120.0, 200.0])
def test_the_driving_force_vanishes_where_the_card_has_its_transformations(stress: float) -> None:
    """That of simcoon: -rho_s (T - T_i) + (1 -+ D) H s + s^2 DM/2 + s Da (T - T_0); slopes agree at 120 MPa."""
    c, own = material(), CONSTANTS
    moduli, strain = Moduli(own["E_A"], own["E_M"]), (own["H_min"], own["H_max"], own["k"])
    dm, da = 1.0 / c["E_M"] - 1.0 / c["E_A"], c["alpha_M"] - c["alpha_A"]

    def h(s: float) -> float:
        return float(c["H_min"] + (c["H_max"] - c["H_min"]) * (1.0 - np.exp(-c["k"] * s)))

    rise = h(REFERENCE) + REFERENCE * (c["H_max"] - c["H_min"]) * c["k"] * np.exp(-c["k"] * REFERENCE)
    entropy = 2.0 * c["C_A"] * c["C_M"] * (rise + REFERENCE * dm) / (c["C_A"] + c["C_M"])
    d = (c["C_M"] - c["C_A"]) * (rise + REFERENCE * dm) / ((c["C_A"] + c["C_M"]) * rise)
    for cooling, names in ((True, ("Ms", "Mf")), (False, ("As", "Af"))):
        by = float(shift(stress, REFERENCE, strain, (own["C_A"], own["C_M"]), moduli, cooling=cooling))
        for name in names:
            t = own[name] + by
            work = (1.0 - d if cooling else 1.0 + d) * h(stress) * stress + 0.5 * dm * stress**2
            force = -entropy * (t - c[name]) + work + stress * da * (t - COMMON)
            assert abs(force) / entropy < (1e-3 if stress == REFERENCE else 0.4)  # [K]


@pytest.mark.parametrize(("austenite", "martensite"), [(1.1e-5, 8e-6), (-1e-4, -1e-4)])
def test_expansions_that_are_nearly_the_same_are_no_caution(austenite: float, martensite: float) -> None:
    assert expansion_caution(austenite, martensite) == ()


def test_slopes_that_differ_are_told_with_what_helps() -> None:
    (text,) = expansion_caution(-1.1e-4, -1.6e-4)
    assert "-50 microstrain per K" in text
    assert "tangent_mode='closest_point'" in text


NITIHF = {
    **CONSTANTS, "C_A": 10.2, "C_M": 7.3, "H_min": 0.0004, "H_max": 0.0387, "k": 0.012,
    "Ms": 429.3, "Mf": 387.1, "As": 418.4, "Af": 446.3, "n1": 0.11, "n2": 0.05, "n3": 0.05, "n4": 0.1,
}  # fmt: skip
"""Constants of a NiTiHf wire: its tails cross where little martensite is left."""
STRESSES = (100.0, 300.0)


def law_of(constants: dict[str, float]) -> PooledConstants:
    return PooledConstants({n: Constant(v, np.full(2, v)) for n, v in constants.items()}, 200.0)


def test_branches_that_cross_are_kept_apart_by_sharper_corners() -> None:
    law = law_of(NITIHF)
    assert crossing_of(law, STRESSES) > 0.05
    apart = kept_apart(law, STRESSES)
    assert crossing_of(apart, STRESSES) <= CROSSED
    for name, one in apart.constants.items():
        if name in ("n1", "n3"):
            assert one.value > 1.5 * NITIHF[name]
            assert not one.identified
            assert "of martensite or less is left" in one.why
            assert one.draws == pytest.approx(one.value)
        else:
            assert one is law.constants[name]
    # no more than it takes
    c = {n: one.value for n, one in apart.constants.items()}
    less = {n: float(expit(logits(np.asarray(c[n])) - 0.1)) for n in ("n1", "n3")}
    assert crossing_of(law_of({**c, **less}), STRESSES) > 0.5 * CROSSED


def test_branches_that_do_not_cross_stay_as_they_are() -> None:
    law = law_of(CONSTANTS)
    kept = kept_apart(law, STRESSES)
    assert all(one is law.constants[n] for n, one in kept.constants.items())
    assert crossing_caution(crossing_of(law, STRESSES)) == ()


def test_tangents_that_cross_are_told() -> None:
    """Heating in the middle of cooling: no corner helps."""
    law = kept_apart(law_of({**NITIHF, "As": 375.0, "Af": 425.0}), STRESSES)
    shared = crossing_of(law, STRESSES)
    assert shared > 0.3
    (text,) = crossing_caution(shared)
    assert text.startswith("simcoon does not give this card back")
    assert "constitutive-curves.csv" in text
    assert simcoon_material(law, COMMON, (text,))["cautions"] == [text]
    assert "cautions" not in simcoon_material(law_of(CONSTANTS), COMMON)
