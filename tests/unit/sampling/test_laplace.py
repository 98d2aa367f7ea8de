"""Climbing to a mode without derivatives, and the Laplace approximation there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.optimize import minimize

from sma_bayes.fitting.abilities import LinearisedPosterior
from sma_bayes.fitting.noise_choice import noise_start
from sma_bayes.fitting.posterior import build_posterior
from sma_bayes.fitting.warm_start import warm_start
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.types import Record
from sma_bayes.sampling.laplace import (
    CLIMB_TOLERANCE,
    NEGLIGIBLE_LOG_MASS,
    Mode,
    distinct_modes,
    find_mode,
    find_modes,
)


@dataclass
class Density:
    """A density from a function of rows."""

    log_prob: Callable[[np.ndarray], np.ndarray]
    names: tuple[str, ...] = ()

    def draw_prior(self, rng: np.random.Generator, size: int) -> np.ndarray:
        raise AssertionError("climbing draws nothing")


def gaussian(covariance: np.ndarray, mean: np.ndarray) -> Density:
    precision = np.linalg.inv(covariance)
    return Density(lambda z: -0.5 * np.einsum("wi,ij,wj->w", z - mean, precision, z - mean))


@pytest.mark.parametrize("d", [1, 2, 7, 12])
@pytest.mark.parametrize("anisotropy", [1.0, 1e3])
def test_a_gaussian_is_its_own_laplace_approximation(d: int, anisotropy: float) -> None:
    rng = np.random.default_rng(d)
    q, _ = np.linalg.qr(rng.standard_normal((d, d)))
    covariance = (q * np.geomspace(1.0 / anisotropy, 1.0, d) ** 2) @ q.T
    mean = rng.standard_normal(d)
    mode = find_mode(gaussian(covariance, mean), mean + 2.0 * rng.standard_normal(d), np.full(d, 3.0))
    assert mode is not None
    root = np.linalg.cholesky(covariance)
    assert np.linalg.norm(np.linalg.solve(root, mode.z - mean)) < 0.2
    relative = np.linalg.solve(root, np.linalg.solve(root, mode.covariance).T)
    np.testing.assert_allclose(relative, np.eye(d), atol=0.05)
    assert mode.evaluations > 0


@pytest.mark.parametrize("noise", ["independent", "ar1"])
def test_the_ridge_of_stiffness_alone_is_climbed_in_a_few_steps(
    make_record: Callable[..., Record], noise: str
) -> None:
    """Against scipy's BFGS in the principal axes of the Hessian that is found.

    Widths differ by thousands in directions that no axis has: differences along the axes saw only the narrow ones.
    """
    posterior = build_posterior(
        [make_record(("stiffness",))], NOISE_MODELS[noise], read_priors("modified_sigmoid")
    )
    start = noise_start(posterior, warm_start(posterior, np.random.default_rng(0)))
    mode = find_mode(posterior, start, posterior.space.prior_sd())
    assert mode is not None
    assert mode.evaluations < 600
    root = np.linalg.cholesky(mode.covariance)

    def deviance(u: np.ndarray) -> float:
        return -float(posterior.log_prob((mode.z + root @ u)[None])[0])

    best = minimize(deviance, np.zeros(start.size), method="BFGS", options={"gtol": 1e-4})
    assert mode.log_prob > -best.fun - 0.01
    d = start.size
    h = 0.05
    steps = h * np.eye(d)
    hessian = [
        [
            (deviance(a + b) - deviance(a - b) - deviance(b - a) + deviance(-a - b)) / (4.0 * h * h)
            for b in steps
        ]
        for a in steps
    ]
    np.testing.assert_allclose(hessian, np.eye(d), atol=0.1)


def test_a_flat_direction_is_no_wider_than_three_priors() -> None:
    mode = find_mode(Density(lambda z: -0.5 * z[:, 0] ** 2), np.array([1.0, 0.5]), np.array([1.0, 2.0]))
    assert mode is not None
    np.testing.assert_allclose(np.sqrt(np.diag(mode.covariance)), [1.0, 6.0], rtol=1e-3)


def test_it_climbs_out_of_a_saddle_and_around_a_bend() -> None:
    def banana(z: np.ndarray) -> np.ndarray:
        return -0.5 * z[:, 0] ** 2 - 0.5 * ((z[:, 1] - z[:, 0] ** 2) / 0.1) ** 2

    mode = find_mode(Density(banana), np.array([3.0, 1.0]), np.array([3.0, 3.0]), steps=100)
    assert mode is not None
    np.testing.assert_allclose(mode.z, [0.0, 0.0], atol=0.2)


def test_a_start_of_no_probability_has_no_mode() -> None:
    density = Density(lambda z: np.where(z[:, 0] > 0.0, -z[:, 0], -np.inf))
    assert find_mode(density, np.array([-1.0]), np.ones(1)) is None


def test_an_edge_does_not_break_the_climb() -> None:
    density = Density(lambda z: np.where(z[:, 0] > 0.0, -0.5 * (z[:, 0] - 0.001) ** 2, -np.inf))
    mode = find_mode(density, np.array([2.0]), np.ones(1))
    assert mode is not None
    assert mode.z[0] > 0.0
    assert np.isfinite(mode.covariance).all()


def test_climbs_at_once_are_those_of_each_start_alone() -> None:
    """To rounding, in fewer calls; one begins where there is no density."""
    calls = []

    def log_prob(z: np.ndarray) -> np.ndarray:
        calls.append(len(z))
        inside = np.cos(3.0 * z).sum(axis=1) - 0.1 * (z**2).sum(axis=1)
        return np.where(z[:, 0] < 5.0, inside, -np.inf)

    starts = [np.array([0.4, -1.9]), np.array([6.0, 0.0]), np.array([3.5, 2.2])]
    width = np.full(2, 2.0)
    alone = [find_mode(Density(log_prob), start, width) for start in starts]
    one_by_one, longest = len(calls), max(m.evaluations for m in alone if m is not None)
    calls.clear()
    together = find_modes(Density(log_prob), starts, width)
    assert len(calls) < one_by_one
    assert sum(calls) > longest
    assert [m is None for m in together] == [m is None for m in alone] == [False, True, False]
    for a, b in zip(together, alone, strict=True):
        if a is not None and b is not None:
            np.testing.assert_allclose(a.z, b.z, rtol=1e-9)
            np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-9)
            assert (a.log_prob, a.evaluations) == (pytest.approx(b.log_prob), b.evaluations)


def test_the_climb_never_goes_down() -> None:
    rng = np.random.default_rng(0)
    density = Density(lambda z: np.cos(3.0 * z).sum(axis=1) - 0.1 * (z**2).sum(axis=1))
    for start in rng.uniform(-4.0, 4.0, (20, 3)):
        mode = find_mode(density, start, np.full(3, 2.0))
        assert mode is not None
        assert mode.log_prob >= float(density.log_prob(start[None])[0])
        assert np.all(np.linalg.eigvalsh(mode.covariance) > 0.0)


def test_a_good_start_takes_one_step_where_the_response_is_nearly_linear(
    make_record: Callable[..., Record],
) -> None:
    """And leaves no more to climb than it may, against BFGS in the principal axes."""
    posterior = build_posterior(
        [make_record(("force", "displacement"))], NOISE_MODELS["independent"], read_priors("modified_sigmoid")
    )
    start = noise_start(posterior, warm_start(posterior, np.random.default_rng(0)))
    d = start.size
    mode = find_mode(posterior, start, posterior.space.prior_sd())
    assert mode is not None
    assert mode.evaluations == 1 + 2 * d + d * (d - 1) + 10
    root = np.linalg.cholesky(mode.covariance)

    def deviance(u: np.ndarray) -> float:
        return -float(posterior.log_prob((mode.z + root @ u)[None])[0])

    best = minimize(deviance, np.zeros(d), method="BFGS", options={"gtol": 1e-4})
    assert mode.log_prob > -best.fun - CLIMB_TOLERANCE


def test_the_information_is_the_hessian_where_residuals_are_small(make_record: Callable[..., Record]) -> None:
    """Of the model's parameters, at the mode: what it leaves out is of the size of residuals times curvature."""
    posterior = build_posterior(
        [make_record(("force", "displacement"))], NOISE_MODELS["independent"], read_priors("modified_sigmoid")
    )
    start = noise_start(posterior, warm_start(posterior, np.random.default_rng(0)))
    mode = find_mode(posterior, start, posterior.space.prior_sd())
    assert mode is not None
    root = np.linalg.cholesky(mode.covariance)
    ratio = root.T @ posterior.linearised(mode.z).information() @ root
    np.testing.assert_allclose(ratio, np.eye(start.size), atol=0.2)


def test_a_start_on_a_ridge_that_rounding_makes_singular_is_climbed_from(
    make_record: Callable[..., Record], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Steep beyond all measure in one direction, at an estimate far out, the prior's part is lost in the sum."""
    posterior = build_posterior(
        [make_record(("stiffness",))], NOISE_MODELS["independent"], read_priors("modified_sigmoid")
    )
    start = noise_start(posterior, warm_start(posterior, np.random.default_rng(0)))
    straight = find_mode(posterior, start, posterior.space.prior_sd())
    ridge = np.zeros((start.size, start.size))
    ridge[:2, :2] = 1e20
    monkeypatch.setattr(LinearisedPosterior, "information", lambda _: ridge.copy())
    mode = find_mode(posterior, start, posterior.space.prior_sd())
    assert mode is not None
    assert straight is not None
    assert mode.log_prob == pytest.approx(straight.log_prob, abs=0.02)


def test_modes_are_kept_once_best_first_unless_without_mass() -> None:
    """By the log of their volume, too: the lower of two is the better where it is wide enough."""

    def at(x: float, log_prob: float, sd: float = 1.0) -> Mode:
        return Mode(np.array([x, 0.0]), log_prob, sd**2 * np.eye(2), 1)

    narrow, wide = at(0.0, 0.0), at(9.0, -1.0, 2.0)
    again, faint = at(0.1, -0.1), at(-9.0, -NEGLIGIBLE_LOG_MASS - 1.0)
    assert distinct_modes([again, faint, narrow, wide]) == (wide, narrow)
    assert distinct_modes([faint]) == (faint,)
    assert distinct_modes([]) == ()
