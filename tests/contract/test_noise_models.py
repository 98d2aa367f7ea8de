"""Every noise model: agrees with scipy and with its own draws, forgets between sweeps, broadcasts, pickles."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy import stats

from sma_bayes.noise import NOISE_MODELS, NoiseModel, Steps

SHAPES: dict[str, tuple[tuple[float, ...], ...]] = {
    "independent": ((),),
    "ar1": ((0.6,), (-0.4,), (0.97,), (0.0,)),
    "ar1_time": ((3.0,), (0.3,), (200.0,)),
    "student_t": ((4.0,), (1.5,), (80.0,)),
    "effective_samples": ((1.0,), (3.0,), (40.0,)),
}
"""Parameters after `sd` with which each model is tried."""

GAUSSIAN = ("independent", "ar1", "ar1_time")
HEAVY = ("student_t",)
DENSITIES = tuple(name for name in NOISE_MODELS if NOISE_MODELS[name].is_density)


def cases(names: tuple[str, ...] | None = None):
    kept = [n for n in NOISE_MODELS if names is None or n in names]
    return pytest.mark.parametrize(
        ("noise", "shape"),
        [
            pytest.param(NOISE_MODELS[n], np.array(s), id=f"{n}-{'-'.join(map(str, s))}")
            for n in kept
            for s in SHAPES[n]
        ],
    )


def steps_of(n: int, starts: tuple[int, ...] = (0,), seed: int = 0) -> Steps:
    """Unequal steps, a new sweep at each of `starts`."""
    first = np.zeros(n, dtype=bool)
    first[list(starts)] = True
    dt = np.random.default_rng(seed).uniform(0.2, 2.0, n)
    return Steps(first, np.where(first, 1.0, dt), timed=True)


def correlation(name: str, shape: np.ndarray, steps: Steps) -> np.ndarray:
    """Dense correlation matrix, written down from the definition of each model."""
    n = steps.first.size
    sweep = np.cumsum(steps.first)
    together = sweep[:, None] == sweep
    if name == "independent":
        return np.eye(n)
    if name == "ar1":
        lag = np.abs(np.arange(n)[:, None] - np.arange(n))
        return np.where(together, shape[0] ** lag, 0.0)
    time = np.cumsum(np.where(steps.first, 0.0, steps.dt))
    return np.where(together, np.exp(-np.abs(time[:, None] - time) / shape[0]), 0.0)


def series(noise: NoiseModel, shape: np.ndarray, steps: Steps, size: int, seed: int) -> np.ndarray:
    return noise.draw(np.random.default_rng(seed), np.tile(shape, (size, 1)), steps)


def test_every_model_is_tried_under_its_own_name() -> None:
    assert set(NOISE_MODELS) <= set(SHAPES)
    assert all(NOISE_MODELS[name].name == name for name in NOISE_MODELS)


@pytest.mark.parametrize("name", list(NOISE_MODELS))
def test_parameters_begin_with_the_standard_deviation(name: str) -> None:
    facts = NOISE_MODELS[name].parameters("force", "N", "s")
    assert (facts[0].name, facts[0].unit) == ("force_sd", "N")
    assert facts[0].prior_key == ("sd" if NOISE_MODELS[name].is_density else "spread")
    assert all(f.name.startswith("force_") and f.channel == "force" and f.meaning for f in facts)
    assert len(facts) == 1 + len(SHAPES[name][0])


@cases(GAUSSIAN)
@pytest.mark.parametrize("starts", [(0,), (0, 5), (0, 1, 2, 11)])
def test_gaussian_models_are_the_dense_multivariate_normal(
    noise: NoiseModel, shape: np.ndarray, starts: tuple[int, ...]
) -> None:
    steps = steps_of(12, starts)
    dense = stats.multivariate_normal(np.zeros(12), correlation(noise.name, shape, steps))
    e = np.random.default_rng(1).standard_normal((6, 12))
    found = noise.total_log_density(e, np.tile(shape, (6, 1)), steps)
    np.testing.assert_allclose(found, dense.logpdf(e), rtol=1e-9, atol=1e-9)


@cases(HEAVY)
def test_heavy_tailed_models_are_scipys_t(noise: NoiseModel, shape: np.ndarray) -> None:
    steps = steps_of(12, (0, 5))
    e = 2.0 * np.random.default_rng(1).standard_normal(12)
    np.testing.assert_allclose(noise.log_density(e, shape, steps), stats.t.logpdf(e, shape[0]), rtol=1e-12)


@cases()
def test_samples_sum_to_the_total(noise: NoiseModel, shape: np.ndarray) -> None:
    steps = steps_of(50, (0, 20))
    e = np.random.default_rng(2).standard_normal((7, 50))
    every = noise.log_density(e, np.tile(shape, (7, 1)), steps)
    assert every.shape == (7, 50)
    np.testing.assert_allclose(
        every.sum(axis=1), noise.total_log_density(e, np.tile(shape, (7, 1)), steps), rtol=1e-11
    )


@cases()
def test_a_sample_is_given_those_before_it(noise: NoiseModel, shape: np.ndarray) -> None:
    steps = steps_of(20)
    e = np.random.default_rng(3).standard_normal(20)
    later = e.copy()
    later[12:] += 5.0
    np.testing.assert_array_equal(
        noise.log_density(e, shape, steps)[:12], noise.log_density(later, shape, steps)[:12]
    )


@cases()
def test_sweeps_are_independent_of_each_other(noise: NoiseModel, shape: np.ndarray) -> None:
    both = steps_of(30, (0, 18))
    e = np.random.default_rng(4).standard_normal(30)
    parts = 0.0
    for part in (slice(0, 18), slice(18, 30)):
        own = Steps(both.first[part], both.dt[part], timed=True)
        parts += float(noise.total_log_density(e[part], shape, own))
    assert float(noise.total_log_density(e, shape, both)) == pytest.approx(parts, rel=1e-12)


@cases()
@pytest.mark.parametrize("method", ["log_density", "total_log_density", "innovations"])
def test_any_leading_shape_will_do(noise: NoiseModel, shape: np.ndarray, method: str) -> None:
    steps = steps_of(15, (0, 4))
    call = getattr(noise, method)
    e = np.random.default_rng(5).standard_normal((3, 4, 15))
    shapes = np.broadcast_to(shape, (3, 4, shape.size))
    every = call(e, shapes, steps)
    assert every.shape == ((3, 4) if method == "total_log_density" else (3, 4, 15))
    one = call(e[1, 2], shape, steps)
    np.testing.assert_allclose(every[1, 2], one, rtol=1e-13)


@cases(DENSITIES)
def test_what_is_drawn_has_the_density(noise: NoiseModel, shape: np.ndarray) -> None:
    """The mean of p(e; other)/p(e; own) over own draws is one. Five standard errors; the seed is fixed."""
    steps = steps_of(8, (0, 3))
    e = series(noise, shape, steps, 20_000, 6)
    own = noise.total_log_density(e, np.tile(shape, (len(e), 1)), steps)
    for factor in (0.97, 1.03):
        other = noise.total_log_density(e, np.tile(shape * factor, (len(e), 1)), steps)
        ratio = np.exp(other - own)
        assert abs(ratio.mean() - 1.0) <= 5.0 * ratio.std() / np.sqrt(len(e)) + 1e-12


@cases(GAUSSIAN)
def test_what_is_drawn_has_the_moments(noise: NoiseModel, shape: np.ndarray) -> None:
    """All 36 covariances of 6 samples, 5 standard errors each: a false alarm in 50,000 runs; the seed is fixed."""
    steps = steps_of(6, (0, 4))
    size = 30_000
    e = series(noise, shape, steps, size, 7)
    expected = correlation(noise.name, shape, steps)
    error = np.sqrt((1.0 + expected**2) / size)
    assert np.all(np.abs(e.mean(axis=0)) < 5.0 / np.sqrt(size))
    assert np.all(np.abs(np.cov(e.T) - expected) < 5.0 * error)


@cases(("student_t",))
def test_independent_heavy_draws_are_scipys_t(noise: NoiseModel, shape: np.ndarray) -> None:
    e = series(noise, shape, steps_of(10), 2_000, 8).ravel()
    assert stats.kstest(e, stats.t(shape[0]).cdf).pvalue > 1e-5


@cases()
def test_innovations_of_draws_are_white_and_normal(noise: NoiseModel, shape: np.ndarray) -> None:
    """Kolmogorov-Smirnov at 1e-5 and neighbouring correlation at 5 standard errors; the seed is fixed."""
    steps = steps_of(40, (0, 13))
    size = 500
    u = noise.innovations(series(noise, shape, steps, size, 9), np.tile(shape, (size, 1)), steps)
    assert stats.kstest(u.ravel(), "norm").pvalue > 1e-5
    products = u[:, 1:] * u[:, :-1]
    assert abs(products.mean()) < 5.0 / np.sqrt(products.size)


@cases(GAUSSIAN)
def test_the_gram_matrix_is_that_of_the_dense_inverse(noise: NoiseModel, shape: np.ndarray) -> None:
    steps = steps_of(25, (0, 10, 11))
    rows = np.random.default_rng(10).standard_normal((4, 25))
    dense = rows @ np.linalg.inv(correlation(noise.name, shape, steps)) @ rows.T
    found = noise.weighted_gram(rows, np.tile(shape, (3, 1)), steps)
    assert found.shape == (3, 4, 4)
    for each in found:
        np.testing.assert_allclose(each, dense, rtol=1e-8, atol=1e-8 * np.abs(dense).max())


@cases(HEAVY)
def test_the_gram_matrix_of_heavy_tails_is_the_expected_information(
    noise: NoiseModel, shape: np.ndarray
) -> None:
    """Variance of the score along two directions, 40,000 draws: good to 3 %, 4 standard errors."""
    steps = steps_of(6, (0, 4))
    size, h = 40_000, 1e-4
    e = series(noise, shape, steps, size, 11)
    shapes = np.tile(shape, (size, 1))
    for row in (np.ones(6), np.array([1.0, -1.0, 0.5, 0.0, 2.0, -1.0])):
        up, down = (noise.total_log_density(e + s * h * row, shapes, steps) for s in (1, -1))
        score = (up - down) / (2 * h)
        expected = float(noise.weighted_gram(row[None], shape[None], steps)[0, 0, 0])
        assert np.mean(score**2) == pytest.approx(expected, rel=0.03)


@cases()
def test_the_estimate_recovers_what_was_drawn(noise: NoiseModel, shape: np.ndarray) -> None:
    steps = steps_of(4_000, tuple(range(0, 4_000, 500)))
    residual = 0.3 * series(noise, shape, steps, 1, 12)[0]
    estimate = noise.estimate(residual, steps)
    truth = np.array([0.3, *shape])
    assert estimate.shape == truth.shape
    if not noise.is_density:
        np.testing.assert_allclose(estimate, truth, rtol=0.35)
        return
    likelihood = [
        float(noise.total_log_density(residual / p[0], p[1:], steps)) - residual.size * np.log(p[0])
        for p in (estimate, truth)
    ]
    # the maximum lies above the truth, by half a chi-square; a start need not be exactly at the maximum
    assert likelihood[0] > likelihood[1] - 2.0 * truth.size
    assert estimate[0] == pytest.approx(0.3, rel=0.35)


@cases()
def test_all_of_a_density_counts(noise: NoiseModel, shape: np.ndarray) -> None:
    found = noise.information(np.tile(shape, (4, 1)))
    np.testing.assert_array_equal(found, np.full(4, 1.0 if noise.is_density else 1.0 / shape[0]))


@cases()
def test_a_model_that_remembers_says_so(noise: NoiseModel, shape: np.ndarray) -> None:
    """The last sample's innovation depends on the one before it, and only then."""
    steps = steps_of(6)
    e = np.random.default_rng(3).standard_normal(6)
    other = e.copy()
    other[4] += 1.0
    depends = not np.isclose(
        noise.innovations(e, shape, steps)[5], noise.innovations(other, shape, steps)[5], rtol=1e-8
    )
    empty = noise.name in {"ar1", "effective_samples"} and shape[0] in (0.0, 1.0)
    assert depends == (noise.remembers and not empty)


def test_effective_samples_are_a_share_of_the_independent_likelihood() -> None:
    noise, shape = NOISE_MODELS["effective_samples"], np.array([4.0])
    rows = np.random.default_rng(0).standard_normal((3, 20))
    gram = noise.weighted_gram(rows, shape[None], steps_of(20))[0]
    np.testing.assert_allclose(gram, rows @ rows.T / 4.0, rtol=1e-13)
    independent = NOISE_MODELS["independent"].log_density(rows, np.empty(0), steps_of(20))
    np.testing.assert_array_equal(noise.log_density(rows, shape, steps_of(20)), independent)


@cases()
def test_models_pickle(noise: NoiseModel, shape: np.ndarray) -> None:
    steps = steps_of(10)
    e = np.random.default_rng(13).standard_normal(10)
    again = pickle.loads(pickle.dumps(noise))
    np.testing.assert_array_equal(again.log_density(e, shape, steps), noise.log_density(e, shape, steps))


@cases()
def test_draws_are_decided_by_the_generator(noise: NoiseModel, shape: np.ndarray) -> None:
    steps = steps_of(10)
    np.testing.assert_array_equal(series(noise, shape, steps, 3, 1), series(noise, shape, steps, 3, 1))


@pytest.mark.parametrize(
    ("name", "shape"), [("ar1", (1.0,)), ("ar1", (-1.0,)), ("ar1_time", (1e300,)), ("ar1_time", (1e-300,))]
)
def test_the_ends_of_the_range_are_never_nan(name: str, shape: tuple[float, ...]) -> None:
    steps = steps_of(10)
    e = np.random.default_rng(14).standard_normal((2, 10))
    value = NOISE_MODELS[name].total_log_density(e, np.tile(shape, (2, 1)), steps)
    assert not np.isnan(value).any()
    if abs(shape[0]) == 1.0:
        np.testing.assert_array_equal(value, [-np.inf, -np.inf])


def test_two_samples_at_one_instant_are_nearly_one_sample() -> None:
    first = np.array([True, False, False])
    steps = Steps(first, np.array([1.0, 0.0, 1.0]), timed=True)
    noise = NOISE_MODELS["ar1_time"]
    same = noise.total_log_density(np.array([0.5, 0.5, 0.4]), np.array([3.0]), steps)
    apart = noise.total_log_density(np.array([0.5, 0.6, 0.4]), np.array([3.0]), steps)
    assert np.isfinite(same)
    assert apart < same - 1000.0
