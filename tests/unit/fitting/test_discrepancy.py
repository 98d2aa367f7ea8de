"""What a curve misses: its basis, its density with the weights integrated out, and draws of the weights."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import optimize, stats
from scipy.special import logsumexp

from sma_bayes.arrays import Floats
from sma_bayes.fitting.discrepancy import NODES, DiscrepancyBasis, build_basis, nodes_of
from sma_bayes.fitting.discrepancy_weights import NormalWeights, Whitened, safe_cholesky
from sma_bayes.noise import NOISE_MODELS, Steps

N = 40
SHAPES = {"independent": (), "ar1": (0.7,), "ar1_time": (3.0,)}


def logistic(theta: np.ndarray, t: np.ndarray) -> np.ndarray:
    return theta[0] / (1.0 + np.exp(-theta[1] * (t - theta[2]))) + theta[3]


THETA = np.array([2.5, 0.35, 52.0, 0.5])


def tangents(t: np.ndarray, theta: np.ndarray = THETA) -> np.ndarray:
    s = 1.0 / (1.0 + np.exp(-theta[1] * (t - theta[2])))
    slope = theta[0] * s * (1.0 - s)
    return np.stack([s, slope * (t - theta[2]), -slope * theta[1], np.ones_like(t)], axis=-1)


def basis_for(t: np.ndarray, functions: int = 30, theta: np.ndarray = THETA) -> DiscrepancyBasis | None:
    fine = np.linspace(t.min(), t.max(), 2001)
    nodes = nodes_of(t.min(), t.max(), fine, logistic(theta, fine))
    return build_basis(
        t, nodes, logistic(theta, nodes), tangents(t, theta), tangents(nodes, theta), functions
    )


TEMPERATURE = np.sort(np.random.default_rng(0).uniform(30.0, 70.0, N))
BASIS = basis_for(TEMPERATURE)
assert BASIS is not None


def steps(n: int = N) -> Steps:
    first = np.arange(n) % (n // 2) == 0
    dt = np.random.default_rng(1).uniform(0.3, 2.0, n)
    return Steps(first, np.where(first, 1.0, dt), timed=True)


def correlation(name: str, s: Steps) -> np.ndarray:
    n = s.first.size
    sweep = np.cumsum(s.first)
    together = sweep[:, None] == sweep
    if name == "ar1":
        return np.where(together, 0.7 ** np.abs(np.arange(n)[:, None] - np.arange(n)), 0.0)
    if name == "ar1_time":
        time = np.cumsum(np.where(s.first, 0.0, s.dt))
        return np.where(together, np.exp(-np.abs(time[:, None] - time) / 3.0), 0.0)
    return np.eye(n)


def scales(kind: str) -> np.ndarray:
    """Standard deviation of the noise of each sample: one, growing with the response, with an error of temperature."""
    even = np.array([[0.02], [0.1]])
    y = (logistic(THETA, TEMPERATURE) - 0.5) / 2.5
    if kind == "growing":
        return even * np.exp(1.5 * (y - 0.5))
    return np.sqrt(even**2 + (0.5 * tangents(TEMPERATURE)[:, 2]) ** 2) if kind == "temperature" else even


def whitened(
    name: str, kind: str = "even", size: float = 0.1, residual: np.ndarray | None = None
) -> Whitened:
    scale = scales(kind)
    r = 0.1 * np.random.default_rng(2).standard_normal((2, N)) if residual is None else residual
    shape = np.tile(np.array(SHAPES.get(name, (4.0,)), dtype=float), (2, 1))
    return Whitened(NOISE_MODELS[name], shape, steps(), r / scale, scale, BASIS.rows, np.full((2, 1), size))


def dense(w: Whitened, row: int, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Residual, covariance of the noise, and covariance of the weights a priori."""
    scale = np.broadcast_to(w.scale, w.e.shape)[row]
    noise = correlation(name, w.steps) * np.outer(scale, scale)
    return w.e[row] * scale, noise, np.eye(len(w.rows)) * w.size[row] ** 2


def dense_conditional(w: Whitened, row: int, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance of the weights given the residuals."""
    residual, noise, prior = dense(w, row, name)
    information = np.linalg.inv(prior) + w.rows @ np.linalg.solve(noise, w.rows.T)
    covariance = np.linalg.inv(information)
    return covariance @ w.rows @ np.linalg.solve(noise, residual), covariance


KINDS = pytest.mark.parametrize("kind", ["even", "growing", "temperature"])
GAUSSIAN = pytest.mark.parametrize("name", list(SHAPES))


# --- the basis -------------------------------------------------------------------------------------------


def test_the_basis_is_kept_off_the_tangents_and_orthogonal() -> None:
    rows = BASIS.rows
    assert rows.shape == (BASIS.count, N)
    assert BASIS.count == (N - 4) // 2
    t = tangents(TEMPERATURE)
    overlap = rows @ t / np.linalg.norm(t, axis=0)
    assert np.abs(overlap).max() < 1e-7 * np.linalg.norm(rows, axis=1).max()
    gram = rows @ rows.T
    np.testing.assert_allclose(gram, np.diag(np.diag(gram)), atol=1e-8 * gram.max())
    assert np.all(np.diff(np.diag(gram)) <= 1e-8)


def test_its_variance_is_one_over_the_samples() -> None:
    assert np.mean(np.sum(BASIS.rows**2, axis=0)) == pytest.approx(1.0, rel=1e-9)


def test_the_table_agrees_with_the_samples() -> None:
    np.testing.assert_allclose(BASIS.at(TEMPERATURE).T, BASIS.rows, atol=2e-3)
    again = DiscrepancyBasis.tabulated(BASIS.temperature, BASIS.values, TEMPERATURE)
    np.testing.assert_allclose(again.rows, BASIS.at(TEMPERATURE).T, rtol=1e-12)


def test_it_lies_closer_where_the_curve_changes() -> None:
    step = np.diff(BASIS.temperature)
    middle = 0.5 * (BASIS.temperature[1:] + BASIS.temperature[:-1])
    assert step[np.abs(middle - 52.0) < 2.0].max() < 0.5 * step[np.abs(middle - 52.0) > 15.0].min()
    even = nodes_of(0.0, 1.0, np.linspace(0.0, 1.0, 50), np.zeros(50))
    np.testing.assert_allclose(even, np.linspace(0.0, 1.0, NODES), atol=1e-12)


def test_it_goes_on_straight_beyond_the_nodes() -> None:
    low, high = BASIS.temperature[[0, -1]]
    for inside, outside in (
        (low, low - np.array([1.0, 2.0, 30.0])),
        (high, high + np.array([1.0, 2.0, 30.0])),
    ):
        expected = BASIS.at(inside) + (outside - inside)[:, None] * BASIS.slope(inside)
        np.testing.assert_allclose(BASIS.at(outside), expected, rtol=1e-12)
        np.testing.assert_array_equal(BASIS.slope(outside), np.tile(BASIS.slope(inside), (3, 1)))


def test_its_slope_is_that_of_finite_differences() -> None:
    t = np.linspace(25.0, 75.0, 101)
    h = 1e-5
    expected = (BASIS.at(t + h) - BASIS.at(t - h)) / (2.0 * h)
    np.testing.assert_allclose(BASIS.slope(t), expected, atol=1e-6 * np.abs(expected).max())
    weights = np.random.default_rng(3).standard_normal((5, BASIS.count))
    np.testing.assert_allclose(BASIS.function(weights, t), weights @ BASIS.at(t).T, rtol=1e-12)
    np.testing.assert_allclose(BASIS.function_slope(weights, t), weights @ BASIS.slope(t).T, rtol=1e-12)


def test_each_draw_may_have_temperatures_of_its_own() -> None:
    weights = np.random.default_rng(3).standard_normal((3, BASIS.count))
    t = np.random.default_rng(4).uniform(20.0, 80.0, (3, 7))
    for call in (BASIS.function, BASIS.function_slope):
        found = call(weights, t)
        assert found.shape == (3, 7)
        for i in range(3):
            np.testing.assert_allclose(found[i], call(weights[i : i + 1], t[i])[0], rtol=1e-10)


@pytest.mark.parametrize(("n", "count"), [(3, None), (4, None), (5, None), (6, 1), (9, 2), (200, 30)])
def test_functions_take_at_most_half_of_the_samples_that_parameters_leave(n: int, count: int | None) -> None:
    found = basis_for(np.linspace(30.0, 70.0, n))
    assert (None if found is None else found.count) == count


def test_samples_at_few_temperatures_have_no_room() -> None:
    assert basis_for(np.repeat(np.linspace(30.0, 70.0, 4), 20)) is None


# --- the density -----------------------------------------------------------------------------------------


@GAUSSIAN
@KINDS
def test_the_density_is_that_of_the_dense_normal(name: str, kind: str) -> None:
    w = whitened(name, kind)
    found = w.marginal_log_density()
    for row in range(2):
        residual, noise, prior = dense(w, row, name)
        covariance = noise + w.rows.T @ prior @ w.rows
        expected = stats.multivariate_normal(np.zeros(N), covariance).logpdf(residual)
        assert found[row] == pytest.approx(expected, rel=1e-9, abs=1e-7)


@GAUSSIAN
@KINDS
def test_weights_are_drawn_from_the_dense_conditional(name: str, kind: str) -> None:
    """Means and covariances of 20,000 draws of 30 weights: 5 standard errors each, one false alarm in 3,000 runs."""
    w = whitened(name, kind)
    size = 20_000
    many = Whitened(
        w.noise, np.tile(w.shape[:1], (size, 1)), w.steps, np.tile(w.e[:1], (size, 1)),
        np.tile(w.scale[:1], (size, 1)), w.rows, np.tile(w.size[:1], (size, 1)),
    )  # fmt: skip
    mean, covariance = dense_conditional(w, 0, name)
    np.testing.assert_allclose(w.likeliest_weights()[0], mean, atol=1e-9)
    draws = many.draw_weights(np.random.default_rng(5))
    sd = np.sqrt(np.diag(covariance))
    assert np.all(np.abs(draws.mean(axis=0) - mean) < 5.0 * sd / np.sqrt(size))
    error = np.sqrt((np.outer(sd, sd) ** 2 + covariance**2) / size)
    assert np.all(np.abs(np.cov(draws.T) - covariance) < 5.0 * error)


@GAUSSIAN
@KINDS
def test_a_sample_left_out_has_the_dense_conditional_given_all_others(name: str, kind: str) -> None:
    """Of innovations: where the noise has a memory, that of a sample with what those before it foretell."""
    w = whitened(name, kind)
    found = w.left_out_log_density()
    for row in range(2):
        residual, noise, prior = dense(w, row, name)
        root = np.linalg.cholesky(noise)
        a, rows = np.linalg.solve(root, residual), np.linalg.solve(root, w.rows.T)
        precision = np.linalg.inv(np.eye(N) + rows @ prior @ rows.T)
        sd = 1.0 / np.sqrt(np.diag(precision))
        expected = stats.norm.logpdf(sd**2 * (precision @ a), scale=sd) - np.log(np.diag(root))
        np.testing.assert_allclose(found[row], expected, rtol=1e-8, atol=1e-8)


@GAUSSIAN
@KINDS
def test_samples_that_weights_know_nothing_of_have_the_dense_predictive_density(name: str, kind: str) -> None:
    w = whitened(name, kind)
    rng = np.random.default_rng(8)
    root = np.tril(rng.normal(size=(2, w.rows.shape[0], w.rows.shape[0]))) * 0.05
    mean = 0.1 * rng.normal(size=(2, w.rows.shape[0]))
    found = w.predictive_log_density(NormalWeights(mean, root))
    for row in range(2):
        residual, noise, _ = dense(w, row, name)
        own = np.linalg.cholesky(noise)
        a = np.linalg.solve(own, residual - mean[row] @ w.rows)
        spread = np.linalg.solve(own, w.rows.T) @ root[row]
        sd = np.sqrt(1.0 + np.sum(spread**2, axis=1))
        expected = stats.norm.logpdf(a, scale=sd) - np.log(np.diag(own))
        np.testing.assert_allclose(found[row], expected, rtol=1e-8, atol=1e-8)


@GAUSSIAN
@KINDS
def test_weights_are_normal_with_the_dense_conditional(name: str, kind: str) -> None:
    w = whitened(name, kind)
    found = w.normal_weights()
    for row in range(2):
        mean, covariance = dense_conditional(w, row, name)
        np.testing.assert_allclose(found.root[row] @ found.root[row].T, covariance, atol=1e-10)
        np.testing.assert_allclose(found.mean[row], mean, atol=1e-9)


@pytest.mark.parametrize("name", ["student_t", "ar1_student_t"])
@pytest.mark.parametrize("size", [0.01, 0.1, 1.0])
def test_heavy_tails_are_integrated_as_by_quadrature(name: str, size: float) -> None:
    """Two weights; Laplace's method with expected information is good to 0.15 in ln with 40 samples, one an outlier."""
    rng = np.random.default_rng(6)
    residual = 0.05 * rng.standard_normal(N) + np.array([0.1, -0.05]) @ BASIS.rows[:2]
    residual[17] += 0.6
    shape = np.array([[0.6, 5.0]] if name.startswith("ar1") else [[5.0]])
    w = Whitened(
        NOISE_MODELS[name], shape, steps(), residual[None] / 0.05, np.full((1, 1), 0.05), BASIS.rows[:2],
        np.full((1, 1), size),
    )  # fmt: skip
    centre = w.likeliest_weights()[0]

    side = np.linspace(-8.0, 8.0, 161) * min(size, 0.05)
    grid = centre + np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    left = (residual - grid @ BASIS.rows[:2]) / 0.05
    joint = w.noise.total_log_density(left, np.tile(shape, (len(grid), 1)), w.steps) - N * np.log(0.05)
    joint = joint + stats.norm(0.0, size).logpdf(grid).sum(axis=1)
    expected = logsumexp(joint) + 2.0 * np.log(side[1] - side[0])
    assert w.marginal_log_density()[0] == pytest.approx(expected, abs=0.15)


@pytest.mark.parametrize(
    ("name", "shape"),
    [
        ("student_t", [1.3]),
        ("student_t", [3.0]),
        ("student_t", [40.0]),
        ("ar1_student_t", [0.84, 1.3]),
        ("ar1_student_t", [0.84, 3.0]),
        ("rounded", [0.3]),
        ("rounded", [6.0]),
    ],
)
@pytest.mark.parametrize("seed", range(3))
def test_the_likeliest_weights_are_the_likeliest(name: str, shape: list[float], seed: int) -> None:
    """As a minimiser that shares nothing with it finds them, where half of the samples lie on one curve exactly."""
    rng = np.random.default_rng(seed)
    scatter = stats.t(2.0).rvs(N, random_state=rng) if name != "rounded" else rng.standard_normal(N)
    e = np.where(rng.random(N) < 0.5, 0.0, scatter) + rng.standard_normal(BASIS.count) @ BASIS.rows
    size = 0.7
    w = Whitened(
        NOISE_MODELS[name],
        np.array([shape]),
        steps(),
        e[None],
        np.ones((1, 1)),
        BASIS.rows,
        np.full((1, 1), size),
    )

    def value(v: Floats) -> float:
        left = w.e - size * v @ w.rows
        return float(w.noise.total_log_density(left, w.shape, w.steps)[0] - 0.5 * v @ v)

    found = w.likeliest_weights()[0] / size
    best = optimize.minimize(lambda v: -value(v), found, method="BFGS", options={"gtol": 1e-4})
    assert value(found) > -best.fun - 3e-3


@pytest.mark.parametrize("name", [*SHAPES, "student_t"])
@KINDS
def test_without_size_it_is_the_noise_alone(name: str, kind: str) -> None:
    w = whitened(name, kind, size=1e-12)
    alone = w.noise.total_log_density(w.e, w.shape, w.steps)
    alone = alone - np.log(np.broadcast_to(w.scale, w.e.shape)).sum(axis=1)
    np.testing.assert_allclose(w.marginal_log_density(), alone, rtol=1e-9)


@pytest.mark.parametrize("name", [*SHAPES, "student_t"])
@KINDS
@pytest.mark.parametrize("size", [1e-300, 1e-150, 1e6, 1e150])
def test_no_size_overflows(name: str, kind: str, size: float) -> None:
    """What can't be held in numbers is NaN, which counts as impossible, never plus infinity or an error."""
    with np.errstate(over="ignore", invalid="ignore"):
        value = whitened(name, kind, size).marginal_log_density()
        drawn = whitened(name, kind, size).draw_weights(np.random.default_rng(0))
    assert drawn.shape == (2, BASIS.count)
    assert not np.isposinf(value).any()
    if size < 1.0:
        assert np.isfinite(value).all()
        assert np.isfinite(drawn).all()


def test_the_evidence_decides_the_size() -> None:
    """A smooth misfit of 0.2 in noise of 0.02: the likeliest size is near it."""
    rng = np.random.default_rng(8)
    weights = rng.standard_normal(BASIS.count)
    residual = np.tile(0.2 * weights @ BASIS.rows + 0.02 * rng.standard_normal(N), (2, 1))
    sizes = np.geomspace(1e-3, 10.0, 60)
    value = [whitened("independent", size=s, residual=residual).marginal_log_density()[0] for s in sizes]
    assert 0.08 < sizes[int(np.argmax(value))] < 0.5
    assert max(value) > value[0] + 100.0


@pytest.mark.parametrize("seed", range(5))
def test_nothing_is_explained_twice_where_samples_leave_a_gap(seed: int) -> None:
    """What is smooth in the gap is next to nothing at the samples; what rounding makes of it must not be a function.

    The sum of what functions explain one by one is what they explain together if they are orthogonal, whatever the
    residuals; one and the same part of them that is explained twice makes the density of a vanishing noise infinite.
    """
    rng = np.random.default_rng(seed)
    t = np.concatenate([26.26 + 0.06 * rng.standard_normal(14), rng.uniform(42.0, 57.5, 31)])
    basis = basis_for(t, theta=np.array([2.5, 5.0, 50.8, 0.5]))
    assert basis is not None
    power = np.einsum("mn,mn->m", basis.rows, basis.rows)
    seen = power > 0.0
    assert seen.sum() >= 8
    unit = basis.rows[seen] / np.sqrt(power[seen])[:, None]
    assert np.linalg.eigvalsh(unit @ unit.T)[-1] < 1.1


@pytest.mark.parametrize("rate", [0.2, 1.0, 3.0, 8.0, 20.0])
def test_basis_stays_of_its_size_where_the_transition_lies_between_two_readings(rate: float) -> None:
    temperature, theta = np.linspace(20.0, 80.0, 31), np.array([2.5, rate, 49.0, 0.5])
    fine = np.linspace(20.0, 80.0, 2001)
    nodes = nodes_of(20.0, 80.0, fine, logistic(theta, fine))
    basis = build_basis(
        temperature, nodes, logistic(theta, nodes), tangents(temperature, theta), tangents(nodes, theta)
    )
    assert basis is not None
    assert np.abs(basis.values).max() < 10.0 * np.abs(basis.rows).max()
    read_back = DiscrepancyBasis.tabulated(nodes, basis.values, temperature)
    np.testing.assert_allclose(read_back.rows, basis.rows, atol=0.02)


@pytest.mark.parametrize("midpoint", [42.5, 43.0, 43.5])
@pytest.mark.parametrize("repeats", [1, 200])
def test_basis_stays_of_its_size_where_one_reading_lies_in_the_transition(
    midpoint: float, repeats: int
) -> None:
    """It tells of midpoint and rate together: functions must not be kept off what turns the curve about it."""
    apart = np.concatenate([[26.3, 26.4], [43.0], np.linspace(49.0, 56.0, 15)])
    temperature, theta = np.repeat(apart, repeats), np.array([2.5, 2.0, midpoint, 0.5])
    temperature = temperature + 1e-3 * np.random.default_rng(3).standard_normal(temperature.size)
    basis = basis_for(temperature, theta=theta)
    assert basis is not None
    size = np.sqrt(np.mean(np.sum(basis.rows**2, axis=0)))
    assert np.sqrt(np.sum(basis.values**2, axis=1)).max() < 10.0 * size


@pytest.mark.parametrize("rate", [0.3, 0.5, 2.0])
@pytest.mark.parametrize("between", [[], [40.0, 42.0, 44.0, 46.0]])
def test_two_plateaus_alone_tell_of_no_discrepancy_between_them(between: list[float], rate: float) -> None:
    """The curve takes nearly all that they tell; what is left would be a hundred times as large between them."""
    temperature = np.concatenate([np.linspace(26.4, 26.7, 11), between, np.linspace(56.9, 58.0, 7)])
    basis = basis_for(temperature, theta=np.array([2.5, rate, 42.5, 0.5]))
    assert (basis is not None) == bool(between)


def test_information_that_rounding_leaves_indefinite_is_not_usable() -> None:
    """Thousands of nearly noiseless samples: of 1e13 along one direction, rounding may take 2 from another."""
    turn = np.linalg.qr(np.random.default_rng(1).standard_normal((4, 4)))[0]
    sound = turn @ np.diag([0.0, 3e11, 4e12, 9e12]) @ turn.T
    rounded = turn @ np.diag([-2.2, 3e11, 4e12, 9e12]) @ turn.T
    factors, usable = safe_cholesky(
        np.stack([0.5 * (h + h.T) for h in (np.eye(4), rounded, sound + np.eye(4))])
    )
    assert usable.tolist() == [True, False, True]
    np.testing.assert_allclose(factors[0] @ factors[0].T, 2.0 * np.eye(4), rtol=1e-12)
    assert np.isfinite(factors).all()
