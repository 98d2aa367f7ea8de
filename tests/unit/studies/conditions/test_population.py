"""The hierarchical model against dense Gaussian algebra, and its answers on campaigns whose law is known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from sma_bayes.assess.draws import RecordDraws
from sma_bayes.records.types import Condition
from sma_bayes.studies.conditions.coordinates import coordinates_for
from sma_bayes.studies.conditions.correction import log_ratio
from sma_bayes.studies.conditions.design import designs
from sma_bayes.studies.conditions.population import population_of
from sma_bayes.studies.conditions.scatter import ScatterDensity, Summary, summary_of

RNG = np.random.default_rng(5)
MATRIX = np.column_stack([np.ones(4), [-0.5, -0.1, 0.2, 0.5]])
WIDTH, CENTRE, SCALE = np.array([1.0, 2.0]), np.array([0.3, -0.5]), np.array([0.2, 0.4])


def toy() -> tuple[ScatterDensity, np.ndarray, np.ndarray]:
    """Four conditions of two coordinates, each measured with a known covariance."""
    covariances = np.stack(
        [(lambda r: r @ r.T + 0.01 * np.eye(2))(0.3 * RNG.standard_normal((2, 2))) for _ in range(4)]
    )
    y = CENTRE + RNG.standard_normal((4, 2))
    summaries = tuple(
        Summary(np.linalg.inv(v), np.linalg.solve(v, m)) for v, m in zip(covariances, y, strict=True)
    )
    return ScatterDensity(MATRIX, summaries, CENTRE, WIDTH, SCALE, ("p", "q")), y, covariances


def dense(tau: np.ndarray, covariances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance of all measurements, and of them with level and slopes, written out."""
    design = np.kron(MATRIX, np.eye(2))  # (8, 4)
    prior = np.diag(np.tile(WIDTH**2, 2))
    noise = np.zeros((8, 8))
    for c in range(4):
        noise[2 * c : 2 * c + 2, 2 * c : 2 * c + 2] = covariances[c] + np.diag(tau**2)
    return design, design @ prior @ design.T + noise


def test_marginal_likelihood_of_the_scatter_is_that_of_the_dense_gaussian() -> None:
    density, y, covariances = toy()
    log_tau = np.log(np.array([[0.01, 0.02], [0.1, 0.5], [1.0, 0.3], [3.0, 5.0]]))
    found = density.log_prob(log_tau) - density.log_prior(log_tau)
    expected = []
    for tau in np.exp(log_tau):
        design, covariance = dense(tau, covariances)
        mean = design @ np.concatenate([CENTRE, np.zeros(2)])
        expected.append(multivariate_normal.logpdf(y.ravel(), mean, covariance))
    np.testing.assert_allclose(np.diff(found), np.diff(expected), rtol=1e-8)


def test_prior_of_the_scatter_is_that_of_its_draws() -> None:
    density, _, _ = toy()
    draws = density.draw_prior(np.random.default_rng(0), 200_000)
    expected = multivariate_normal(draws.mean(axis=0), np.cov(draws.T))
    at = draws[:50]
    np.testing.assert_allclose(density.log_prior(at), expected.logpdf(at), atol=0.05)
    np.testing.assert_allclose(np.exp(np.median(draws, axis=0)), SCALE, rtol=0.02)


def test_level_and_slopes_given_the_scatter_are_those_of_the_dense_gaussian() -> None:
    density, y, covariances = toy()
    tau = np.array([0.2, 0.5])
    draws = density.coefficients(np.random.default_rng(1), np.tile(tau, (40_000, 1))).reshape(-1, 4)
    design, covariance = dense(tau, covariances)
    prior = np.diag(np.tile(WIDTH**2, 2))
    start = np.concatenate([CENTRE, np.zeros(2)])
    gain = prior @ design.T @ np.linalg.inv(covariance)
    np.testing.assert_allclose(draws.mean(axis=0), start + gain @ (y.ravel() - design @ start), atol=0.02)
    np.testing.assert_allclose(np.cov(draws.T), prior - gain @ design @ prior, atol=0.02)


def test_a_condition_given_the_rest_is_a_product_of_gaussians() -> None:
    density, y, covariances = toy()
    mean, tau = np.array([0.1, 0.2]), np.array([0.2, 0.5])
    size = 40_000
    draws, log_ratio = density.condition(1, mean[None], tau[None], np.random.default_rng(2), size, 1.3)
    weight = np.exp(log_ratio[0])
    assert weight.mean() == pytest.approx(1.0, abs=0.02)
    precision = np.linalg.inv(covariances[1]) + np.diag(tau**-2)
    centre = np.linalg.solve(precision, np.linalg.solve(covariances[1], y[1]) + mean / tau**2)
    found = np.average(draws[0], axis=0, weights=weight)
    np.testing.assert_allclose(found, centre, atol=0.01)
    left = draws[0] - found
    np.testing.assert_allclose(
        (left * weight[:, None]).T @ left / weight.sum(), np.linalg.inv(precision), rtol=0.05, atol=2e-3
    )


def test_dividing_by_the_prior_takes_it_out() -> None:
    prior_mean, prior_covariance = np.array([1.0, -1.0]), np.array([[2.0, 0.3], [0.3, 1.0]])
    precision, pull = np.array([[30.0, 5.0], [5.0, 20.0]]), np.array([10.0, 3.0])
    posterior = np.linalg.inv(precision + np.linalg.inv(prior_covariance))
    mean = posterior @ (pull + np.linalg.solve(prior_covariance, prior_mean))
    e = np.random.default_rng(3).standard_normal((5000, 2))
    e = (e - e.mean(axis=0)) @ np.linalg.inv(np.linalg.cholesky(np.cov(e.T))).T
    found = summary_of(mean + e @ np.linalg.cholesky(posterior).T, prior_mean, prior_covariance)
    np.testing.assert_allclose(found.precision, precision, rtol=1e-8)
    np.testing.assert_allclose(found.pull, pull, rtol=1e-6)


def test_what_repeats_the_prior_says_nothing() -> None:
    rng = np.random.default_rng(4)
    draws = np.column_stack([0.1 * rng.standard_normal(4000), 3.0 + 1.2 * rng.standard_normal(4000)])
    found = summary_of(draws, np.array([0.0, 3.0]), np.eye(2))
    values = np.linalg.eigvalsh(found.precision)
    assert values[0] == pytest.approx(0.0, abs=1e-9)
    assert values[1] == pytest.approx(99.0, rel=0.05)


def test_ratio_to_the_gaussian_form_integrates_the_noise_out(make_draws: Callable[..., RecordDraws]) -> None:
    record = make_draws(Condition("c", load=1.0), channels=("displacement",))
    coordinates = coordinates_for([record])
    summary = Summary(np.diag([4e3, 1e3, 5.0, 1e5]), np.array([-1e4, -1e3, 200.0, 50.0]))
    points = coordinates.to_coordinates(record.curve_theta[:3])
    ratios = log_ratio(
        summary, coordinates, record, np.repeat(points, 4000, axis=0), np.random.default_rng(1)
    )
    found = logsumexp(ratios.reshape(3, 4000), axis=1) - np.log(4000)
    ln_sd = np.linspace(-13.0, -5.0, 4001)  # quadrature over the standard deviation of the noise
    prior = record.posterior.space.parameters[-1].prior
    expected = []
    for phi in points:
        theta = np.empty((ln_sd.size, 5))
        theta[:, :4], theta[:, 4] = coordinates.to_parameters(phi), np.exp(ln_sd)
        log_p = record.posterior.log_likelihood(theta) + prior.log_density(theta[:, 4]) + ln_sd
        gaussian = phi @ summary.pull - 0.5 * phi @ summary.precision @ phi
        expected.append(logsumexp(log_p) + np.log(ln_sd[1] - ln_sd[0]) - gaussian)
    np.testing.assert_allclose(np.diff(found), np.diff(expected), atol=0.03)


def test_a_law_without_scatter_is_found(make_draws: Callable[..., RecordDraws]) -> None:
    loads = np.linspace(1.0, 6.0, 6)
    records = [
        make_draws(
            Condition(f"c{w:g}", load=w),
            channels=("displacement",),
            size=1000,
            A3=45.0 + 2.0 * w,
            A1=0.02 * 1.1**w,
        )
        for w in loads
    ]
    (design,) = designs([r.condition for r in records])
    found = population_of(design, records, np.random.SeedSequence(0))
    labels = found.coordinates.labels
    midpoint, span = labels.index("A3"), labels.index("ln A1")
    assert np.median(found.coefficients[:, 1, midpoint]) == pytest.approx(10.0, abs=0.1)
    assert np.median(found.coefficients[:, 1, span]) == pytest.approx(5.0 * np.log(1.1), abs=0.01)
    assert np.median(found.scatter[:, midpoint]) < 0.15, "a hundredth of the width of the transformation"
    assert not found.prior_led
    assert found.sampling.converged


def test_the_same_seed_gives_the_same_draws(make_draws: Callable[..., RecordDraws]) -> None:
    records = [
        make_draws(Condition(f"c{w}", load=w), channels=("displacement",), A3=45 + w) for w in (1, 2, 4)
    ]
    (design,) = designs([r.condition for r in records])
    one, two = (population_of(design, records, np.random.SeedSequence(7)) for _ in range(2))
    np.testing.assert_array_equal(one.coefficients, two.coefficients)
    assert one.prior_led
