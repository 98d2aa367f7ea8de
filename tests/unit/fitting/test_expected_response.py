"""Mean and variance of readings where the thermometer errs, and least squares on them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from sma_bayes.fitting.expected_response import Moments, fitted_moments
from sma_bayes.fitting.posterior import build_posterior
from sma_bayes.fitting.warm_start import warm_start
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.types import Record

DEFAULT = read_priors("modified_sigmoid")


@pytest.mark.parametrize("spread", [0.5, 3.0])
def test_moments_are_those_of_simulated_errors_and_the_jacobian_that_of_differences(
    make_record: Callable[..., Record], spread: float
) -> None:
    """200,000 errors: five standard errors, and 0.4 % of the range for what seven nodes leave."""
    record = make_record(n=11, temperature_sd=spread)
    p = build_posterior([record], NOISE_MODELS["independent"], DEFAULT)
    theta = p.space.constrain(p.space.prior_centre())[: len(p.model.parameter_names)]
    found = Moments.of(p, theta, record)
    size = 200_000
    t = record.temperature + spread * np.random.default_rng(1).standard_normal((size, record.n))
    simulated = p.model.predict(np.tile(theta, (1, 1)), {"temperature": t})
    for channel, y in simulated.items():
        leeway = 0.004 * np.ptp(found.mean[channel])
        sd = y.std(axis=0)
        assert np.all(np.abs(found.mean[channel] - y.mean(axis=0)) < 5.0 * sd / np.sqrt(size) + leeway)
        assert np.all(np.abs(np.sqrt(found.variance[channel]) - sd) < 5.0 * sd / np.sqrt(size) + leeway)
    for k in range(theta.size):
        step = np.zeros(theta.size)
        step[k] = 1e-6 * theta[k]
        up, down = (Moments.of(p, theta + s, record).mean for s in (step, -step))
        for channel in record.channels:
            np.testing.assert_allclose(
                found.jacobian[channel][:, k],
                (up[channel] - down[channel]) / (2.0 * step[k]),
                rtol=1e-5,
                atol=1e-7 * np.abs(found.jacobian[channel][:, k]).max() + 1e-12,
            )


def test_an_error_as_wide_as_the_transformation_flattens_least_squares_and_not_its_moments(
    make_record: Callable[..., Record],
) -> None:
    """Residuals about the expected response have its variance; about the plain curve they have not."""
    record = make_record(n=2000, noise=0.002, temperature_sd=5.0, span=(0.0, 100.0), seed=4)
    p = build_posterior([record], NOISE_MODELS["independent"], DEFAULT)
    start = warm_start(p, np.random.default_rng(0))
    (found,) = fitted_moments(p, start)
    for channel in record.channels:
        left = record.observed[channel] - found.mean[channel]
        felt = np.sqrt(found.variance[channel])
        loud = felt > 0.02 * np.ptp(found.mean[channel])
        assert np.std(left[loud] / felt[loud]) == pytest.approx(1.0, abs=0.1)
        plain = start.residual[0][channel][loud]
        slope = np.abs(p.model.slope(start.theta, record.inputs)[channel][loud])
        assert abs(np.std(plain / (5.0 * slope)) - 1.0) > 0.15


def test_without_a_declared_error_it_is_the_warm_start(make_record: Callable[..., Record]) -> None:
    record = make_record(n=50)
    p = build_posterior([record], NOISE_MODELS["independent"], DEFAULT)
    start = warm_start(p, np.random.default_rng(0))
    (found,) = fitted_moments(p, start)
    for channel in record.channels:
        np.testing.assert_allclose(record.observed[channel] - found.mean[channel], start.residual[0][channel])
        assert not found.variance[channel].any()
