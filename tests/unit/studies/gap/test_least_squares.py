"""Least squares with the covariance of what is left: against dense matrices."""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.studies.gap.density import HypothesisDensity
from sma_bayes.studies.gap.fitting import fit_hypothesis
from sma_bayes.studies.gap.least_squares import least_squares_of, readings_as_one, sandwich
from sma_bayes.studies.gap.memory_likelihood import noise_as_it_is
from sma_bayes.studies.gap.noise import BlockNoise


@pytest.fixture(scope="module")
def wave(make_line, added):
    """A line with a wave on top, and noise of a long memory."""
    line = make_line(phi=0.9, n=40, seed=3)
    hypothesis = line.hypothesis.extended(added("wave", lambda v: np.sin(0.05 * v["order"]), 0.7))
    return fit_hypothesis(hypothesis, np.append(line.prior_mean, 0.0), line.noise)


def test_columns_are_spread_as_the_covariance_says(make_line) -> None:
    line = make_line(phi=0.8)
    columns = np.random.default_rng(1).standard_normal((line.y.size, 4))
    start = 0
    for own in line.noise:
        at = slice(start, start + own.memory.size)
        start = at.stop
        spread = own.spread(columns[at])
        dense = columns[at].T @ line.covariance[at, at] @ columns[at]
        np.testing.assert_allclose(spread.T @ spread, dense, rtol=1e-10)


def test_what_is_left_is_as_large_and_as_lasting_as_it_is(wave) -> None:
    """By the normal density of the whole series: no other memory that is tried makes it more likely."""
    block = wave.blocks[0]
    found = noise_as_it_is(wave.residual[block.at], block)

    def value(memory: float) -> float:
        own = BlockNoise(1.0, np.where(block.first, 0.0, memory))
        sd = np.sqrt(np.mean(own.whiten(wave.residual[block.at]) ** 2))
        own = BlockNoise(float(sd), own.memory)
        return float(-0.5 * np.sum(own.whiten(wave.residual[block.at]) ** 2) - own.log_scale)

    likeliest = float(found.memory.max())
    assert likeliest > 0.6
    assert all(value(likeliest) >= value(m) for m in (0.0, 0.3, 0.5, 0.95, 0.99))


def test_the_sandwich_is_that_of_dense_matrices(wave, covariance_of) -> None:
    plain, alike = least_squares_of(wave)
    white = fit_hypothesis(plain.hypothesis, plain.z, tuple(BlockNoise(n.sd, n.memory) for n in plain.noise))
    sds = np.concatenate(
        [np.full(b.first.size, n.sd) for b, n in zip(white.blocks, white.noise, strict=True)]
    )
    misfit = covariance_of([noise_as_it_is(white.residual[b.at], b) for b in white.blocks])
    j = white.jacobian
    prior = white.precision - j.T @ j
    inverse = np.linalg.inv(white.precision)
    white_misfit = misfit / np.outer(sds, sds)
    left = np.eye(len(j)) - j @ inverse @ j.T  # of a series, once the parameters have adapted
    larger = np.trace(white_misfit) / np.trace(left @ white_misfit @ left)
    dense = inverse @ (prior + larger * j.T @ white_misfit @ j) @ inverse
    np.testing.assert_allclose(sandwich(white), dense, rtol=1e-8)
    assert readings_as_one(white) == pytest.approx(dense[3, 3] / inverse[3, 3], rel=1e-8)
    assert alike == pytest.approx(readings_as_one(white), rel=1e-3)
    assert alike > 2.0


def test_readings_that_count_as_one_flatten_the_likelihood(wave) -> None:
    """The density is the prior and a root of the likelihood with its sd integrated out, and curves so at the mode."""
    plain, alike = least_squares_of(wave)
    whole, root = HypothesisDensity(plain), HypothesisDensity(plain, alike)
    z = plain.z + np.random.default_rng(2).standard_normal((5, 4)) * np.sqrt(np.diag(plain.covariance))
    prior = plain.hypothesis.space.log_prior(z)
    scaled = prior + (whole.log_prob(z) - prior) / alike
    np.testing.assert_allclose(root.log_prob(z) - root.log_prob(z)[0], scaled - scaled[0], rtol=1e-9)
    step = 0.05 * np.sqrt(plain.covariance[3, 3])
    up, at, down = root.log_prob(plain.z + step * np.array([[0, 0, 0, 1.0], [0, 0, 0, 0], [0, 0, 0, -1.0]]))
    curvature = 1.0 / 0.7**2
    for block in plain.blocks:
        r, slope = plain.residual[block.at], wave_of(plain)[block.at]
        squares = float(r @ r)
        curvature += r.size / alike * (slope @ slope / squares - 2.0 * (slope @ r) ** 2 / squares**2)
    assert -(up - 2.0 * at + down) / step**2 == pytest.approx(curvature, rel=0.01)
    assert curvature == pytest.approx(plain.precision[3, 3], rel=0.15)


def wave_of(fitted) -> np.ndarray:
    """The column of the wave."""
    return np.concatenate([np.sin(0.05 * h.inputs["order"]) for h in fitted.hypothesis.histories])


def test_white_residuals_count_one_by_one(make_line, added) -> None:
    line = make_line(phi=0.0, n=60)
    hypothesis = line.hypothesis.extended(added("wave", lambda v: np.sin(0.05 * v["order"]), 0.7))
    fitted = fit_hypothesis(hypothesis, np.append(line.prior_mean, 0.0), line.noise)
    plain, alike = least_squares_of(fitted)
    assert 1.0 <= alike < 1.7
    np.testing.assert_allclose(plain.z, fitted.z, atol=0.5 * np.sqrt(fitted.covariance[3, 3]))
