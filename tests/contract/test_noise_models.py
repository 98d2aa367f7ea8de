"""Every noise model: agrees with scipy and with its own draws, forgets between sweeps, broadcasts, pickles.

Models of other installed packages are tried like those that ship; ``-k NAME`` tries one of them. Each is tried as it is
and with what may follow its name: noise that grows with the response, an error of the thermometer.
"""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy import stats

from sma_bayes.errors import UnknownNameError
from sma_bayes.noise import NOISE_MODELS, NoiseModel, Steps
from sma_bayes.noise.heteroscedastic import WRAPPERS
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.parameters.scales import RecordScales

SHAPES: dict[str, tuple[tuple[float, ...], ...]] = {
    "ar1": ((0.6,), (-0.4,), (0.97,), (0.0,)),
    "ar1_time": ((3.0,), (0.3,), (200.0,)),
    "student_t": ((4.0,), (2.2,), (80.0,)),
    "ar1_student_t": ((0.6, 4.0), (-0.4, 80.0), (0.95, 3.0)),
    "ar1_time_student_t": ((3.0, 4.0), (0.3, 80.0), (100.0, 3.0)),
    "effective_samples": ((3.0,), (1.0,), (40.0,)),
}
"""Parameters after `sd` with which some models are tried; others with what their own estimate chooses from."""

GROWTH = 0.7
EXTENSIONS = ("", "+growing", "+temperature_error", "+growing+temperature_error")
NAMES = tuple(
    name + extension
    for name in NOISE_MODELS
    for extension in EXTENSIONS
    if not (extension and NOISE_MODELS[name].stands_alone)
)
GAUSSIAN = tuple(n for n in NAMES if NOISE_MODELS[n].is_gaussian)
DENSITIES = tuple(n for n in NAMES if NOISE_MODELS[n].is_density)
HEAVY = tuple(n for n in DENSITIES if n not in GAUSSIAN)
REMEMBER = tuple(n for n in NAMES if NOISE_MODELS[n].autocorrelated)


def shapes_of(name: str) -> tuple[tuple[float, ...], ...]:
    """Parameters after `sd` with which a model is tried; of one that is extended the first of the plain one."""
    series, *others = name.split("+")
    candidates = NOISE_MODELS[series].shape_candidates(steps_of(50))
    middle = {0: None, len(candidates) // 2: None, len(candidates) - 1: None}
    found = SHAPES.get(series) or tuple(tuple(map(float, candidates[i])) for i in middle)
    if others:
        found = found[:1]
    return tuple((*shape, GROWTH) for shape in found) if "growing" in others else found


def cases(names: tuple[str, ...] = NAMES):
    return pytest.mark.parametrize(
        ("noise", "shape"),
        [
            pytest.param(
                NOISE_MODELS[n], np.array(s, dtype=float), id=f"{n}-{'-'.join(f'{x:.3g}' for x in s)}"
            )
            for n in names
            for s in shapes_of(n)
        ],
    )


def steps_of(n: int, starts: tuple[int, ...] = (0,), seed: int = 0) -> Steps:
    """Unequal steps, a new sweep at each of `starts`."""
    first = np.zeros(n, dtype=bool)
    first[list(starts)] = True
    dt = np.random.default_rng(seed).uniform(0.2, 2.0, n)
    return Steps(first, np.where(first, 1.0, dt), timed=True)


def correlation(noise: NoiseModel, shape: np.ndarray, steps: Steps) -> np.ndarray:
    """Dense correlation matrix of a Gaussian series: by definition of what ships, else from how it is decorrelated."""
    n, name = steps.first.size, noise.name.split("+")[0]
    sweep = np.cumsum(steps.first)
    together = sweep[:, None] == sweep
    if name == "independent":
        return np.eye(n)
    if name == "ar1":
        lag = np.abs(np.arange(n)[:, None] - np.arange(n))
        return np.where(together, shape[0] ** lag, 0.0)
    if name == "ar1_time":
        time = np.cumsum(np.where(steps.first, 0.0, steps.dt))
        return np.where(together, np.exp(-np.abs(time[:, None] - time) / shape[0]), 0.0)
    inverse = np.linalg.inv(whitening(noise, shape, steps))
    return inverse @ inverse.T


def whitening(noise: NoiseModel, shape: np.ndarray, steps: Steps) -> np.ndarray:
    """Matrix of `decorrelate`."""
    n = steps.first.size
    return noise.decorrelate(np.eye(n), np.tile(shape, (n, 1)), steps).T


def series(noise: NoiseModel, shape: np.ndarray, steps: Steps, size: int, seed: int) -> np.ndarray:
    return noise.draw(np.random.default_rng(seed), np.tile(shape, (size, 1)), steps)


@pytest.mark.parametrize("name", NAMES)
def test_a_model_has_the_name_by_which_it_is_found(name: str) -> None:
    assert NOISE_MODELS[name].name == name
    assert name in NOISE_MODELS
    assert isinstance(NOISE_MODELS[name], NoiseModel)
    assert NOISE_MODELS[name].title


def test_what_follows_a_name_may_stand_in_any_order_but_only_once() -> None:
    assert NOISE_MODELS["ar1+temperature_error+growing"].name == "ar1+growing+temperature_error"
    for wrong in ("ar1+growing+growing", "ar1+shrinking", "ar1+", "+growing", "ar2+growing"):
        assert wrong not in NOISE_MODELS
        with pytest.raises(UnknownNameError):
            NOISE_MODELS[wrong]


@pytest.mark.parametrize("name", NAMES)
def test_parameters_begin_with_the_standard_deviation_and_have_priors(name: str, make_record) -> None:
    noise, record = NOISE_MODELS[name], make_record(("force",))
    facts = noise.parameters("force", "N", "s")
    assert (facts[0].name, facts[0].unit) == ("force_sd", "N")
    assert facts[0].prior_key == ("sd" if noise.is_density else "spread")
    assert all(f.name.startswith("force_") and f.channel == "force" and f.meaning for f in facts)
    assert len({f.name for f in facts}) == len(facts)
    scales = RecordScales.of([record]).with_residual({"force": 0.1}).with_memory({"force": 5.0})
    priors = read_priors("modified_sigmoid")
    parameters = [priors.parameter(fact, record.branch, scales, noise=True) for fact in facts]
    for shape in shapes_of(name):
        assert len(facts) == 1 + len(shape)
        for parameter, value in zip(parameters[1:], shape, strict=True):
            assert parameter.fixed is not None or np.isfinite(parameter.prior.log_density(np.array(value)))
    assert noise.shape_candidates(steps_of(50)).ndim == 2


@cases(GAUSSIAN)
@pytest.mark.parametrize("starts", [(0,), (0, 5), (0, 1, 2, 11)])
def test_gaussian_models_are_the_dense_multivariate_normal(
    noise: NoiseModel, shape: np.ndarray, starts: tuple[int, ...]
) -> None:
    steps = steps_of(12, starts)
    dense = stats.multivariate_normal(np.zeros(12), correlation(noise, shape, steps))
    e = np.random.default_rng(1).standard_normal((6, 12))
    found = noise.total_log_density(e, np.tile(shape, (6, 1)), steps)
    np.testing.assert_allclose(found, dense.logpdf(e), rtol=1e-9, atol=1e-9)


@cases(tuple(n for n in HEAVY if n.split("+")[0] == "student_t"))
def test_heavy_tailed_models_are_scipys_t(noise: NoiseModel, shape: np.ndarray) -> None:
    steps = steps_of(12, (0, 5))
    e = 2.0 * np.random.default_rng(1).standard_normal(12)
    np.testing.assert_allclose(noise.log_density(e, shape, steps), stats.t.logpdf(e, shape[0]), rtol=1e-12)


@pytest.mark.parametrize("step", [0.0, 0.01, 2.0, 5.0, 300.0])
def test_rounded_readings_have_the_probability_of_their_interval(step: float) -> None:
    noise = NOISE_MODELS["rounded"]
    shape = noise.shape_of(np.array([0.2, 0.2 * step]))
    np.testing.assert_allclose(shape, [step], rtol=1e-12)
    e = np.array([-20.0, -3.0, 0.0, 0.4, 2.5, 8.0, 60.0])
    upper, lower = -np.abs(e) + 0.5 * step, -np.abs(e) - 0.5 * step  # in the lower tail, for its digits
    expected = stats.norm.logpdf(e)
    if step:
        inside, beyond = stats.norm.logcdf(upper), stats.norm.logcdf(lower)
        expected = inside + np.log1p(-np.exp(beyond - inside)) - np.log(step)
    found = noise.log_density(e, shape, Steps.apart(e.size))
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-9)
    assert np.isfinite(noise.score(np.array([0.0, 1e100, -1e5]), shape)).all()


def test_rounded_readings_are_multiples_of_the_step_and_as_often_as_their_interval_says() -> None:
    """40,000 readings; each of the five levels within 4.5 standard errors: a false alarm in 30,000 runs."""
    noise, size = NOISE_MODELS["rounded"], 40_000
    shape, steps = np.array([4.0]), Steps.apart(size)
    y = noise.readings(np.random.default_rng(0), np.full(size, 0.13), np.array([0.05]), shape, steps, 1.0)
    level = np.round((y - 1.0) / 0.2)
    np.testing.assert_allclose(y, 1.0 + 0.2 * level, atol=1e-12)
    for k in range(-7, -2):
        edges = 1.0 + 0.2 * (k + np.array([-0.5, 0.5]))
        expected = float(np.diff(stats.norm.cdf(edges, 0.13, 0.05))[0])
        assert abs(np.mean(level == k) - expected) <= 4.5 * np.sqrt(expected * (1.0 - expected) / size) + 1e-9


def test_nothing_can_be_added_to_rounded_noise() -> None:
    assert "rounded+growing" not in NOISE_MODELS
    with pytest.raises(UnknownNameError, match="nothing can be added"):
        NOISE_MODELS["rounded+growing"]


@cases(tuple(n for n in HEAVY if n.split("+")[0] in ("ar1_student_t", "ar1_time_student_t")))
def test_heavy_tailed_innovations_are_scipys_t(noise: NoiseModel, shape: np.ndarray) -> None:
    steps = steps_of(12, (0, 5))
    e = 2.0 * np.random.default_rng(1).standard_normal((3, 12))
    gaussian = NOISE_MODELS[noise.name.split("_student_t")[0]]
    root = np.linalg.inv(np.linalg.cholesky(correlation(gaussian, shape, steps)))
    expected = stats.t.logpdf(e @ root.T, shape[1]).sum(axis=1) + np.log(np.diag(root)).sum()
    found = noise.total_log_density(e, np.tile(shape, (3, 1)), steps)
    np.testing.assert_allclose(found, expected, rtol=1e-10)
    far = noise.total_log_density(1e100 * e, np.tile(shape, (3, 1)), steps)
    assert np.isfinite(far).all()


GRID = np.sinh(np.linspace(-25.0, 25.0, 20_001))
"""Innovations that reach into any tail."""


@cases(DENSITIES)
def test_a_density_integrates_to_one(noise: NoiseModel, shape: np.ndarray) -> None:
    height = np.exp(noise.log_density(GRID, shape, Steps.apart(GRID.size)))
    assert np.trapezoid(height, GRID) == pytest.approx(1.0, abs=2e-4)


@cases(DENSITIES)
def test_a_series_has_the_density_of_its_innovations(noise: NoiseModel, shape: np.ndarray) -> None:
    steps = steps_of(15, (0, 6, 7))
    e = np.random.default_rng(2).standard_normal((4, 15))
    shapes = np.tile(shape, (4, 1))
    a = noise.decorrelate(e, shapes, steps)
    jacobian = np.linalg.slogdet(whitening(noise, shape, steps))[1]
    np.testing.assert_allclose(
        noise.total_log_density(e, shapes, steps),
        noise.total_log_density(a, shapes, Steps.apart(15)) + jacobian,
        rtol=1e-9,
    )


@cases()
def test_decorrelating_is_linear_causal_and_undone(noise: NoiseModel, shape: np.ndarray) -> None:
    steps = steps_of(15, (0, 6, 7))
    rng = np.random.default_rng(3)
    e, shapes = rng.standard_normal((4, 15)), np.tile(shape, (4, 1))
    matrix = whitening(noise, shape, steps)
    a = noise.decorrelate(e, shapes, steps)
    np.testing.assert_allclose(a, e @ matrix.T, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(matrix, np.tril(matrix))
    np.testing.assert_array_equal(matrix[steps.first], np.eye(15)[steps.first])
    np.testing.assert_allclose(noise.correlate(a, shapes, steps), e, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(noise.decorrelate_adjoint(e, shapes, steps), e @ matrix, rtol=1e-9, atol=1e-9)


@cases()
def test_the_score_is_the_derivative_of_the_density(noise: NoiseModel, shape: np.ndarray) -> None:
    a = np.array([-30.0, -3.0, -1.1, -0.4, 0.3, 0.9, 2.0, 7.0])
    h = 1e-6
    apart = Steps.apart(a.size)
    rise = noise.log_density(a + h, shape, apart) - noise.log_density(a - h, shape, apart)
    found = noise.score(np.stack([a, -a]), np.stack([shape, shape]))
    np.testing.assert_allclose(found[0], -rise / (2.0 * h), rtol=1e-4, atol=1e-5)
    assert found.shape == (2, a.size)


@cases()
def test_the_information_is_the_expected_square_of_the_score(noise: NoiseModel, shape: np.ndarray) -> None:
    middle = 0.5 * (GRID[1:] + GRID[:-1])
    weight = np.exp(noise.log_density(middle, shape, Steps.apart(middle.size))) * np.diff(GRID)
    expected = np.sum(noise.score(middle, shape) ** 2 * weight)
    found = noise.location_information(np.stack([shape, shape]))
    assert found.shape == (2,)
    np.testing.assert_allclose(found, expected, rtol=3e-3)


@cases()
def test_the_scale_of_noise_that_grows_is_positive(noise: NoiseModel, shape: np.ndarray) -> None:
    response = np.array([[-np.inf, -1e300, -0.2, 0.0, 0.5, 1.0, 1.4, 1e300, np.inf]] * 3)
    found = noise.relative_scale(np.tile(shape, (3, 1)), response)
    assert (found is None) == ("+growing" not in noise.name)
    if found is not None:
        assert found.shape == response.shape
        assert np.all(np.isfinite(found) & (found > 0.0))
        np.testing.assert_array_equal(found[1], noise.relative_scale(shape, response[1]))


@cases(tuple(n for n in NAMES if "+growing" in n))
def test_growing_noise_grows_with_the_response(noise: NoiseModel, shape: np.ndarray) -> None:
    below = NOISE_MODELS[noise.name.replace("+growing", "")].relative_scale(
        shape[:-1], np.array([0.0, 0.5, 1.0])
    )
    cold, middle, hot = noise.relative_scale(shape, np.array([0.0, 0.5, 1.0])) / (
        1.0 if below is None else below
    )
    assert middle == pytest.approx(1.0)
    assert hot / cold == pytest.approx(np.exp(GROWTH))


@pytest.mark.parametrize("name", NAMES)
def test_only_an_extended_model_feels_the_thermometer(name: str) -> None:
    assert NOISE_MODELS[name].feels_temperature == ("+temperature_error" in name)
    assert set(name.split("+")[1:]) <= set(WRAPPERS)


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
    """The mean of p(e; other)/p(e; own) over own draws is one. Five standard errors; the seed is fixed.

    Other is first another shape, then another scale.
    """
    steps = steps_of(8, (0, 3))
    e = series(noise, shape, steps, 20_000, 6)
    own = noise.total_log_density(e, np.tile(shape, (len(e), 1)), steps)
    for factor in (0.97, 1.03):
        reshaped = noise.total_log_density(e, np.tile(shape * factor, (len(e), 1)), steps)
        scaled = noise.total_log_density(e / factor, np.tile(shape, (len(e), 1)), steps) - 8 * np.log(factor)
        for other in (reshaped, scaled):
            ratio = np.exp(other - own)
            assert abs(ratio.mean() - 1.0) <= 5.0 * ratio.std() / np.sqrt(len(e)) + 1e-12


@cases(GAUSSIAN)
def test_what_is_drawn_has_the_moments(noise: NoiseModel, shape: np.ndarray) -> None:
    """All 36 covariances of 6 samples, 5 standard errors each: a false alarm in 50,000 runs; the seed is fixed."""
    steps = steps_of(6, (0, 4))
    size = 30_000
    e = series(noise, shape, steps, size, 7)
    expected = correlation(noise, shape, steps)
    error = np.sqrt((1.0 + expected**2) / size)
    assert np.all(np.abs(e.mean(axis=0)) < 5.0 / np.sqrt(size))
    assert np.all(np.abs(np.cov(e.T) - expected) < 5.0 * error)


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
    dense = rows @ np.linalg.inv(correlation(noise, shape, steps)) @ rows.T
    found = noise.information(np.tile(shape, (3, 1)), steps).gram(rows)
    assert found.shape == (3, 4, 4)
    for each in found:
        np.testing.assert_allclose(each, dense, rtol=1e-8, atol=1e-8 * np.abs(dense).max())


@cases(GAUSSIAN)
@pytest.mark.parametrize("sd", [np.linspace(0.5, 3.0, 25), np.array([0.4])], ids=["uneven", "even"])
def test_the_gram_matrix_knows_of_the_standard_deviation_of_each_sample(
    noise: NoiseModel, shape: np.ndarray, sd: np.ndarray
) -> None:
    steps = steps_of(25, (0, 10, 11))
    rows = np.random.default_rng(10).standard_normal((4, 25))
    covariance = correlation(noise, shape, steps) * np.multiply.outer(np.ones(25) * sd, np.ones(25) * sd)
    dense = rows @ np.linalg.inv(covariance) @ rows.T
    found = noise.information(np.tile(shape, (3, 1)), steps, np.tile(1.0 / sd, (3, 1))).gram(rows)
    for each in found:
        np.testing.assert_allclose(each, dense, rtol=1e-8, atol=1e-8 * np.abs(dense).max())


@cases()
@pytest.mark.parametrize("even", [True, False], ids=["even", "uneven"])
def test_information_about_series_is_the_sum_over_sweeps(
    noise: NoiseModel, shape: np.ndarray, even: bool
) -> None:
    rng, shapes = np.random.default_rng(12), np.tile(shape, (3, 1))
    steps = steps_of(25, (0, 10, 11))
    rows, others = rng.standard_normal((4, 25)), rng.standard_normal((2, 25))
    inverse = rng.uniform(0.5, 2.0, (3, 1 if even else 25))
    information = noise.information(shapes, steps, inverse)
    whole = information.products(rows, others)
    assert whole.shape == (3, 4, 2)
    parts = [information.products(rows, others, s) for s in (slice(0, 10), slice(10, 11), slice(11, 25))]
    np.testing.assert_allclose(sum(parts), whole, rtol=1e-9, atol=1e-9 * np.abs(whole).max())
    joined = information.gram(np.concatenate([rows, others]))
    np.testing.assert_allclose(joined[:, :4, 4:], whole, rtol=1e-9, atol=1e-9 * np.abs(whole).max())
    alone = noise.information(shapes, steps.part(slice(11, 25)), inverse if even else inverse[:, 11:])
    np.testing.assert_allclose(
        alone.products(rows[:, 11:], others[:, 11:]), parts[2], rtol=1e-9, atol=1e-9 * np.abs(whole).max()
    )
    twice = information.scaled(np.array([1.0, 2.0, 3.0])).products(rows, others)
    np.testing.assert_allclose(twice, np.array([1.0, 2.0, 3.0])[:, None, None] * whole, rtol=1e-12)


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
        expected = float(noise.information(shape[None], steps).gram(row[None])[0, 0, 0])
        assert np.mean(score**2) == pytest.approx(expected, rel=0.03)


@cases()
def test_the_estimate_recovers_what_was_drawn(noise: NoiseModel, shape: np.ndarray) -> None:
    steps = steps_of(4_000, tuple(range(0, 4_000, 500)))
    residual = 0.3 * series(noise, shape, steps, 1, 12)[0]
    estimate = noise.estimate(residual, steps)
    truth = np.array([0.3, *shape])
    if "+growing" in noise.name:  # the series itself does not grow
        truth[-1] = 0.0
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


@cases(DENSITIES)
def test_all_of_a_density_counts(noise: NoiseModel, shape: np.ndarray) -> None:
    np.testing.assert_array_equal(noise.likelihood_weight(np.tile(shape, (4, 1))), np.ones(4))


@pytest.mark.parametrize("name", NAMES)
def test_a_model_that_remembers_says_so(name: str) -> None:
    """The last sample's innovation depends on the one before it, in some shape, and only then."""
    noise, steps = NOISE_MODELS[name], steps_of(6)
    e = np.random.default_rng(3).standard_normal(6)
    other = e.copy()
    other[4] += 1.0
    found = [
        not np.isclose(*(noise.innovations(x, np.array(shape), steps)[5] for x in (e, other)), rtol=1e-8)
        for shape in shapes_of(name)
    ]
    assert any(found) == noise.autocorrelated


def test_effective_samples_are_a_share_of_the_independent_likelihood() -> None:
    noise, shape = NOISE_MODELS["effective_samples"], np.array([4.0])
    rows = np.random.default_rng(0).standard_normal((3, 20))
    np.testing.assert_array_equal(noise.likelihood_weight(np.tile(shape, (2, 1))), [0.25, 0.25])
    gram = noise.information(shape[None], steps_of(20)).gram(rows)[0]
    np.testing.assert_allclose(gram, rows @ rows.T / 4.0, rtol=1e-13)
    independent = NOISE_MODELS["independent"].log_density(rows, np.empty(0), steps_of(20))
    np.testing.assert_array_equal(noise.log_density(rows, shape, steps_of(20)), independent)


@cases()
def test_the_memory_is_one_sample_where_there_is_none(noise: NoiseModel, shape: np.ndarray) -> None:
    found = noise.memory(shape, steps_of(50))
    assert np.isfinite(found)
    assert found >= 1.0
    assert noise.autocorrelated or found == 1.0


def test_the_memory_counts_samples_as_one() -> None:
    even = Steps(np.arange(50) == 0, np.ones(50), timed=True)
    assert NOISE_MODELS["ar1"].memory(np.array([0.8]), even) == pytest.approx(9.0)
    assert NOISE_MODELS["ar1"].memory(np.array([-0.8]), even) == 1.0
    assert NOISE_MODELS["ar1_student_t+growing"].memory(np.array([0.8, 4.0, 1.0]), even) == pytest.approx(9.0)
    assert NOISE_MODELS["ar1_time"].memory(np.array([10.0]), even) == pytest.approx(20.0, rel=0.01)
    assert NOISE_MODELS["effective_samples"].memory(np.array([7.0]), even) == pytest.approx(7.0)


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
    ("name", "shape"),
    [
        ("ar1", (1.0,)),
        ("ar1", (-1.0,)),
        ("ar1_student_t", (1.0, 4.0)),
        ("ar1_student_t", (-1.0, 4.0)),
        ("ar1_time", (1e300,)),
        ("ar1_time", (1e-300,)),
        ("ar1_time_student_t", (1e300, 3.0)),
        ("ar1_time_student_t", (1e-300, 3.0)),
    ],
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
