"""What the label of a prior states is what its numbers are."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.effects import EFFECTS, Scales
from sma_bayes.effects.types import either_sign
from sma_bayes.parameters.distributions import Distribution, Uniform
from sma_bayes.records.history import History

from .conftest import with_force

NUMBER = r"(-?\d+(?:\.\d+)?(?:e-?\d+)?)"
BETWEEN = re.compile(rf"90 % between {NUMBER} and {NUMBER}")
WITHIN = re.compile(rf"90 % within (?:a (tenth)|{NUMBER})")
ANY = re.compile(rf"from {NUMBER} to {NUMBER}")
ROUNDED = 0.04
"""Relative difference that rounding a label to two digits can make."""

In = Callable[[Scales, np.ndarray], np.ndarray]
"""From the unit of a parameter to that of its label."""


def times(factor: Callable[[Scales], float]) -> In:
    return lambda scales, x: x * factor(scales)


def per_drift(scales: Scales) -> float:
    """What goes with a drift by a tenth of the stroke."""
    return 0.1 * scales.span["displacement"]


def half_swing(scales: Scales) -> float:
    return 0.5 * scales.span["ambient_temperature"]


def hottest(scales: Scales) -> float:
    return scales.high["temperature"] + 273.15


LABELS: Mapping[str, In] = {
    "contact_error.b": times(lambda s: 100.0),
    "stress_stroke.k": times(lambda s: 100.0 * s.level["load"]),
    "rate_dependence.k": lambda s, x: x * s.level["typical_rate"] ** 0.0,
    "temperature_gradient.g": times(
        lambda s: max(abs(s.high["temperature"] - 22.0), abs(s.low["temperature"] - 22.0))
    ),
    "asymmetric_kinetics.a": lambda s, x: np.exp(x),
    "r_phase.p": times(lambda s: 100.0),
    "r_phase.TR": lambda s, x: 100.0 * (x - s.low["temperature"]) / s.span["temperature"],
    "training_drift.d": times(
        lambda s: 100.0 / s.span["displacement"] / -np.expm1(-(s.level["last_cycle"] - 1.0) / 12.0)
    ),
    "training.d": times(
        lambda s: 100.0 / s.span["displacement"] / -np.expm1(-(s.level["last_cycle"] - 1.0) / 12.0)
    ),
    "training.k_heating": times(lambda s: 100.0 * per_drift(s)),
    "training.k_cooling": times(lambda s: 100.0 * per_drift(s)),
    "training.m_heating": times(per_drift),
    "training.m_cooling": times(per_drift),
    "amplitude_fatigue.k": times(lambda s: 100.0),
    "hot_creep.c": times(
        lambda s: (
            0.2
            * s.span["time"]
            / s.span["displacement"]
            * np.exp((s.high["temperature"] - 100.0) / (8.314462618 * hottest(s) ** 2 / 141e3))
        )
    ),
    "hot_creep.w": lambda s, x: 1e-3 * 8.314462618 * hottest(s) ** 2 / x,
    "guide_friction.Fc": times(lambda s: 1e3),
    "guide_friction.x0": times(lambda s: 100.0 / s.span["displacement"]),
    "guide_friction.v0": times(
        lambda s: 100.0 * s.span["temperature"] / s.span["displacement"] / s.level["typical_rate"]
    ),
    "sensor_drift.r": times(lambda s: 100.0 * s.span["time"] / s.span["force"]),
    "load_cell_thermal_drift.k": times(lambda s: 100.0 / (5.0 * s.level["force"])),
    "load_cell_thermal_drift.tau": times(lambda s: 1.0 / 60.0),
    "load_cell_thermal_drift.soak": times(lambda s: 100.0),
    "thermal_expansion.e": times(lambda s: 1.0 / 0.1),
    "fixture_compliance.q": times(lambda s: 1e3),
    "saturation.Fmax": lambda s, x: 100.0 * (x - s.high["force"]) / s.span["force"],
    "quantisation.lsb": lambda s, x: 100.0 * (x - s.step["force"]) * s.span["force"] / s.step["force"] ** 2,
    "quantisation.F0": lambda s, x: 100.0 * (x - s.on_lattice["force"]) / s.step["force"],
    "drive_ripple.a": times(lambda s: 100.0 / s.span["force"]),
    "clock_skew.d": times(lambda s: 1e3),
    "run_offset.s": times(lambda s: 100.0 / s.span["displacement"]),
    "run_offset.w": times(lambda s: 0.02 * s.span["displacement"]),
    "cycle_offset.s": times(lambda s: 100.0 / s.span["displacement"]),
    "cycle_offset.w": times(lambda s: 0.02 * s.span["displacement"]),
    "latent_heat.L": times(lambda s: 1e-3),
    "ambient_draught.e": times(half_swing),
}
"""Labels in another unit than their parameter."""


def stated(source: str) -> tuple[float, float] | None:
    """Ends of the 90 % range that a label states; None where it states none."""
    if found := BETWEEN.search(source):
        return float(found[1]), float(found[2])
    if found := WITHIN.search(source):
        half = 0.1 if found[1] else float(found[2])
        return -half, half
    return None


def agrees(source: str, prior: Distribution, scales: Scales, told: In) -> None:
    """Assert that a label states what a prior is."""
    if isinstance(prior, Uniform):
        ends = ANY.search(source)
        assert ends, source
        p, expected = np.array([0.0, 1.0]), np.array([float(ends[1]), float(ends[2])])
    else:
        ends = stated(source)
        assert ends, source
        p, expected = np.array([0.05, 0.95]), np.array(ends)
    found = np.sort(
        np.abs(told(scales, prior.quantile(p))) if np.all(expected > 0.0) else told(scales, prior.quantile(p))
    )
    np.testing.assert_allclose(found, expected, rtol=ROUNDED, err_msg=source)


def as_it_is(scales: Scales, x: np.ndarray) -> np.ndarray:
    return x


@pytest.mark.parametrize(
    "name", [n for n, e in EFFECTS.items() if type(e).__module__.startswith("sma_bayes.")]
)
def test_the_label_of_every_prior_is_its_range(
    name: str, measured: Sequence[History], suited: Mapping[str, Sequence[History]]
) -> None:
    scales = Scales.of(suited.get(name, measured))
    if name == "rate_dependence":
        scales = replace(scales, level={**scales.level, "typical_rate": 1.0})
    for p in EFFECTS[name].parameters(scales):
        agrees(p.source, p.prior, scales, LABELS.get(f"{name}.{p.name}", as_it_is))


def in_other_units(measured: Sequence[History], **units: str) -> Scales:
    scales = Scales.of(measured)
    return replace(scales, units={**scales.units, **units}, specimen=units.get("force") == "Pa")


def test_labels_of_specimens(measured: Sequence[History]) -> None:
    """Stress in Pa, strain without unit: of a wire, so without the factor between shear and tension."""
    scales = in_other_units(measured, force="Pa", displacement="1")
    for name, told in {
        "stress_shift": lambda s, x: 1e-6 / x,
        "path_stress_shift": lambda s, x: 1e-6 / x,
        "thermal_expansion": as_it_is,
        "fixture_compliance": times(lambda s: 30e9),
    }.items():
        (p,) = EFFECTS[name].parameters(scales)
        agrees(p.source, p.prior, scales, told)


def test_labels_in_arbitrary_units(measured: Sequence[History]) -> None:
    scales = in_other_units(measured, force="1", displacement="1")
    stroke = scales.span["displacement"]
    for name, told in {
        "path_stress_shift": times(lambda s: s.level["force"]),
        "fixture_compliance": times(lambda s: 100.0 * s.span["force"] / stroke),
        "bias_spring": times(lambda s: stroke / s.span["force"]),
        "dead_load": times(lambda s: s.level["load"] / s.level["force"]),
    }.items():
        (p,) = EFFECTS[name].parameters(scales)
        agrees(p.source, p.prior, scales, told)
    friction = EFFECTS["guide_friction"].parameters(scales)[0]
    agrees(friction.source, friction.prior, scales, times(lambda s: 100.0 / s.span["force"]))


def test_a_spring_is_sheared_and_a_wire_is_pulled(measured: Sequence[History]) -> None:
    """The published spring: d = 0.5 mm, D = 3 mm, and 7.1 MPa/K, give 15 K/N, which the prior must hold likely."""
    shear = 8.0 * 3e-3 / (np.pi * 0.5e-3**3)
    expected = np.sqrt(3.0) * shear * 1.4e-7
    (p,) = EFFECTS["stress_shift"].parameters(Scales.of(measured))
    low, high = p.prior.quantile(np.array([0.05, 0.95]))
    assert expected == pytest.approx(14.8, rel=0.01)
    assert low < expected < high
    for wire, index in ((1.2e-3, 4.0), (0.4e-3, 10.0)):
        of_spring = np.sqrt(3.0) * 8.0 * index / (np.pi * wire**2) * 1.4e-7
        assert low < of_spring < 1.6 * high


def turned_round(measured: Sequence[History]) -> tuple[History, ...]:
    """The same with pull logged as negative and loads declared as negative."""
    return tuple(
        replace(h, inputs={**h.inputs, "load": -h.inputs["load"]}) for h in with_force(measured, lambda f: -f)
    )


@pytest.mark.parametrize("name", ["stress_shift", "stress_stroke", "path_stress_shift"])
def test_a_pull_that_is_logged_as_negative_acts_by_its_magnitude(
    name: str, measured: Sequence[History]
) -> None:
    plain, turned = (
        EFFECTS[name].parameters(Scales.of(h))[0].prior for h in (measured, turned_round(measured))
    )
    p = np.array([0.05, 0.5, 0.95])
    np.testing.assert_allclose(turned.quantile(p), -plain.quantile(p)[::-1], rtol=1e-9)


def test_a_weight_is_borne_with_the_sign_of_the_force(measured: Sequence[History]) -> None:
    """Pull logged as negative under loads that are not: a newton more that hangs is a newton less in the file."""
    both, turned = measured, turned_round(measured)
    force_only = with_force(measured, lambda f: -f)
    p = np.array([0.05, 0.5, 0.95])
    plain, same, opposite = (
        EFFECTS["dead_load"].parameters(Scales.of(h))[0].prior.quantile(p) for h in (both, turned, force_only)
    )
    assert plain[0] < 1.0 < plain[2]
    np.testing.assert_allclose(same, plain)
    np.testing.assert_allclose(opposite, -plain[::-1], rtol=1e-9)


def test_the_share_of_a_load_has_no_unit_where_both_are_forces_or_stresses(
    measured: Sequence[History],
) -> None:
    units = [
        EFFECTS["dead_load"].parameters(scales)[0].unit
        for scales in (
            Scales.of(measured),
            in_other_units(measured, force="Pa", displacement="1"),
            in_other_units(measured, force="1"),
        )
    ]
    assert units == ["1", "1", "1/N"]


def test_a_range_ends_at_the_farthest_force_of_either_sign(measured: Sequence[History]) -> None:
    cut = with_force(measured, lambda f: np.minimum(f, 2.6))
    down = with_force(cut, lambda f: -f)
    effect, inputs = EFFECTS["saturation"], measured[0].inputs
    up, low = (
        np.array([float(p.prior.quantile(np.array(0.5))) for p in effect.parameters(Scales.of(h))])
        for h in (cut, down)
    )
    assert low[1] == pytest.approx(-up[1])
    force = measured[0].observed["force"] * 1.5
    above = effect.apply(lambda _: {"force": force}, up, inputs)["force"]
    below = effect.apply(lambda _: {"force": -force}, low, inputs)["force"]
    assert np.max(above) < np.max(force)
    np.testing.assert_allclose(below, -above)


def test_contraction_turns_the_sign_of_a_compliance(measured: Sequence[History]) -> None:
    """Where the stroke is logged as contraction a rig that gives way takes from it."""
    (p,) = EFFECTS["fixture_compliance"].parameters(Scales.of(measured))
    assert float(p.prior.quantile(np.array(0.5))) == pytest.approx(0.0, abs=1e-12)
    out = {
        "force": np.array([1.0, 2.0]),
        "displacement": np.array([1e-3, 3e-3]),
        "stiffness": np.array([500.0, 500.0]),
    }
    there = EFFECTS["fixture_compliance"].apply(lambda _: out, np.array([-1e-4]), {})
    ratio = np.diff(there["force"]) / np.diff(there["displacement"])
    np.testing.assert_allclose(there["stiffness"], ratio[0], rtol=1e-12)


def test_either_sign_is_within_what_it_is_told() -> None:
    prior = either_sign(3.0)
    np.testing.assert_allclose(prior.quantile(np.array([0.05, 0.5, 0.95])), [-3.0, 0.0, 3.0], atol=1e-12)
    assert float(prior.quantile(np.array(0.75))) == pytest.approx(0.28 * 3.0, rel=0.01)


def test_a_label_that_lies_is_found() -> None:
    with pytest.raises(AssertionError):
        agrees("90 % between 1 and 2", Uniform(0.0, 1.0), None, as_it_is)  # type: ignore[arg-type]
    with pytest.raises(AssertionError):
        agrees("90 % within 2.5", either_sign(3.0), None, as_it_is)  # type: ignore[arg-type]
