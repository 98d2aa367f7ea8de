"""Every sampler of the benchmark is given the same posterior, written anew for it."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest
from benchmark.gradient_posterior import Form, log_prob, numbers
from benchmark.kernels import KERNELS
from benchmark.peers import check
from benchmark.problems import Case, Problem

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
    found = [float(log_prob(np, form, x, data)) for x in z]
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


def test_another_target_is_refused() -> None:
    problem = problem_of("FX", "independent")
    check(problem, lambda z: float(problem.posterior.log_prob(z)[0]) + 3.0)  # a constant does not matter
    with pytest.raises(ValueError, match="another target"):
        check(problem, lambda z: float(problem.posterior.log_prob(z)[0]) * (1.0 + 1e-6))
