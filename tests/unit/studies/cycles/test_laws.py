"""Laws of training: the closed form against sampling that shares no code with it, and what it must do at its ends."""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.studies.cycles import laws
from sma_bayes.studies.cycles.laws import LAW_POWERS, NONE, LawPosterior, Series, approach


@pytest.mark.parametrize("power", [p for powers in LAW_POWERS.values() for p in powers])
def test_a_law_goes_from_nought_to_one_and_never_back(power: float) -> None:
    x = approach(power, 3.0, np.arange(0.0, 40.0), 20.0)
    assert x[0] == 0.0
    assert x[20] == pytest.approx(1.0, abs=1e-14)
    assert np.all(np.diff(x) >= 0.0)


def test_a_small_power_tends_to_the_logarithm() -> None:
    """1 - exp(-z^p) is 1 - 1/e + p ln(z)/e + ... about z = 1: a straight line in the logarithm."""
    cycle = np.array([0.0, 4.0, 9.0, 19.0])
    stretched = approach(0.01, 5.0, cycle, 19.0)
    plain = np.log(cycle[1:])
    slope = np.diff(stretched[1:]) / np.diff(plain)
    assert slope[0] == pytest.approx(slope[1], rel=0.01)


@pytest.mark.slow
def test_evidence_and_forecast_are_those_of_sampling() -> None:
    """Draws from the prior, walk and all, weighted by the likelihood of the readings.

    Two million draws; what they give scatters by a few per cent, which is taken from ten parts of them. Of nine numbers
    none may be further off than 4 standard errors: a false alarm in one of 1,700 runs, were the seed not fixed.
    """
    rng = np.random.default_rng(1)
    cycle = np.array([0.0, 1.0, 2.0, 4.0, 6.0])
    series = Series(cycle, np.array([0.05, 0.52, 0.66, 0.9, 0.84]), np.full(5, 0.15**2), 0.5, 0.2, "stroke")
    posterior = LawPosterior([series])
    later = np.arange(10.0)
    law, (draws,) = posterior.draw(later, 40_000, rng)

    size, centre = 2_000_000, series.value.mean()
    kind = rng.integers(1 + len(LAW_POWERS), size=size)
    names = list(LAW_POWERS)
    weights = np.exp(-0.5 * (np.log(laws.N0_GRID / laws.USUAL_N0) / laws.LN_N0_SD) ** 2)
    of_condition = rng.choice(laws.N0_GRID, size=size, p=weights / weights.sum())
    pace = np.empty(size)
    for one in laws.N0_GRID:
        own = np.flatnonzero(of_condition == one)
        p = np.exp(-0.5 * (np.log(laws.N0_GRID / one) / laws.LN_OWN_N0_SD) ** 2)
        pace[own] = rng.choice(laws.N0_GRID, size=own.size, p=p / p.sum())
    scale, share = np.array(laws.REPEATABILITY_GRID)[rng.integers(len(laws.REPEATABILITY_GRID), size=size)].T
    tau, omega = np.zeros((2, size))
    for own_scale in laws.SCALE_GRID:
        own = np.flatnonzero(scale == own_scale)
        for value, grid, usual in (
            (tau, laws.SCATTER_SD_GRID, 1.0),
            (omega, laws.WALK_SD_GRID, laws.USUAL_STEP),
        ):
            p = 1.0 / (grid / (usual * own_scale) + usual * own_scale / grid)
            value[own] = 0.2 * rng.choice(grid, size=own.size, p=p / p.sum())
    omega[rng.random(size) >= share] = 0.0
    slows = rng.random(size) < 0.5
    clock = np.where(slows[:, None], np.log2(1.0 + later), later)
    state = (
        centre
        + 1.5 * rng.standard_normal(size)[:, None]
        + np.cumsum(
            omega[:, None] * np.sqrt(np.diff(clock, axis=1, prepend=0.0)) * rng.standard_normal((size, 10)),
            axis=1,
        )
    )
    change = 0.5 * rng.choice(laws.CHANGE_SD_GRID, size=size) * rng.standard_normal(size)
    for k, name in enumerate(names, 1):
        for j, power in enumerate(LAW_POWERS[name]):
            own = np.flatnonzero(kind == k)[j :: len(LAW_POWERS[name])]
            x = np.array([approach(power, p, later, 6.0) for p in laws.N0_GRID])
            state[own] += change[own, None] * x[np.searchsorted(laws.N0_GRID, pace[own])]
    sweep = state + tau[:, None] * rng.standard_normal(state.shape)
    seen = cycle.astype(int)
    likelihood = np.exp(-0.5 * np.sum((series.value - sweep[:, seen]) ** 2 / series.variance, axis=1))

    def parts(value: np.ndarray, mask: np.ndarray | None = None) -> tuple[float, float]:
        w = likelihood if mask is None else likelihood * mask
        each = [np.sum(w[i::10] * value[i::10]) / np.sum(w[i::10]) for i in range(10)]
        return float(np.mean(each)), float(np.std(each, ddof=1) / np.sqrt(10))

    for name in names:  # evidence over none is a ratio of mean likelihoods
        k = 1 + names.index(name)
        ratio = [
            np.log(likelihood[i::10][kind[i::10] == k].mean() / likelihood[i::10][kind[i::10] == 0].mean())
            for i in range(10)
        ]
        error = np.std(ratio, ddof=1) / np.sqrt(10)
        assert error < 0.1
        assert abs(posterior.ln_evidence[name] - np.mean(ratio)) < 4.0 * error
    for place in (0, 4, 9):
        for mine, other in ((draws.sweep, sweep), (draws.state, state)):
            mean, error = parts(other[:, place])
            spread = mine[:, place].std() / np.sqrt(len(law))
            assert abs(mine[:, place].mean() - mean) < 4.0 * np.hypot(error, spread)
            square, error = parts((other[:, place] - mean) ** 2)
            assert mine[:, place].var() == pytest.approx(square, abs=4.0 * error + 0.03 * square)


def test_a_number_that_is_known_exactly_is_kept() -> None:
    cycle = np.arange(6.0)
    value = np.array([0.0, 0.3, 0.1, 0.5, 0.2, 0.4])
    series = Series(cycle, value, np.full(6, 1e-14), 0.5, 0.02, "stroke")
    _, (draws,) = LawPosterior([series]).draw(np.arange(8.0), 50, np.random.default_rng(0))
    assert np.abs(draws.sweep[:, :6] - value).max() < 1e-5
    assert draws.sweep[:, 7].std() > 0.05


def test_two_cycles_tell_no_law_but_are_pooled() -> None:
    series = Series(np.array([0.0, 1.0]), np.array([0.0, 0.02]), np.full(2, 1e-4), 0.5, 0.02, "stroke")
    posterior = LawPosterior([series])
    assert not posterior.testable
    assert posterior.chosen == NONE
    assert posterior.probability == {NONE: 1.0}
    _, (draws,) = posterior.draw(np.arange(3.0), 2000, np.random.default_rng(0))
    assert draws.state[:, 0].mean() > 0.0  # pulled to what both say
    assert draws.state[:, 1].mean() < 0.02
    assert not draws.moving.any()


def test_numbers_without_a_law_are_given_none_and_those_with_one_their_own() -> None:
    """Twenty sets of eight quiet numbers: a law is chosen in none, at odds of 20 to 1 asked for each."""
    rng = np.random.default_rng(0)
    cycle = np.arange(12.0)
    for _ in range(20):
        quiet = [
            Series(cycle, 0.02 * rng.standard_normal(12), np.full(12, 1e-4), 0.5, 0.02, kind)
            for kind in ("offset", "stroke", "shift", "width") * 2
        ]
        assert LawPosterior(quiet).chosen == NONE
    moved = [
        Series(
            cycle,
            size * approach(1.0, 3.0, cycle, 11.0) + 0.01 * rng.standard_normal(12),
            np.full(12, 1e-4),
            0.5,
            0.02,
            kind,
        )
        for kind, size in (("stroke", 0.2), ("width", -0.1), ("offset", 0.0))
    ]
    posterior = LawPosterior(moved)
    assert posterior.chosen in ("exponential", "stretched")
    weights = posterior.pace_weights("exponential")
    assert float(weights @ laws.N0_GRID) == pytest.approx(3.0, rel=0.25)
    _, draws = posterior.draw(cycle, 2000, rng)
    assert [d.moving.mean() > 0.9 for d in draws] == [True, True, False]


def test_numbers_that_settle_at_paces_of_their_own_follow_one_law() -> None:
    """Paces of 2, 3 and 4.5 cycles: each is drawn near its own, and later cycles are told by that."""
    cycle, paces = np.arange(12.0), (2.0, 3.0, 4.5)
    series = [
        Series(cycle, 0.5 * approach(1.0, pace, cycle, 11.0), np.full(12, 1e-5), 0.5, 0.02, kind)
        for kind, pace in zip(("offset", "stroke", "width"), paces, strict=True)
    ]
    posterior = LawPosterior(series, forms=("exponential",))
    assert posterior.chosen == "exponential"
    _, draws = posterior.draw(np.arange(14.0), 2000, np.random.default_rng(0))
    for pace, drawn in zip(paces, draws, strict=True):
        halfway = np.median(drawn.law[:, 2])
        assert halfway == pytest.approx(0.5 * approach(1.0, pace, cycle, 11.0)[2], abs=0.015)
        assert np.median(drawn.step) < 0.01
