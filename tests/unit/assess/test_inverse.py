"""Temperatures at which curves have a wanted value, against closed forms and brute force."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from sma_bayes.arrays import Floats
from sma_bayes.assess.inverse import Met, finer, met, passages, search_grid
from sma_bayes.response.modified_sigmoid import sigmoid, stiffness

LOW, HIGH = 20.0, 90.0


def test_a_sigmoid_is_inverted_as_its_closed_form_has_it() -> None:
    rng = np.random.default_rng(0)
    size, rate = rng.uniform(1.0, 3.0, (200, 1)), rng.uniform(0.2, 0.5, (200, 1))
    middle = rng.uniform(40.0, 60.0, (200, 1))
    (rising,) = passages(lambda t: sigmoid(t, size, rate, middle, np.array(0.5)), search_grid(LOW, HIGH), 1.7)
    share = 1.2 / size
    with np.errstate(divide="ignore", invalid="ignore"):
        exact = (middle + np.log(share / (1.0 - share)) / rate)[:, 0]
    exact[(share[:, 0] >= 1.0) | (exact > HIGH)] = np.nan
    assert np.isnan(exact).any()
    np.testing.assert_allclose(rising.draws, exact, rtol=1e-10)
    assert rising.direction == "rising"
    assert rising.probability == pytest.approx(np.mean(np.isfinite(exact)))


def test_a_hump_is_passed_twice_or_not_at_all() -> None:
    """Eq. (7) with A2 < B2; brute force on a grid of 70,001 temperatures."""
    rng = np.random.default_rng(1)
    a1, a2, a3 = 0.02, rng.uniform(0.2, 0.25, (60, 1)), rng.uniform(45.0, 50.0, (60, 1))
    b1, b2, b3 = 2.5, rng.uniform(0.35, 0.45, (60, 1)), rng.uniform(50.0, 55.0, (60, 1))

    def curve(t: Floats) -> Floats:
        return stiffness(t, np.array(a1), a2, a3, np.array(b1), b2, b3)

    t = np.linspace(LOW, HIGH, 70001)
    values = curve(t)
    wanted = float(np.median(values.max(axis=1)))
    above = values >= wanted
    rising, falling = passages(curve, search_grid(LOW, HIGH), wanted)
    for passage, change in (
        (rising, ~above[:, :-1] & above[:, 1:]),
        (falling, above[:, :-1] & ~above[:, 1:]),
    ):
        brute = np.where(change.any(axis=1), t[np.argmax(change, axis=1)], np.nan)
        differs = np.isnan(brute) != np.isnan(passage.draws)
        assert differs.sum() <= 1  # a top so flat that it lies between two of the 401 temperatures
        both = np.isfinite(brute) & np.isfinite(passage.draws)
        assert 20 < both.sum() < 40
        np.testing.assert_allclose(passage.draws[both], brute[both], atol=1.001e-3)


def test_passages_of_one_direction_are_kept_apart() -> None:
    found = passages(lambda t: np.sin(t)[None, :] if t.ndim == 1 else np.sin(t), search_grid(0.5, 14.0), 0.0)
    assert [p.direction for p in found] == ["rising", "rising", "falling", "falling"]
    np.testing.assert_allclose([p.draws[0] for p in found], np.pi * np.array([2, 4, 1, 3]), rtol=1e-12)


def test_where_a_tolerance_is_met_agrees_with_the_normal_distribution() -> None:
    """Straight curves with normal midpoints: the chance to be within w at T is Φ((T+w-m)/s) - Φ((T-w-m)/s).

    20,000 draws: a share has a standard error of 0.0035 at most, and the edges move by less than 0.03.
    """
    middle = norm.ppf((np.arange(20000) + 0.5) / 20000)[:, None] * 0.8 + 55.0

    def curve(t: Floats) -> Floats:
        return 3.0 * (t - middle)

    (rising,) = passages(curve, search_grid(LOW, HIGH), 0.0)
    grid = finer(search_grid(LOW, HIGH), rising.draws)
    surely = met(grid, curve(grid), (-6.0, 6.0))
    exact = norm.cdf((surely.temperature + 2.0 - 55.0) / 0.8) - norm.cdf(
        (surely.temperature - 2.0 - 55.0) / 0.8
    )
    np.testing.assert_allclose(surely.probability, exact, atol=1e-3)
    (stretch,) = surely.at_least(0.9)
    edge = 2.0 - 0.8 * norm.ppf(0.9)  # the other bound is ten standard deviations off at the edges
    assert stretch.low == pytest.approx(55.0 - edge, abs=0.01)
    assert stretch.high == pytest.approx(55.0 + edge, abs=0.01)
    assert surely.best[0] == pytest.approx(55.0, abs=0.05)
    assert surely.best[1] == pytest.approx(1.0 - 2.0 * norm.sf(2.5), abs=1e-3)
    assert surely.at_least(0.999) == ()


def test_a_short_stretch_is_not_missed_between_two_temperatures() -> None:
    middle = np.linspace(54.99, 55.01, 500)[:, None]

    def curve(t: Floats) -> Floats:
        return t - middle

    (rising,) = passages(curve, search_grid(LOW, HIGH), 0.0)
    grid = finer(search_grid(LOW, HIGH), rising.draws)
    (stretch,) = met(grid, curve(grid), (-0.02, 0.02)).at_least(1.0)
    assert (stretch.low, stretch.high) == (pytest.approx(54.99, abs=1e-3), pytest.approx(55.01, abs=1e-3))


def test_stretches_end_at_the_ends_of_the_search() -> None:
    surely = Met(np.arange(6.0), np.array([1.0, 0.5, 0.0, 0.8, 1.0, 1.0]))
    assert [(s.low, s.high) for s in surely.at_least(0.9)] == [(0.0, pytest.approx(0.2)), (3.5, 5.0)]
    assert surely.best == (4.5, 1.0)


def test_chance_of_the_draws_makes_no_stretches() -> None:
    """A share of 2000 draws has a standard error of 0.0067 at 0.9: what flickers about it by that is one stretch."""
    t = np.linspace(20.0, 30.0, 41)
    flickers = np.where(np.arange(41) % 2, 0.905, 0.89)
    assert len(Met(t, flickers).at_least(0.9)) == 20
    (one,) = Met(t, flickers, 2000).at_least(0.9)
    assert (one.low, one.high) == (pytest.approx(20.25, abs=0.25), pytest.approx(29.75, abs=0.25))
    assert one.low_error > 0.1
    apart = np.where(np.arange(41) % 20 < 10, 0.95, 0.5)
    assert len(Met(t, apart, 2000).at_least(0.9)) == len(Met(t, apart).at_least(0.9)) == 3


def test_ends_of_a_stretch_have_the_error_that_other_draws_make() -> None:
    """Straight curves with normal midpoints, 300 times 500 draws: half of the ends lie within 0.67 standard errors.

    By the normal distribution their standard error is that of the share over its slope, 0.0134/0.22; the scatter of
    300 of them tells it within 15 % with a probability of 0.9998.
    """
    rng = np.random.default_rng(5)
    grid = np.linspace(52.0, 56.0, 401)
    found = []
    for _ in range(300):
        middle = 55.0 + 0.8 * rng.standard_normal((500, 1))
        (stretch,) = met(grid, 3.0 * (grid - middle), (-6.0, np.inf)).at_least(0.9)
        found.append((stretch.low, stretch.low_error))
    low, error = np.array(found).T
    exact = np.sqrt(0.09 / 500) / (norm.pdf(norm.ppf(0.9)) / 0.8)
    assert np.std(low) == pytest.approx(exact, rel=0.15)
    assert np.median(error) == pytest.approx(exact, rel=0.15)
