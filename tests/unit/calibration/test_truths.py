"""Truths of the calibration: noise of the stated size, seeds that depend on nothing else, records that are whole."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from calibration import noises
from calibration.real_residuals import (
    TURNED,
    double_logistic,
    each_sweep,
    moved,
    smooth_rest,
    sweep,
    sweep_count,
    turned,
)
from calibration.trials import missing
from calibration.truths import LEVELS, TRUTHS, seed_of

NOWHERE = Path("no such folder")
KINDS = {
    "white": noises.white,
    "ar1": noises.autoregressive(0.9),
    "student": noises.student(3.0),
    "growing": noises.growing(),
}


@pytest.mark.parametrize("name", KINDS)
def test_noise_has_unit_variance(name: str) -> None:
    rng, passed = np.random.default_rng(0), np.linspace(0.0, 1.0, 400)
    e = np.stack([KINDS[name](rng, passed) for _ in range(1000)])
    # heavy tails make the sample variance of t converge slowly; quantiles are checked below
    assert np.mean(e**2) == pytest.approx(1.0, rel=0.25 if name == "student" else 0.03)
    assert np.mean(e) == pytest.approx(0.0, abs=0.03)


def test_the_autoregressive_noise_has_its_correlation_from_the_first_sample() -> None:
    rng = np.random.default_rng(1)
    e = np.stack([noises.autoregressive(0.9)(rng, np.zeros(50)) for _ in range(4000)])
    assert np.mean(e[:, :-1] * e[:, 1:], axis=0) == pytest.approx(0.9, abs=0.08)
    assert np.var(e[:, 0]) == pytest.approx(1.0, abs=0.08)


def test_growing_noise_is_four_times_as_large_at_the_end() -> None:
    rng = np.random.default_rng(2)
    e = np.stack([noises.growing()(rng, np.array([0.0, 1.0])) for _ in range(20_000)])
    assert e[:, 1].std() / e[:, 0].std() == pytest.approx(4.0, rel=0.03)


def test_students_noise_has_the_quantiles_of_three_degrees() -> None:
    e = noises.student(3.0)(np.random.default_rng(3), np.zeros(200_000)) * np.sqrt(3.0)
    assert np.quantile(e, (0.95, 0.99)) == pytest.approx([2.353, 4.541], rel=0.02)


def test_rounding_keeps_multiples_of_the_step() -> None:
    assert noises.rounded(np.array([0.0, 0.26, 0.24, -0.76]), 0.5).tolist() == [0.0, 0.5, 0.0, -1.0]


@pytest.mark.parametrize("name", [n for n, t in TRUTHS.items() if not t.needs])
@pytest.mark.parametrize("repeat", [0, 3])
def test_a_truth_makes_the_same_record_again(name: str, repeat: int) -> None:
    case, same = (
        TRUTHS[name].make(repeat, np.random.default_rng(seed_of(name, repeat)), NOWHERE) for _ in range(2)
    )
    for channel, y in case.record.observed.items():
        assert np.array_equal(y, same.record.observed[channel])
    other = TRUTHS[name].make(repeat, np.random.default_rng(seed_of(name, repeat + 6)), NOWHERE)
    assert not np.array_equal(other.record.temperature, case.record.temperature)


SEEN_DIRECTLY = [
    n
    for n, t in TRUTHS.items()
    if not t.needs and n not in ("rounded", "differing_sweeps") and not n.startswith("temperature")
]


@pytest.mark.parametrize("name", SEEN_DIRECTLY)
def test_readings_scatter_as_stated(name: str) -> None:
    case = TRUTHS[name].make(1, np.random.default_rng(seed_of(name, 1)), NOWHERE)
    rng = np.random.default_rng(0)
    t = case.record.temperature
    again = [case.again(rng)[1] for _ in range(100)]
    for channel, curve in case.curves.items():
        span = np.ptp(curve.value(np.linspace(t.min(), t.max(), 400)))
        level = np.std([y[channel] - curve.value(t) for y in again]) / span
        # noise that grows is of unit variance where the transformation passes evenly, which no sweep does
        assert level == pytest.approx(LEVELS[1], rel={"growing": 0.3, "student_t": 0.2}.get(name, 0.06))


def test_readings_of_sweeps_that_differ_scatter_about_their_mean_curve() -> None:
    case = TRUTHS["differing_sweeps"].make(0, np.random.default_rng(seed_of("differing_sweeps", 0)), NOWHERE)
    rng = np.random.default_rng(0)
    (logged, *_), again = zip(*(case.again(rng) for _ in range(400)), strict=True)
    readings = np.stack([y["displacement"] for y in again])
    spread = readings.std(axis=0)
    truth = case.curves["displacement"].value(logged)
    # both means are of 400 sweeps: 4 of their standard errors, false once in 400 for 40 temperatures
    assert np.all(np.abs(readings.mean(axis=0) - truth) < 4.0 * spread * np.sqrt(2.0 / 400.0))
    assert spread.min() > 2.0 * case.level * np.ptp(truth)
    assert np.unique(case.record.inputs["segment"]).size == 4


@pytest.mark.parametrize("name", [n for n in TRUTHS if n.startswith("temperature")])
def test_temperatures_err_as_stated_and_the_response_does_not(name: str) -> None:
    case = TRUTHS[name].make(3, np.random.default_rng(seed_of(name, 3)), NOWHERE)
    rng = np.random.default_rng(0)
    pairs = [case.again(rng) for _ in range(400)]
    logged = np.stack([t for t, _ in pairs])
    stated = case.record.temperature_sd if case.record.temperature_sd > 0.0 else 0.5
    assert (case.record.temperature_sd == 0.0) == (name == "temperature_undeclared")
    assert logged.std() == pytest.approx(np.hypot(stated, logged.mean(axis=0).std()), rel=0.01)
    assert logged.std(axis=0).mean() == pytest.approx(stated, rel=0.02)
    true = np.linspace(*logged.mean(axis=0)[[0, -1]], case.record.n)
    for channel, curve in case.curves.items():
        spread = np.std([y[channel] for _, y in pairs], axis=0)
        span = np.ptp(curve.value(true))
        assert spread == pytest.approx(np.full(true.size, LEVELS[1] * span), rel=0.2)


def test_what_a_truth_needs_is_told() -> None:
    assert missing("white", NOWHERE) == ""
    assert "no real measurements" in missing("real_residuals", NOWHERE)


def test_the_simulated_loop_transforms_on_both_branches() -> None:
    pytest.importorskip("simcoon", reason="simcoon is not installed (extra `simcoon`)")
    from calibration.simulated_loop import isobaric_cycle

    cycle = isobaric_cycle(120.0, 0.35, 20.0)
    t = np.linspace(-20.0, 140.0, 801)
    middles = {}
    for branch, curve in cycle.items():
        strain = curve.value(t)
        # 120 MPa orient 92 % of the greatest transformation strain of 0.045
        assert np.ptp(strain) == pytest.approx(0.045 * -np.expm1(-0.021 * 120.0), rel=0.05)
        middles[branch] = t[np.argmin(np.abs(strain - 0.5 * (strain.max() + strain.min())))]
    assert middles["heating"] - middles["cooling"] > 10.0  # hysteresis


def test_the_simulated_loop_is_measured_with_its_stated_noise() -> None:
    pytest.importorskip("simcoon", reason="simcoon is not installed (extra `simcoon`)")
    case = TRUTHS["simulated_loop"].make(0, np.random.default_rng(seed_of("simulated_loop", 0)), NOWHERE)
    (y,) = case.record.observed.values()
    clean = case.curves["displacement"].value(case.record.temperature)
    assert np.std(y - clean) / np.ptp(clean) == pytest.approx(LEVELS[0], rel=0.3)


def test_the_smooth_curve_through_a_sweep_follows_it() -> None:
    """Of a curve of its own family it leaves the noise, and its slope is its derivative."""
    t = np.linspace(20.0, 80.0, 150)
    true = 1.0 + 0.002 * t + 2.0 / (1.0 + np.exp(-0.4 * (t - 45.0))) + 0.4 / (1.0 + np.exp(-0.7 * (t - 62.0)))
    noise = 0.004 * np.random.default_rng(0).standard_normal(t.size)
    curve = double_logistic(t, true + noise)
    assert np.sqrt(np.mean((curve.value(t) - true) ** 2)) < 0.002
    step = 1e-4
    numerical = (curve.value(t + step) - curve.value(t - step)) / (2.0 * step)
    assert curve.slope(t) == pytest.approx(numerical, rel=1e-5, abs=1e-7)


def test_a_spline_takes_what_is_smooth_and_leaves_the_scatter() -> None:
    """A wave of twice the scatter is found within a third of that; of scatter alone next to nothing is taken."""
    t = np.linspace(20.0, 80.0, 160)
    wave = 0.02 * np.sin(0.2 * t)
    noise = 0.01 * np.random.default_rng(1).standard_normal(t.size)
    found = smooth_rest(t, wave + noise)
    assert np.sqrt(np.mean((found.value(t) - wave) ** 2)) < 0.0035
    assert np.std(smooth_rest(t, noise).value(t)) < 0.003
    step = 1e-4
    t = np.linspace(15.0, 85.0, 141)
    numerical = (found.value(t + step) - found.value(t - step)) / (2.0 * step)
    assert found.slope(t) == pytest.approx(numerical, rel=1e-4, abs=1e-7)
    assert np.ptp(found.slope(np.linspace(80.0, 85.0, 6))) < 1e-12  # straight beyond the sweep


def test_scatter_stays_in_its_place_and_misfit_is_moved() -> None:
    residual = np.arange(1.0, 48.0)
    again = turned(residual, np.random.default_rng(0))
    assert np.array_equal(np.abs(again), residual)
    turns = np.flatnonzero(np.diff(np.sign(again)))
    assert turns.size >= 1
    assert set(np.diff(turns) % TURNED) <= {0}
    elsewhere = moved(residual, np.random.default_rng(0))
    assert np.array_equal(np.sort(np.abs(elsewhere)), residual)
    assert not np.array_equal(np.abs(elsewhere), residual)


def test_real_sweeps_have_curves_that_leave_little(shared_data: Path) -> None:
    assert sweep_count(shared_data) >= 30
    rough, smooth = (sweep(shared_data, 3, smooth=s) for s in (False, True))
    (y,) = rough.record.observed.values()
    assert np.std(smooth.residual) < np.std(rough.residual) < 0.02 * np.ptp(y)
    assert rough.curve.value(rough.record.temperature) + rough.residual == pytest.approx(y)
    assert smooth.curve.value(rough.record.temperature) + smooth.residual == pytest.approx(y)
    assert all(one.inputs["segment"].min() == one.inputs["segment"].max() for one in each_sweep(rough.record))
