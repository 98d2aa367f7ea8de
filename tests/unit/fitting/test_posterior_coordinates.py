"""Coordinates in which a posterior is nearly normal: there and back, with the right Jacobian."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from sma_bayes.fitting.noise_choice import noise_start
from sma_bayes.fitting.posterior import Posterior, build_posterior
from sma_bayes.fitting.posterior_coordinates import NoiseScaledCoordinates, PredictiveCoordinates
from sma_bayes.fitting.warm_start import warm_start
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.parameters.priors_file import parse_priors, read_priors
from sma_bayes.records.types import Record
from sma_bayes.sampling.adaptation import adapt
from sma_bayes.sampling.laplace import Mode, find_mode
from sma_bayes.sampling.proposals import Coordinates, PlainCoordinates, StudentMixture

ALL = ("force", "displacement", "stiffness")
CASES = [
    (("force", "displacement"), "independent"),
    (("force", "displacement"), "ar1"),
    (("stiffness",), "independent"),
    (("stiffness",), "ar1_time"),
    (("force",), "student_t"),
    (ALL, "ar1"),
]
EACH = pytest.mark.parametrize(("channels", "noise"), CASES, ids=[f"{'-'.join(c)}-{n}" for c, n in CASES])


def fitted(record: Record, noise: str) -> tuple[Posterior, Mode]:
    posterior = build_posterior([record], NOISE_MODELS[noise], read_priors("modified_sigmoid"))
    start = warm_start(posterior, np.random.default_rng(0))
    mode = find_mode(posterior, noise_start(posterior, start), posterior.space.prior_sd())
    assert mode is not None
    return posterior, mode


def maps(posterior: Posterior, mode: Mode) -> dict[str, Coordinates]:
    linearised = posterior.linearised(mode.z)
    predictive = PredictiveCoordinates.at(linearised)
    assert predictive is not None
    return {
        "predictive": predictive,
        "scaled": NoiseScaledCoordinates.about(linearised, PlainCoordinates()),
        "scaled predictive": NoiseScaledCoordinates.about(linearised, predictive),
    }


def around(mode: Mode, size: int, scale: float = 1.0) -> np.ndarray:
    root = np.linalg.cholesky(mode.covariance)
    return mode.z + scale * np.random.default_rng(1).standard_normal((size, mode.z.size)) @ root.T


@EACH
def test_there_and_back(make_record: Callable[..., Record], channels: tuple[str, ...], noise: str) -> None:
    posterior, mode = fitted(make_record(channels), noise)
    z = around(mode, 200)
    for name, coordinates in maps(posterior, mode).items():
        u, log_jacobian, back = coordinates.forward(z)
        assert back.mean() > 0.9, name
        again, log_again, found = coordinates.inverse(u[back])
        assert found.all(), name
        np.testing.assert_allclose(again, z[back], atol=1e-6 * posterior.space.prior_sd().max(), err_msg=name)
        np.testing.assert_allclose(log_again, log_jacobian[back], rtol=1e-5, atol=1e-5, err_msg=name)


def test_there_and_back_with_fewer_predictions_than_could_be_made(make_record: Callable[..., Record]) -> None:
    posterior, mode = fitted(make_record(("displacement",)), "student_t")
    every = PredictiveCoordinates.at(posterior.linearised(mode.z))
    fewer = PredictiveCoordinates.at(posterior.linearised(mode.z), 2)
    assert every is not None
    assert fewer is not None
    assert (every.scale.size, fewer.scale.size) == (4, 2)
    u, _, back = fewer.forward(around(mode, 200))
    assert back.all()
    again, _, found = fewer.inverse(u)
    assert found.all()
    np.testing.assert_allclose(again, around(mode, 200), atol=1e-6)


@EACH
def test_the_jacobian_is_that_of_finite_differences(
    make_record: Callable[..., Record], channels: tuple[str, ...], noise: str
) -> None:
    posterior, mode = fitted(make_record(channels), noise)
    d = mode.z.size
    step = 1e-4 * np.sqrt(np.diag(mode.covariance))
    for name, coordinates in maps(posterior, mode).items():
        for z in around(mode, 4, 0.7):
            _, log_jacobian, _ = coordinates.forward(z[None])
            up, down = (coordinates.forward(z + side * np.diag(step))[0] for side in (1, -1))
            matrix = (up - down) / (2.0 * step[:, None])
            assert matrix.shape == (d, d)
            sign, expected = np.linalg.slogdet(matrix)
            assert sign != 0
            assert log_jacobian[0] == pytest.approx(expected, abs=1e-3), name


@EACH
def test_points_beyond_reach_are_left_out_and_never_nan(
    make_record: Callable[..., Record], channels: tuple[str, ...], noise: str
) -> None:
    posterior, mode = fitted(make_record(channels), noise)
    prior = posterior.draw_prior(np.random.default_rng(2), 300)
    wild = 40.0 * posterior.space.prior_sd() * np.random.default_rng(7).standard_normal(prior.shape)
    far = np.concatenate([prior, wild])
    for name, coordinates in maps(posterior, mode).items():
        u, log_jacobian, back = coordinates.forward(far)
        assert np.isfinite(u[back]).all(), name
        assert np.isfinite(log_jacobian[back]).all(), name
        away = 100.0 * np.random.default_rng(3).standard_normal(far.shape)
        z, log_inverse, found = coordinates.inverse(away)
        assert np.isfinite(z[found]).all(), name
        assert np.isfinite(log_inverse[found]).all(), name


@EACH
def test_a_proposal_in_these_coordinates_integrates_to_one(
    make_record: Callable[..., Record], channels: tuple[str, ...], noise: str
) -> None:
    """Both ways: the reference over the proposal, and the proposal over the reference; five standard errors.

    40,000 draws of a t about the mode. What the map can't reach is missing from both.
    """
    posterior, mode = fitted(make_record(channels), noise)
    proposal = adapt(posterior, [mode], np.random.default_rng(4)).proposal
    z, log_q = proposal.draw(np.random.default_rng(5), 40_000)
    reachable = np.isfinite(log_q)
    np.testing.assert_allclose(proposal.log_density(z[reachable]), log_q[reachable], rtol=1e-6, atol=1e-6)
    reference = StudentMixture.from_covariances(np.ones(1), mode.z[None], 0.5 * mode.covariance[None], 10.0)
    ratio = np.zeros(len(z))
    ratio[reachable] = np.exp(reference.log_density(z[reachable]) - log_q[reachable])
    error = ratio.std() / np.sqrt(len(z))
    assert error < 0.06
    assert abs(ratio.mean() - 1.0) < 5.0 * error


def test_predictions_are_normal_where_parameters_are_a_banana(make_record: Callable[..., Record]) -> None:
    """Stiffness with A2 close to B2: importance efficiency in the coordinates that `adapt` chooses."""
    record = make_record(("stiffness",), A2=0.3, B2=0.303, A3=49.0, B3=51.0)
    posterior, mode = fitted(record, "independent")
    assert adapt(posterior, [mode], np.random.default_rng(6)).weights.efficiency > 0.5


def test_there_are_no_coordinates_without_parameters(make_record: Callable[..., Record]) -> None:
    text = 'schema = "sma-bayes/priors/1"\n'
    for name, value, unit in (("B1", 2.5, "N"), ("B2", 0.35, "1/degC"), ("B3", 52, "degC"), ("B4", 0.5, "N")):
        text += f'[both.{name}]\nfixed = {value}\nunit = "{unit}"\n'
    text += '[noise.sd]\nfamily = "half_normal"\nsd = 1.0\nunit = "N"\n'
    posterior = build_posterior(
        [make_record(("force",))], NOISE_MODELS["independent"], parse_priors(text, "fixed.toml")
    )
    assert PredictiveCoordinates.at(posterior.linearised(posterior.space.prior_centre())) is None
