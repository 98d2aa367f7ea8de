"""Modes and evidence against scipy and against integrals in closed form."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy.optimize import least_squares

from sma_bayes.arrays import Floats
from sma_bayes.effects import EFFECTS
from sma_bayes.parameters.distributions import Normal
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.history import histories
from sma_bayes.studies.gap.fitting import added_by, fit_hypothesis, fit_with_noise, held_at
from sma_bayes.studies.gap.hypothesis import baseline
from sma_bayes.studies.gap.noise import BlockNoise, blocks_of

CLOSE = 0.01
"""Log posterior [nats] by which a mode may fall short: what is lost by stopping early."""


def test_the_mode_is_that_of_least_squares(rig, covariance_of) -> None:
    """Whitening by Cholesky, Eq. (2) by a hyperbolic tangent, priors by hand; trust-region least squares."""
    campaign = rig(periods=(60.0,), loads=(1.0,), memory=0.5, sd=0.02).campaign()
    hypothesis = baseline(campaign, histories(campaign), read_priors("modified_sigmoid"), pooled=True)
    first = fit_with_noise(hypothesis, hypothesis.space.prior_centre())
    root = np.linalg.cholesky(covariance_of(first.noise))
    v, y = hypothesis.histories[0].inputs, hypothesis.histories[0].observed["displacement"]
    priors = [p.prior for p in hypothesis.space.parameters]
    gaussian = [
        (p.mean, p.sd, None) if isinstance(p, Normal) else (np.log(p.median), p.sigma, p.sign) for p in priors
    ]

    def curve(z: Floats) -> Floats:
        theta = [x if sign is None else sign * np.exp(x) for x, (_, _, sign) in zip(z, gaussian, strict=True)]
        heating, cooling = (
            d + a * 0.5 * (1.0 + np.tanh(0.5 * b * (v["temperature"] - c)))
            for a, b, c, d in (theta[:4], theta[4:])
        )
        return np.where(v["branch"] > 0.0, heating, cooling)

    def misfit(z: Floats) -> Floats:
        pull = [(x - m) / s for x, (m, s, _) in zip(z, gaussian, strict=True)]
        return np.concatenate([np.linalg.solve(root, y - curve(z)), pull])

    exact = least_squares(misfit, first.z, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    start = first.z + 0.3 * hypothesis.space.prior_sd() * np.array([1, -1, 1, -1, -1, 1, 1, -1])
    found = fit_hypothesis(hypothesis, start, first.noise)
    assert 0.5 * np.sum(misfit(found.z) ** 2) - exact.cost < CLOSE
    sd = np.sqrt(np.diag(np.linalg.inv(exact.jac.T @ exact.jac)))
    np.testing.assert_allclose((found.z - exact.x) / sd, 0.0, atol=np.sqrt(2.0 * CLOSE))
    np.testing.assert_allclose(
        found.precision, exact.jac.T @ exact.jac, rtol=0.02, atol=0.02 * np.min(sd**-2.0)
    )
    np.testing.assert_allclose(found.whitened, misfit(found.z)[: y.size], atol=1e-8)


@pytest.mark.parametrize(("memory", "samples", "seed"), [(0.5, 100, 2), (0.8, 100, 0), (0.8, 40, 2)])
def test_a_fit_with_its_noise_is_at_the_mode_that_this_noise_has(rig, memory, samples, seed) -> None:
    """Phases with slopes beside a sigmoid: noise of short and of long memory may follow each other for ever.

    Were the model not at its mode, any effect would gain what it lacks.
    """

    def sloped(x: Floats, rising: Floats) -> Floats:
        return 1.0 / (1.0 + np.exp(-x)) + 0.01 * x

    one_sweep = rig(
        cycles=1, samples=samples, shape=sloped, sd=0.005, memory=memory, seed=seed, periods=(60.0,)
    ).campaign()
    hypothesis = baseline(one_sweep, histories(one_sweep), read_priors("modified_sigmoid"), pooled=True)
    found = fit_with_noise(hypothesis, hypothesis.space.prior_centre())
    assert fit_hypothesis(hypothesis, found.z, found.noise).ln_evidence - found.ln_evidence < CLOSE


def solved(line) -> Floats:
    """Mode of a linear hypothesis, from the normal equations."""
    inverse = np.linalg.inv(line.covariance)
    gram = line.x.T @ inverse @ line.x + np.diag(line.prior_sd**-2.0)
    return np.linalg.solve(gram, line.x.T @ inverse @ line.y + line.prior_mean / line.prior_sd**2)


def test_evidence_of_a_linear_hypothesis_is_its_integral(make_line) -> None:
    line = make_line()
    z = solved(line)
    exact = line.log_evidence()
    assert held_at(line.hypothesis, z, line.noise).ln_evidence == pytest.approx(exact, abs=1e-5)
    found = fit_hypothesis(line.hypothesis, line.prior_mean + 5.0 * line.prior_sd, line.noise)
    assert found.ln_evidence == pytest.approx(exact, abs=CLOSE)
    spread = np.sqrt(np.diag(found.covariance))
    np.testing.assert_allclose((found.z - z) / spread, 0.0, atol=0.05)


def test_what_the_parameters_absorb(make_line) -> None:
    """By Woodbury's identity what is left is ``(1 + J S J')^-1``, S the covariance of the prior."""
    line = make_line(prior_sd=(0.1, 3.0, 0.2))
    found = fit_hypothesis(line.hypothesis, line.prior_mean, line.noise)
    j = np.linalg.solve(np.linalg.cholesky(line.covariance), line.x)
    np.testing.assert_allclose(found.jacobian, j, atol=1e-7 * np.max(np.abs(j)))
    exact = np.linalg.inv(np.eye(line.y.size) + j @ np.diag(line.prior_sd**2) @ j.T)
    np.testing.assert_allclose(found.project_out(np.eye(line.y.size)), exact, atol=1e-6)


def test_masked_samples_do_not_exist(make_line) -> None:
    line = make_line(phi=0.0)
    sizes = [h.n for h in line.hypothesis.histories]
    kept = np.random.default_rng(1).random(line.y.size) < 0.6
    masks = np.split(kept, np.cumsum(sizes)[:-1])
    part = line.hypothesis.on(masks)
    noise = tuple(BlockNoise(n.sd, n.memory[m]) for n, m in zip(line.noise, masks, strict=True))
    found = fit_hypothesis(part, line.prior_mean, noise)
    assert found.whitened.size == kept.sum()
    assert found.ln_evidence == pytest.approx(line.log_evidence(kept=kept), abs=CLOSE)


def test_of_a_history_without_samples_nothing_is_left(make_line) -> None:
    line = make_line()
    first, second = line.hypothesis.histories
    part = line.hypothesis.on([np.zeros(first.n, dtype=bool), np.ones(second.n, dtype=bool)])
    assert [h.condition.id for h in part.histories] == [second.condition.id]
    kept = np.arange(line.y.size) >= first.n
    found = fit_hypothesis(part, line.prior_mean, line.noise[1:])
    assert found.ln_evidence == pytest.approx(line.log_evidence(kept=kept), abs=CLOSE)


def test_many_parameter_vectors_are_as_many_single_ones(rig) -> None:
    campaign = rig(periods=(60.0, 30.0), channels=("displacement", "force"), samples=12).campaign()
    hypothesis = baseline(campaign, histories(campaign), read_priors("modified_sigmoid"), pooled=True)
    fitted = fit_with_noise(hypothesis, hypothesis.space.prior_centre())
    z = fitted.z + 0.1 * np.random.default_rng(0).standard_normal((5, fitted.z.size))
    found = fitted.residual_at(z)
    assert found.shape == (5, sum(h.n * 2 for h in hypothesis.histories))
    for row, one in zip(found, z, strict=True):
        np.testing.assert_allclose(row, fitted.residual_at(one), rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(fitted.residual_at(fitted.z), fitted.residual, rtol=1e-13, atol=1e-15)


def test_what_an_effect_adds_is_counted_beside_the_others(make_line, added) -> None:
    """Effects that add a multiple of a column each: the multiple, for every vector of parameters."""
    line = make_line()
    first, second = added("wave", lambda v: np.sin(v["order"])), added("ramp", lambda v: v["order"] / 40.0)
    both = line.hypothesis.with_effects([first, second])
    theta = np.random.default_rng(0).standard_normal((4, len(both.space.parameters)))
    blocks = blocks_of(both)
    for effect, size in ((first, theta[:, -2]), (second, theta[:, -1])):
        column = np.concatenate([effect.column(h.inputs) for h in both.histories])
        np.testing.assert_allclose(
            added_by(effect, both, blocks, theta), size[:, None] * column, rtol=0.0, atol=1e-12
        )


def test_a_fit_pickles(rig) -> None:
    """By the pickle of the standard library, effects and scales included, and it goes on working."""
    campaign = rig(periods=(60.0,), loads=(1.0,), samples=16).campaign()
    hypothesis = baseline(campaign, histories(campaign), read_priors("modified_sigmoid"), pooled=True)
    fitted = fit_with_noise(hypothesis.extended(EFFECTS["thermocouple_lag"]), np.zeros(11))
    again = pickle.loads(pickle.dumps(fitted))
    np.testing.assert_array_equal(again.residual_at(again.z), fitted.residual_at(fitted.z))
    np.testing.assert_array_equal(again.left, fitted.left)
    more = again.hypothesis.extended(EFFECTS["training_drift"])
    assert more.space.names == fitted.hypothesis.extended(EFFECTS["training_drift"]).space.names
