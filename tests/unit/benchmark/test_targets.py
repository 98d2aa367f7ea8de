"""Every sampler of the benchmark is given the same posterior, written anew for it."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest
from benchmark.gradient_posterior import Form, log_prob, numbers
from benchmark.kernels import KERNELS
from benchmark.nested_samplers import cube, log_likelihood
from benchmark.problems import Case, Problem
from scipy.special import erf

EACH = pytest.mark.parametrize("noise", ["independent", "ar1"])
CHANNELS = pytest.mark.parametrize("channels", ["S", "FX"])


def problem_of(channels: str, noise: str) -> Problem:
    return Problem.of(Case(channels, noise, 40).records()[0], noise)


@EACH
@CHANNELS
def test_what_is_compiled_is_the_posterior_of_the_package(channels: str, noise: str) -> None:
    """With numpy in the place of JAX or PyTensor; the record is filled up with samples of weight zero."""
    problem = problem_of(channels, noise)
    form, data = Form.of(problem.posterior), numbers(problem.posterior, 64)
    z = problem.starts(np.random.default_rng(0), 30, "laplace")
    found = [float(log_prob(np, erf, form, x, data)) for x in z]
    np.testing.assert_allclose(found, problem.posterior.log_prob(z), rtol=1e-10, atol=1e-8)


@EACH
@CHANNELS
def test_kernels_agree_with_numpy(channels: str, noise: str) -> None:
    problem = problem_of(channels, noise)
    z = problem.starts(np.random.default_rng(0), 30, "laplace")
    for name, make in KERNELS.items():
        if importlib.util.find_spec(name) is None:
            continue
        np.testing.assert_allclose(
            make(problem.posterior)(z), problem.posterior.log_prob(z), rtol=1e-10, atol=1e-8, err_msg=name
        )


@EACH
@CHANNELS
def test_nested_samplers_are_given_the_same_prior_and_likelihood(channels: str, noise: str) -> None:
    problem = problem_of(channels, noise)
    posterior, priors = problem.posterior, [p.prior for p in problem.posterior.space.free]
    u = np.random.default_rng(0).uniform(size=(20, problem.dimension))
    mirrored = np.where([getattr(p, "sign", 1.0) < 0.0 for p in priors], 1.0 - u, u)
    by_quantiles = [p.transform.unconstrain(p.quantile(mirrored[:, i])) for i, p in enumerate(priors)]
    transform = cube(problem)
    np.testing.assert_allclose(transform(u), np.stack(by_quantiles, axis=1), rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(transform(u[0]), transform(u)[0])
    z = problem.starts(np.random.default_rng(0), 20, "laplace")
    found = [log_likelihood(problem)(x) for x in z]
    np.testing.assert_allclose(found, posterior.log_likelihood(posterior.space.constrain(z)), rtol=1e-10)


def test_another_target_is_refused() -> None:
    problem = problem_of("FX", "independent")
    problem.check(lambda z: float(problem.posterior.log_prob(z)[0]) + 3.0)  # a constant does not matter
    with pytest.raises(ValueError, match="another target"):
        problem.check(lambda z: float(problem.posterior.log_prob(z)[0]) * (1.0 + 1e-6))
