"""Checks on single columns: each finds what was planted and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.records.quality import (
    CHANNEL_WINDOW,
    TEMPERATURE_WINDOW,
    clipped,
    digit,
    gaps,
    out_of_order,
    repeated_rows,
    spikes,
    zero_dropouts,
)


def where(mask: np.ndarray) -> list[int]:
    return np.flatnonzero(mask).tolist()


def sweep(rows: int = 200) -> np.ndarray:
    """One cycle between -30 and 50 degC, to a tenth of a degree."""
    return np.round(np.r_[np.linspace(50.0, -30.0, rows), np.linspace(-30.0, 50.0, rows)], 1)


# digits


@pytest.mark.parametrize("step", [0.1, 0.02, 2.5e-7, 1.0, 8.694436e-3])
def test_step_of_a_quantised_channel(step: float) -> None:
    values = np.round(np.linspace(0.0, 60.0, 4000)) * step
    assert digit(values) == pytest.approx(step, rel=1e-4)


def test_step_where_some_levels_never_occur() -> None:
    rng = np.random.default_rng(1)
    assert digit(np.round(rng.normal(800.0, 40.0, 3000)) * 0.25) == pytest.approx(0.25)


def test_continuous_or_nearly_constant_values_have_no_step() -> None:
    assert digit(np.random.default_rng(0).normal(size=500)) == 0.0
    assert digit(np.zeros(500)) == 0.0
    assert digit(np.full(10, np.nan)) == 0.0


# zeros


def test_zeros_far_from_their_neighbours_are_dropouts() -> None:
    values = sweep()
    planted = [135, 136, 140, 262]
    assert np.all(np.abs(values[planted]) > 1.0)
    values[planted] = 0.0
    assert where(zero_dropouts(values)) == planted


def test_zeros_at_the_ends_of_a_record() -> None:
    values = sweep()
    values[[0, 1, -1]] = 0.0
    assert where(zero_dropouts(values)) == [0, 1, 399]


def test_a_true_passage_through_zero_is_none() -> None:
    values = sweep(801)
    assert np.count_nonzero(values == 0.0) >= 2
    assert where(zero_dropouts(values)) == []
    assert where(zero_dropouts(np.zeros(20))) == []
    assert where(zero_dropouts(np.ones(20))) == []


def test_once_a_display_drops_out_near_zeros_are_suspect() -> None:
    values = sweep()
    near = int(np.argmin(np.abs(values + 0.7)))
    values[near] = 0.0
    assert where(zero_dropouts(values)) == []
    values[140] = 0.0
    assert where(zero_dropouts(values)) == sorted([near, 140])
    assert where(zero_dropouts(values, follow_up=False)) == [140]


def test_zero_strain_at_the_end_of_a_sweep_is_real() -> None:
    strain = np.linspace(0.04, 0.0, 30)
    assert where(zero_dropouts(strain, steps=10.0, follow_up=False)) == []


# spikes


def test_spikes_of_one_and_of_several_samples() -> None:
    values = sweep() + np.random.default_rng(3).normal(0.0, 0.1, 400)
    values[50] += 30.0
    values[300:304] -= 25.0
    assert where(spikes(values, TEMPERATURE_WINDOW)) == [50, 300, 301, 302, 303]


@pytest.mark.parametrize("held", [1, 4])
def test_noise_ramps_tips_and_steps_are_no_spikes(held: int) -> None:
    rng = np.random.default_rng(4)
    triangle = np.tile(np.r_[np.linspace(0.0, 10.0, 40), np.linspace(10.0, 0.0, 40)], 4)
    for values in (
        triangle,
        triangle + rng.normal(0.0, 0.5, triangle.size),
        np.repeat([0.0, 10.0, 3.0], 60) + rng.normal(0.0, 0.1, 180),
        1.0 / (1.0 + np.exp(-5.0 * (triangle - 5.0))),
        np.round(triangle),
    ):
        assert where(spikes(np.repeat(values, held), TEMPERATURE_WINDOW)) == []


def test_a_million_gaussian_samples_hold_no_spike() -> None:
    assert not spikes(np.random.default_rng(5).normal(size=1_000_000), CHANNEL_WINDOW).any()


def test_a_pulse_that_lasts_is_no_spike() -> None:
    values = np.r_[np.full(60, 25.0), np.full(20, 60.0), np.full(60, 25.0)]
    values += np.random.default_rng(6).normal(0.0, 0.1, values.size)
    assert where(spikes(values, TEMPERATURE_WINDOW)) == []


def test_an_overshoot_between_two_states_is_no_spike() -> None:
    values = np.r_[np.full(60, 25.0), np.full(2, 70.0), np.full(60, 50.0)]
    values += np.random.default_rng(6).normal(0.0, 0.05, values.size)
    assert where(spikes(values, TEMPERATURE_WINDOW)) == []


def test_a_value_that_is_held_for_long_is_no_spike() -> None:
    ramp = np.linspace(20.0, 40.0, 200) + np.random.default_rng(6).normal(0.0, 0.05, 200)
    assert where(spikes(np.insert(ramp, 100, 60.0), TEMPERATURE_WINDOW)) == [100]
    assert where(spikes(np.insert(ramp, 100, np.full(80, 60.0)), TEMPERATURE_WINDOW)) == []


def test_a_channel_is_not_judged_where_the_temperature_runs() -> None:
    temperature = np.r_[np.linspace(20.0, 80.0, 14), np.linspace(80.0, 20.0, 14)]
    force = np.where(temperature > 78.0, 1.0, 0.0) + 1e-3 * np.random.default_rng(7).normal(size=28)
    assert where(spikes(force, CHANNEL_WINDOW)) != []  # without the temperature it looks like one
    assert where(spikes(force, CHANNEL_WINDOW, against=temperature)) == []


def test_a_channel_is_judged_where_the_temperature_is_slow() -> None:
    temperature = np.linspace(20.0, 80.0, 600)
    force = 1.0 / (1.0 + np.exp(-(temperature - 50.0))) + 1e-3 * np.random.default_rng(7).normal(size=600)
    force[[100, 300]] += 0.3
    assert where(spikes(force, CHANNEL_WINDOW, against=temperature)) == [100, 300]


# time


def test_stamps_astray_forwards_and_backwards() -> None:
    time = np.arange(0.0, 500.0)
    time[100] = 900.0
    time[200:203] = 7.0
    bad, again = out_of_order(time)
    assert where(bad) == [100, 200, 201, 202]
    assert again.size == 0


def test_a_clock_that_starts_again_loses_no_row() -> None:
    time = np.r_[np.arange(300.0), np.arange(200.0), np.arange(100.0)]
    bad, again = out_of_order(time)
    assert not bad.any()
    assert again.tolist() == [300, 500]


def test_what_is_left_is_in_order_between_restarts() -> None:
    rng = np.random.default_rng(9)
    for _ in range(50):
        time = np.cumsum(rng.exponential(size=400))
        astray = rng.choice(400, 12, replace=False)
        time[astray] += rng.normal(0.0, 60.0, 12)
        bad, again = out_of_order(time)
        step = np.diff(time[~bad])
        assert np.count_nonzero(step < 0) == again.size
        assert set(where(bad)) <= set(range(400))
        assert np.count_nonzero(bad) <= 60


def test_equal_stamps_are_in_order() -> None:
    bad, again = out_of_order(np.repeat(np.arange(50.0), 3))
    assert not bad.any()
    assert again.size == 0


# repeated rows


def test_duplicates_with_a_clock_wherever_they_stand() -> None:
    time = np.r_[np.arange(20.0), np.arange(5.0, 9.0)]
    values = np.r_[np.arange(20.0), np.arange(5.0, 9.0)]
    duplicate, held = repeated_rows([values, values**2], time)
    assert where(duplicate) == [20, 21, 22, 23]
    assert held == 0


def test_equal_times_with_other_values_are_no_duplicates() -> None:
    duplicate, _ = repeated_rows([np.arange(30.0)], np.repeat(np.arange(10.0), 3))
    assert not duplicate.any()


def test_three_equal_rows_and_missing_values() -> None:
    value = np.array([1.0, np.nan, np.nan, np.nan, 2.0])
    duplicate, _ = repeated_rows([value], np.array([0.0, 1.0, 1.0, 1.0, 2.0]))
    assert where(duplicate) == [2, 3]


def test_without_a_clock_rare_repeats_are_duplicates_and_common_ones_held_samples() -> None:
    values = np.arange(100.0)
    values[50] = values[49]
    assert where(repeated_rows([values, -values], None)[0]) == [50]
    duplicate, held = repeated_rows([np.repeat(np.arange(25.0), 4)], None)
    assert not duplicate.any()
    assert held == 75


# clipping


def test_a_flat_top_entered_at_full_pace_is_clipped() -> None:
    wave = np.sin(np.linspace(0.0, 4.0 * np.pi, 800))
    tops = clipped(np.minimum(wave, 0.8))
    assert [top.value for top in tops] == [0.8]
    assert tops[0].count == pytest.approx(2 * 82, abs=4)
    run = np.minimum(wave, 0.8)[tops[0].start : tops[0].stop]
    assert np.all(run == 0.8)


def test_plateaus_noise_and_held_samples_are_not_clipped() -> None:
    temperature = np.linspace(20.0, 90.0, 2000)
    plateau = np.round(1.0 / (1.0 + np.exp(-0.4 * (temperature - 55.0))), 3)
    for values in (plateau, np.repeat(np.sin(np.linspace(0.0, 20.0, 300)), 8), temperature):
        assert clipped(values) == ()
    assert clipped(np.zeros(100)) == ()


# gaps


def test_gaps_in_time_and_in_temperature() -> None:
    time, temperature = np.arange(100.0), np.linspace(0.0, 50.0, 100)
    time[40:] += 60.0
    temperature[70:] += 12.0
    assert gaps(time, temperature).tolist() == [40, 70]
    assert gaps(None, temperature).tolist() == [70]


def test_even_noisy_and_tiny_sweeps_have_no_gap() -> None:
    noisy = np.linspace(0.0, 50.0, 500) + np.random.default_rng(1).normal(0.0, 1.0, 500)
    assert gaps(np.arange(500.0), noisy).size == 0
    assert gaps(np.zeros(50), np.linspace(0.0, 1.0, 50)).size == 0
    assert gaps(None, np.array([0.0, 50.0])).size == 0
