"""The density that is sampled against integrals over the noise, and draws against quadrature."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import multivariate_normal

from sma_bayes.errors import ResumeError
from sma_bayes.sampling.convergence import Target
from sma_bayes.studies.gap.density import HypothesisDensity, sample_hypothesis
from sma_bayes.studies.gap.fitting import fit_hypothesis


def test_the_scale_of_the_noise_is_integrated_out(make_line) -> None:
    """Against ``integral of N(y; mu, s**2 R) ds/s``, block by block, by adaptive quadrature."""
    line = make_line(phi=0.7)
    fitted = fit_hypothesis(line.hypothesis, line.prior_mean, line.noise)
    points = fitted.z + np.array([[0.0, 0.0, 0.0], [0.3, -0.2, 0.1], [-1.0, 2.0, 0.5]])
    exact = []
    for z in points:
        r = line.y - line.x @ z
        value = -0.5 * float(np.sum(((z - line.prior_mean) / line.prior_sd) ** 2))
        for block, noise in zip(fitted.blocks, fitted.noise, strict=True):
            shape = line.covariance[block.at, block.at] / noise.sd**2
            part, n = r[block.at], block.first.size
            q = float(part @ np.linalg.solve(shape, part))
            peak = np.sqrt(q / n)

            def density(u: float, q: float = q, n: int = n, peak: float = peak) -> float:
                return float(np.exp(-n * u - 0.5 * q * (np.exp(-u) / peak) ** 2 + 0.5 * n))

            value += (
                np.log(quad(density, -3.0, 3.0, epsabs=0.0, epsrel=1e-10)[0]) - n * np.log(peak) - 0.5 * n
            )
        exact.append(value)
    found = HypothesisDensity(fitted).log_prob(points)
    np.testing.assert_allclose(found - found[0], np.array(exact) - exact[0], atol=1e-7)


def test_many_parameter_vectors_are_each_alone(make_line) -> None:
    line = make_line()
    density = HypothesisDensity(fit_hypothesis(line.hypothesis, line.prior_mean, line.noise))
    z = density.draw_prior(np.random.default_rng(0), 3000)
    assert z.shape == (3000, 3)
    some = [0, 1091, 1093, 2999]
    np.testing.assert_allclose(
        density.log_prob(z)[some], [density.log_prob(z[i])[0] for i in some], rtol=1e-12
    )
    broken = z[:2].copy()
    broken[0, 0] = np.inf
    assert density.log_prob(broken)[0] == -np.inf


@pytest.fixture(scope="module")
def two_effects(make_line, added):
    """Only the sizes of two effects are free; measurements are few, so that the noise is not well known."""
    line = make_line(n=5, phi=0.3)
    space = replace(
        line.hypothesis.space,
        parameters=tuple(
            replace(p, fixed=float(m))
            for p, m in zip(line.hypothesis.space.parameters, line.prior_mean, strict=True)
        ),
    )
    effects = [
        added("first", lambda v: np.sin(v["order"]), 0.5),
        added("second", lambda v: np.sin(v["order"] + 0.7) ** 3, 0.4),
    ]
    hypothesis = replace(line.hypothesis, space=space).with_effects(effects)
    columns = [np.concatenate([e.column(h.inputs) for h in hypothesis.histories]) for e in effects]
    x = np.stack(columns, axis=1)
    rng = np.random.default_rng(7)
    noise = np.linalg.cholesky(line.covariance) @ rng.standard_normal(len(x))
    y = line.x @ line.prior_mean + x @ [0.4, -0.3] + noise
    parts = np.split(y, [hypothesis.histories[0].n])
    seen = tuple(
        replace(h, observed={"displacement": p}) for h, p in zip(hypothesis.histories, parts, strict=True)
    )
    return replace(hypothesis, histories=seen), line, x, y - line.x @ line.prior_mean


def test_draws_agree_with_quadrature(two_effects) -> None:
    """Moments of two effects on a grid, the likelihood of each block that of Student's t, as textbooks have it.

    With 2500 effective draws or more, means are known to 0.02 sd, sds to 1.5 %, the correlation to 0.02: tolerances
    are 4 of these.
    """
    hypothesis, line, x, r = two_effects
    fitted = fit_hypothesis(hypothesis, np.zeros(2), line.noise)
    assert HypothesisDensity(fitted).names == ("first.a", "second.a")
    draws = sample_hypothesis(fitted, np.random.SeedSequence(3), Target(ess=2500.0))
    assert draws.convergence.converged
    z = draws.z.reshape(-1, 2)

    sd = np.sqrt(np.diag(fitted.covariance))
    axes = [m + s * np.linspace(-8.0, 8.0, 321) for m, s in zip(fitted.z, sd, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    logp = multivariate_normal(np.zeros(2), np.diag([0.5**2, 0.4**2])).logpdf(points)
    for block in fitted.blocks:
        root = np.linalg.cholesky(line.covariance[block.at, block.at])
        w = np.linalg.solve(root, (r[:, None] - x @ points.T)[block.at])
        logp -= 0.5 * len(root) * np.log(np.sum(w**2, axis=0))
    weight = np.exp(logp - logp.max())
    weight /= weight.sum()
    mean = weight @ points
    covariance = (points - mean).T @ ((points - mean) * weight[:, None])
    exact = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose((z.mean(axis=0) - mean) / exact, 0.0, atol=0.08)
    np.testing.assert_allclose(z.std(axis=0) / exact, 1.0, atol=0.06)
    assert np.corrcoef(z.T)[0, 1] == pytest.approx(covariance[0, 1] / np.prod(exact), abs=0.08)


MANY = Target(ess=20_000.0)
"""Draws that take several blocks."""


class Killed(Exception):
    """In place of a signal."""


def test_sampling_that_was_interrupted_goes_on_to_the_same_bits(two_effects, tmp_path, monkeypatch) -> None:
    hypothesis, line, _, _ = two_effects
    fitted = fit_hypothesis(hypothesis, np.zeros(2), line.noise)
    calls = 0

    def counted(density: HypothesisDensity, z: np.ndarray) -> np.ndarray:
        nonlocal calls
        calls += 1
        if calls == stop:
            raise Killed
        return plain(density, z)

    plain = HypothesisDensity.log_prob
    monkeypatch.setattr(HypothesisDensity, "log_prob", counted)
    monkeypatch.setattr("sma_bayes.sampling.checkpoint.HELD_BACK_S", 0.0)
    stop = -1
    whole = sample_hypothesis(fitted, np.random.SeedSequence(5), MANY)
    needed, calls, stop = calls, 0, calls - 1
    with pytest.raises(Killed):
        sample_hypothesis(fitted, np.random.SeedSequence(5), MANY, checkpoint=tmp_path / "gap.h5")
    calls, stop = 0, -1
    again = sample_hypothesis(fitted, np.random.SeedSequence(5), MANY, checkpoint=tmp_path / "gap.h5")
    np.testing.assert_array_equal(again.z, whole.z)
    assert again.evaluations == whole.evaluations
    assert calls < needed
    with pytest.raises(ResumeError):
        sample_hypothesis(
            replace(fitted, z=fitted.z + 1e-9),
            np.random.SeedSequence(5),
            MANY,
            checkpoint=tmp_path / "gap.h5",
        )
