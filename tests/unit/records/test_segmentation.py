"""Sweeps: turning points under noise and held samples, drives, explicit columns, holds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import find_peaks

from sma_bayes.records.segmentation import (
    Smoothed,
    Sweep,
    drive_is_on,
    first_of_each_reading,
    noise_sd,
    smooth,
    span,
    sweeps_of_column,
    sweeps_of_drive,
    sweeps_of_temperature,
    turning_points,
    with_quiet_ends,
    without_holds,
)


def triangle(rows: int, cycles: float = 1.0, low: float = 20.0, high: float = 90.0) -> np.ndarray:
    """Temperature that rises and falls at constant rate, `rows` rows a branch."""
    phase = np.arange(round(2 * rows * cycles) + 1) / rows % 2.0
    return low + (high - low) * (1.0 - np.abs(1.0 - phase))


def sweeps(temperature: np.ndarray) -> list[tuple[int, int, bool]]:
    return [(s.start, s.stop, s.heating) for s in sweeps_of_temperature(smooth(temperature))]


def exact(values: np.ndarray) -> Smoothed:
    return Smoothed(values, 0.0, 1)


def test_turning_points_alternate_and_keep_only_large_returns() -> None:
    values = np.array([0.0, 5.0, 4.0, 9.0, 8.5, 8.9, 2.0, 3.0, 0.0, 7.0])
    assert turning_points(values, 2.0).tolist() == [0, 3, 8, 9]
    assert turning_points(values, 0.9).tolist() == [0, 1, 2, 3, 6, 7, 8, 9]


def test_turning_points_of_a_constant_are_none() -> None:
    assert turning_points(np.full(100, 3.0), 0.1).size == 0
    assert turning_points(np.empty(0), 0.1).size == 0


def test_turning_points_are_the_peaks_of_the_same_prominence() -> None:
    values = np.cumsum(np.random.default_rng(3).normal(size=5000))
    turns = turning_points(values, 12.0)
    peaks = find_peaks(np.r_[-np.inf, values, -np.inf], prominence=12.0)[0] - 1
    maxima = [t for t in turns.tolist() if values[t] == values[max(0, t - 20) : t + 21].max()]
    assert len(maxima) > 5
    assert set(maxima[1:-1]) <= set(peaks.tolist()) <= set(maxima)
    assert np.all(np.abs(np.diff(values[turns])) > 12.0)


def test_turns_in_a_long_quiet_record_are_found_beyond_the_first_chunks() -> None:
    values = np.r_[np.zeros(5000), np.linspace(0.0, 1.0, 3000), np.linspace(1.0, 0.0, 2000)]
    assert turning_points(values, 0.2).tolist() == [0, 7999, 9999]


def test_two_full_cycles() -> None:
    assert sweeps(triangle(100, 2)) == [
        (0, 101, True),
        (101, 201, False),
        (201, 301, True),
        (301, 401, False),
    ]


def test_start_in_mid_branch_and_last_part_cycle() -> None:
    values = triangle(100, 3)[40:530]
    assert sweeps(values) == [(0, 61, True), (61, 161, False), (161, 261, True), (261, 361, False),
                              (361, 461, True), (461, 490, False)]  # fmt: skip


def test_a_single_branch_is_one_sweep() -> None:
    assert sweeps(np.linspace(90.0, 20.0, 50)) == [(0, 50, False)]


def test_held_samples_and_digits_do_not_hide_the_sweeps() -> None:
    held = np.round(np.repeat(triangle(60, 2), 8), 0)
    found = sweeps(held)
    assert [h for *_, h in found] == [True, False, True, False]
    assert [start for start, *_ in found[1:]] == pytest.approx([480, 960, 1440], abs=25)


def test_two_sampling_rates() -> None:
    slow = triangle(40, 3)
    fast = np.linspace(20.0, 90.0, 3000)
    found = sweeps(np.r_[np.full(700, 20.0), fast, slow[41:]])
    assert [h for *_, h in found] == [True, False, True, False, True, False]
    assert found[1][0] == pytest.approx(3699, abs=2)


def test_correlated_noise_of_a_few_degrees_does_not_add_sweeps() -> None:
    rng = np.random.default_rng(11)
    noise = np.zeros(2401)
    for k in range(1, noise.size):
        noise[k] = 0.8 * noise[k - 1] + rng.normal(0.0, 1.5)
    found = sweeps(triangle(400, 3) + noise)
    assert [h for *_, h in found] == [True, False] * 3


@pytest.mark.parametrize("n", [30, 1000, 30000])
def test_noise_alone_has_no_sweep(n: int) -> None:
    assert sweeps(50.0 + np.random.default_rng(5).normal(0.0, 0.3, n)) == []
    assert sweeps(np.round(50.0 + np.random.default_rng(6).normal(0.0, 0.1, n), 1)) == []


def test_noise_is_estimated_on_a_ramp_with_outliers_and_held_samples() -> None:
    rng = np.random.default_rng(2)
    values = np.linspace(0.0, 300.0, 5000) + rng.normal(0.0, 0.7, 5000)
    values[::40] += 50.0
    assert noise_sd(np.repeat(values, 5)) == pytest.approx(0.7, rel=0.2)
    assert noise_sd(np.arange(5.0)) == 0.0


def test_only_noisy_temperatures_are_averaged() -> None:
    clean = triangle(200, 2)
    assert smooth(clean).window == 1
    noisy = smooth(clean + np.random.default_rng(1).normal(0.0, 6.0, clean.size))
    assert noisy.window > 5
    assert noisy.noise == pytest.approx(6.0 / np.sqrt(noisy.window), rel=0.2)


def test_first_of_each_reading_of_nothing() -> None:
    assert first_of_each_reading(np.empty(0)).size == 0


def test_column_says_what_is_heating() -> None:
    branch = np.array([np.nan, 1.0, 1.0, -1.0, -1.0, 0.0, 1.0])
    assert sweeps_of_column(branch) == (Sweep(1, 3, True), Sweep(3, 5, False), Sweep(6, 7, True))


def test_drive_bounds_heating_although_the_sensor_lags() -> None:
    drive = np.tile(np.r_[np.ones(100), np.zeros(200)], 3)
    temperature = np.empty(drive.size)
    alloy = sensor = 20.0
    for k, on in enumerate(drive):
        alloy += 0.02 * ((90.0 if on else 20.0) - alloy)
        sensor += 0.1 * (alloy - sensor)
        temperature[k] = sensor
    drive[[30, 150, 151, 420]] = [0.0, 105.0, 1025.0, 116.0]  # stray digits
    on, stray = drive_is_on(drive)
    assert np.flatnonzero(stray).tolist() == [30, 150, 151, 420]
    found = sweeps_of_drive(smooth(temperature), on)
    assert [s.heating for s in found] == [True, False] * 3
    assert [s.start for s in found] == [0, 100, 300, 400, 600, 700]
    assert temperature[100:].max() > temperature[99]  # the sensor still rose when the drive was off


def test_heating_ends_at_the_peak_where_the_drive_fades_out() -> None:
    temperature = np.r_[triangle(100), np.full(50, 20.0)]
    drive = np.r_[np.ones(150), np.zeros(101)]
    assert sweeps_of_drive(exact(temperature), drive_is_on(drive)[0]) == (
        Sweep(0, 101, True),
        Sweep(101, 251, False),
    )


def test_rows_before_the_first_pulse_belong_to_no_sweep() -> None:
    temperature = np.r_[np.full(80, 20.0), triangle(100)]
    drive = np.r_[np.zeros(80), np.ones(100), np.zeros(101)]
    found = sweeps_of_drive(exact(temperature), drive_is_on(drive)[0])
    assert found == (Sweep(80, 180, True), Sweep(180, 281, False))


@pytest.mark.parametrize(
    "drive",
    [np.zeros(201), np.ones(201), np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0], 21)[:201]],
)
def test_a_drive_that_does_not_explain_the_temperature_is_refused(drive: np.ndarray) -> None:
    assert sweeps_of_drive(exact(triangle(100)), drive_is_on(drive)[0]) == ()


def test_ramps_and_sinusoids_lose_nothing_to_the_hold_rule() -> None:
    ramp = exact(np.linspace(20.0, 90.0, 300))
    assert without_holds(Sweep(0, 300, True), ramp) == Sweep(0, 300, True)
    wave = exact(np.cos(np.linspace(0.0, np.pi, 300)))
    assert without_holds(Sweep(0, 300, False), wave) == Sweep(0, 300, False)


def test_holds_are_cut_to_a_fifth_of_the_sweep_proper() -> None:
    values = np.r_[np.full(600, 20.0), np.linspace(20.0, 90.0, 200), np.full(900, 90.0)]
    proper = 180  # without the last twentieth at both ends
    kept = without_holds(Sweep(0, values.size, True), exact(values))
    assert kept.start == pytest.approx(600 + 10 - 0.2 * proper, abs=2)
    assert kept.stop == pytest.approx(800 - 10 + 0.2 * proper, abs=2)


def test_free_cooling_keeps_its_slow_tail_but_not_the_wait_at_ambient() -> None:
    tau = 100.0
    values = 25.0 + 40.0 * np.exp(-np.arange(3000) / tau)
    kept = without_holds(Sweep(0, 3000, False), exact(values))
    assert kept.start == 0
    assert values[kept.stop] - 25.0 < 0.03 * 40.0
    assert kept.stop == pytest.approx(1.2 * 3.0 * tau, rel=0.02)


def test_a_step_keeps_a_few_rows_of_both_states() -> None:
    values = np.r_[np.full(50, 20.0), np.full(50, 90.0)]
    assert without_holds(Sweep(0, 100, True), exact(values)) == Sweep(45, 55, True)


def test_a_constant_sweep_is_all_hold() -> None:
    assert without_holds(Sweep(3, 9, True), exact(np.full(12, 5.0))).n == 0


def test_quiet_ends_join_the_sweep_next_to_them() -> None:
    values = np.r_[20.1, 20.2, triangle(50), 20.3, 20.1]
    found = sweeps_of_temperature(exact(values))
    assert found[0].start == 2
    assert with_quiet_ends(found, exact(values))[0].start == 0
    assert with_quiet_ends(found, exact(values))[-1].stop == values.size
    assert with_quiet_ends((), exact(values)) == ()


def test_restless_ends_stay_out() -> None:
    values = np.r_[np.linspace(32.0, 20.0, 30), triangle(50)[1:]]
    found = with_quiet_ends(sweeps_of_temperature(exact(values)), exact(values))
    assert found[0].start == 29
    assert span(found[0], exact(values)) == 70.0
