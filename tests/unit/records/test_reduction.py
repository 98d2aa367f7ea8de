"""Block averages: how many, how wide, how biased, how correlated."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from sma_bayes.records.reduction import Blocks, average, blocks_of


def lengths(blocks: Blocks) -> np.ndarray:
    return np.diff(np.r_[blocks.first, blocks.rows])


def test_short_records_are_left_alone() -> None:
    values = np.linspace(0.0, 1.0, 400)
    blocks = blocks_of(values, np.zeros(400), 400, 0.02)
    assert (blocks.n, blocks.largest) == (400, 1)
    assert average(values, blocks) is values


@pytest.mark.parametrize("rows", [401, 799, 1000, 12345, 200_000])
def test_blocks_of_a_ramp_are_equal_and_few(rows: int) -> None:
    blocks = blocks_of(np.linspace(20.0, 80.0, rows), np.zeros(rows), 400, 0.02)
    assert 200 <= blocks.n <= 400
    assert np.ptp(lengths(blocks)) <= 1
    assert lengths(blocks).sum() == rows
    assert blocks.largest == lengths(blocks).max()


def test_blocks_do_not_cross_from_one_sweep_to_the_next() -> None:
    segment = np.repeat([1.0, 2.0, 5.0], [1000, 333, 777])
    temperature = np.concatenate([np.linspace(20.0, 80.0, n) for n in (1000, 333, 777)])
    blocks = blocks_of(temperature, segment, 200, 0.02)
    mean = average(segment, blocks)
    assert set(mean.tolist()) == {1.0, 2.0, 5.0}


def test_a_block_does_not_span_more_than_its_share_where_the_temperature_runs() -> None:
    temperature = np.r_[
        np.linspace(20.0, 21.0, 3000), np.linspace(21.0, 80.0, 60), np.linspace(80.0, 80.5, 3000)
    ]
    blocks = blocks_of(temperature, np.zeros(temperature.size), 400, 0.02)
    width = np.array([np.ptp(part) for part in np.split(temperature, blocks.first[1:])])
    step = 1.0
    assert width.max() <= 0.02 * 60.5 + step
    assert blocks.n <= 400


def test_the_limit_on_width_wins_over_the_number_of_samples() -> None:
    ramp = np.linspace(20.0, 80.0, 1000)
    segment = np.repeat(np.arange(20.0), 1000)
    blocks = blocks_of(np.tile(ramp, 20), segment, 400, 0.02)
    assert blocks.n >= 20 * 50
    width = np.array([np.ptp(part) for part in np.split(np.tile(ramp, 20), blocks.first[1:])])
    assert width.max() <= 0.02 * 60.0 * 1.05


@pytest.mark.parametrize("rows", [1000, 40_000])
def test_noise_does_not_pass_for_width(rows: int) -> None:
    ramp = np.linspace(20.0, 80.0, rows)
    noisy = ramp + np.random.default_rng(0).normal(0.0, 1.0, rows)
    segment = np.zeros(rows)
    blocks = blocks_of(noisy, segment, 400, 0.02)
    np.testing.assert_array_equal(blocks.first, blocks_of(ramp, segment, 400, 0.02).first)


def test_constant_temperature_is_averaged_all_the_same() -> None:
    blocks = blocks_of(np.full(1000, 20.0), np.zeros(1000), 100, 0.02)
    assert blocks.n == 100


def test_averages_are_the_means_of_the_rows() -> None:
    rng = np.random.default_rng(4)
    values, temperature = rng.normal(size=5000), np.linspace(0.0, 1.0, 5000)
    blocks = blocks_of(temperature, np.zeros(5000), 300, 0.02)
    expected = [part.mean() for part in np.split(values, blocks.first[1:])]
    np.testing.assert_allclose(average(values, blocks), expected, rtol=1e-12)
    assert average(values, blocks) @ lengths(blocks) == pytest.approx(values.sum())


@pytest.mark.parametrize("share", [0.005, 0.01, 0.02])
def test_bias_on_a_sigmoid_is_below_the_stated_bound(share: float) -> None:
    width, steepness, amplitude = 60.0, 44.0 / 60.0, 0.7
    temperature = np.linspace(20.0, 80.0, 60_000)
    curve = amplitude / (1.0 + np.exp(-steepness * (temperature - 50.0)))
    size = round(share * temperature.size)
    blocks = Blocks(np.arange(0, temperature.size, size), temperature.size, size)
    at = average(temperature, blocks)
    bias = average(curve, blocks) - amplitude / (1.0 + np.exp(-steepness * (at - 50.0)))
    bound = (share * width * steepness) ** 2 / (144.0 * np.sqrt(3.0)) * amplitude
    assert np.abs(bias).max() <= 1.02 * bound
    assert np.abs(bias).max() >= 0.5 * bound  # the bound is no mere wave of the hand


def test_averages_of_correlated_noise_have_the_stated_variance_and_correlation() -> None:
    phi, m, n = 0.95, 20, 2_000_000
    rng = np.random.default_rng(8)
    noise = lfilter([1.0], [1.0, -phi], rng.normal(size=n))[1000:]
    noise = noise[: noise.size // m * m] / noise.std()
    blocks = Blocks(np.arange(0, noise.size, m), noise.size, m)
    means = average(noise, blocks)
    ratio = (1 + phi) / (1 - phi) - 2 * phi * (1 - phi**m) / (m * (1 - phi) ** 2)
    assert means.var() == pytest.approx(ratio / m, rel=0.03)
    assert means.var() > 10.0 / m  # dividing by m would be wrong by more than ten
    lag = [float(np.mean(means[k:] * means[:-k])) for k in (1, 2, 3)]
    assert lag[1] / lag[0] == pytest.approx(phi**m, rel=0.1)
    assert lag[2] / lag[1] == pytest.approx(phi**m, rel=0.2)
