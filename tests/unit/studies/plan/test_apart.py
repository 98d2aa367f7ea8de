"""Telling explanations apart: closed forms against simulated measurements."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from sma_bayes.effects import EFFECTS
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.history import histories
from sma_bayes.records.types import Campaign, Record
from sma_bayes.studies.gap.hypothesis import baseline
from sma_bayes.studies.plan.apart import DRAWS, Explanation, Prospect, chances, expected, further, told_apart
from sma_bayes.studies.plan.candidates import CandidateExperiment

sys.path.append(str(Path(__file__).resolve().parents[4] / "scripts"))
from measure_plan import Divided, Trial, brier

N, C = 12, 3.0


def _prospect(rng: np.random.Generator, mean: np.ndarray, jacobian: np.ndarray, draws: int = 50) -> Prospect:
    """An explanation that is linear in standard normal parameters."""
    drawn = mean + rng.standard_normal((draws, jacobian.shape[1])) @ jacobian.T
    gram = jacobian.T @ jacobian
    inverse = np.linalg.inv(np.eye(len(gram)) + gram)
    reach = jacobian @ np.linalg.cholesky(inverse)
    return Prospect(mean, drawn, reach, 0.5 * float(np.linalg.slogdet(np.eye(len(gram)) + gram)[1]))


def test_without_freedom_it_is_the_formula_of_two_points() -> None:
    rng = np.random.default_rng(0)
    none = np.zeros((N, 1))
    for distance in (0.5, 2.0, 4.0):
        mean = np.zeros(N)
        mean[0] = distance
        pair = (_prospect(rng, np.zeros(N), none), _prospect(rng, mean, none))
        found = told_apart(*pair, C)
        assert found["separation"] == pytest.approx(distance)
        assert found["probability"] == pytest.approx(norm.cdf((distance**2 / 2 - C) / distance))


def test_what_comes_after_a_history_goes_on_from_where_that_ended(make_record: Callable[..., Record]) -> None:
    """Strain that creep has left is not undone by a further measurement, nor is it counted twice."""
    campaign = Campaign("c", "c", "0" * 64, (make_record(channels=("displacement",)),))
    whole = histories(campaign)
    plain = baseline(campaign, whole, read_priors("modified_sigmoid"), pooled=True)
    creeping = plain.extended(EFFECTS["hot_creep"])
    theta = creeping.space.constrain(np.zeros((1, len(creeping.space.parameters))))
    for name, value in (("c", 1e-4), ("w", 10.0)):  # m/s at 100 degC, K
        theta[:, creeping.space.index(f"hot_creep.{name}")] = value
    old = whole[0]
    lowest, peak = old.inputs["temperature"].min(), old.inputs["temperature"].max()
    new = further(CandidateExperiment("c", lowest, peak, 0.5, None, 1, 20, 0.0), old)

    def strain(applied: Mapping[str, np.ndarray]) -> np.ndarray:
        rest = theta[:, [creeping.space.index(p.name) for p in plain.space.parameters]]
        with_creep = creeping.predict(theta, 0, applied)["displacement"]
        return np.asarray(with_creep - plain.predict(rest, 0, applied)["displacement"])[0]

    before, alone = strain(old.inputs), strain(new.inputs)
    rest = theta[:, [creeping.space.index(p.name) for p in plain.space.parameters]]
    found = expected(creeping, 0, new, theta)["displacement"] - expected(plain, 0, new, rest)["displacement"]
    assert before[-1] > 0.0
    np.testing.assert_allclose(found[0], before[-1] + alone, rtol=1e-6)


def test_what_is_known_counts_for_the_explanation_that_it_speaks_for() -> None:
    rng = np.random.default_rng(0)
    mean, known = np.zeros(N), 2.0
    mean[0] = 2.0
    pair = (_prospect(rng, np.zeros(N), np.zeros((N, 1))), _prospect(rng, mean, np.zeros((N, 1))))
    found = told_apart(*pair, C, known)
    assert found["if_first"] == pytest.approx(norm.cdf((2.0 + known - C) / 2.0))
    assert found["if_second"] == pytest.approx(norm.cdf((2.0 - known - C) / 2.0))
    odds = np.exp(known)
    assert found["probability"] == pytest.approx(
        (odds * found["if_first"] + found["if_second"]) / (odds + 1.0)
    )


def test_what_the_rival_can_adapt_to_is_no_separation() -> None:
    rng = np.random.default_rng(1)
    direction = np.zeros((N, 1))
    direction[0] = 1e4
    mean = np.zeros(N)
    mean[0] = 5.0
    stiff = _prospect(rng, mean, np.zeros((N, 1)))
    soft = _prospect(rng, np.zeros(N), direction)
    assert stiff.left(np.ones(N)) == pytest.approx(np.ones(N))
    probability, squared = chances(stiff, soft, C)
    assert squared.max() < 1e-3
    # only the volume that the rival wasted speaks for the truth
    assert soft.half_log_determinant == pytest.approx(np.log(1e4), rel=1e-3)
    assert probability.min() > 0.99


@pytest.mark.parametrize("threshold", [1.0, 3.0])
def test_probabilities_are_those_of_simulated_bayes_factors(threshold: float) -> None:
    """4,000 simulations a draw; the normal approximation itself is off by up to 0.05 where little is separated."""
    rng = np.random.default_rng(2)
    one = _prospect(rng, np.zeros(N), 0.5 * rng.standard_normal((N, 2)), draws=12)
    other = _prospect(rng, 1.1 * rng.standard_normal(N), 0.6 * rng.standard_normal((N, 3)), draws=12)
    density = [
        multivariate_normal(p.mean, np.linalg.inv(np.eye(N) - p.reach @ p.reach.T)) for p in (one, other)
    ]
    said, _ = chances(one, other, threshold)
    happened = []
    for drawn in one.drawn:
        y = drawn + rng.standard_normal((4000, N))
        happened.append(np.mean(density[0].logpdf(y) - density[1].logpdf(y) >= threshold))
    np.testing.assert_allclose(said, happened, atol=0.06)
    assert np.mean(said) == pytest.approx(np.mean(happened), abs=0.02)


def _normal(root: np.ndarray) -> Any:
    """A fit at 0, 1, 2 ... with a covariance."""
    covariance = root @ root.T
    return SimpleNamespace(
        z=np.arange(float(len(root))), covariance=covariance, precision=np.linalg.inv(covariance)
    )


def test_draws_are_of_the_posterior_and_not_of_its_normal_approximation(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What the measurements rule out is not drawn: here all beyond the mode one way, which leaves half a normal.

    Its mean is -sqrt(2/pi), to five standard errors of independent draws.
    """
    fitted = _normal(np.diag([2.0, 0.5]))

    def half(_: object, z: np.ndarray) -> np.ndarray:
        beyond = z[:, 0] > fitted.z[0]
        return np.where(beyond, -1e4, multivariate_normal(fitted.z, fitted.covariance).logpdf(z))

    monkeypatch.setattr("sma_bayes.studies.plan.apart.log_posterior", half)
    draws = Explanation.of("", fitted, np.random.default_rng(0)).draws
    assert draws.shape == (DRAWS, 2)
    assert np.all(draws[:, 0] <= fitted.z[0])
    away = (draws - fitted.z) / np.array([2.0, 0.5])
    np.testing.assert_allclose(away.mean(axis=0), [-np.sqrt(2.0 / np.pi), 0.0], atol=5.0 / np.sqrt(DRAWS))
    (one,) = Explanation.of("", fitted, np.random.default_rng(1), 1).draws
    assert one[0] <= fitted.z[0]


def test_probabilities_hardly_depend_on_which_draws_there_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """Over 16 seeds a mean of probabilities scatters less than half as much as over as many independent draws.

    Mean and covariance of all draws are within five standard errors of independent ones.
    """
    rng = np.random.default_rng(3)
    root = np.tril(rng.standard_normal((8, 8))) + 3.0 * np.eye(8)
    fitted = _normal(root)
    density = multivariate_normal(fitted.z, fitted.covariance)
    monkeypatch.setattr("sma_bayes.studies.plan.apart.log_posterior", lambda _, z: density.logpdf(z))
    draws = [Explanation.of("", fitted, np.random.default_rng(seed)).draws for seed in range(16)]
    away = [np.linalg.solve(root, (d - fitted.z).T).T for d in draws]
    chance = [norm.cdf(3.0 * a[:, 0] + a[:, 1]) for a in away]
    scatter = np.std([np.mean(c) for c in chance])
    assert scatter < 0.5 * np.std(chance) / np.sqrt(DRAWS)
    whole = np.concatenate(away)
    se = 1.0 / np.sqrt(len(whole))
    np.testing.assert_allclose(whole.mean(axis=0), 0.0, atol=5.0 * se)
    np.testing.assert_allclose(np.cov(whole.T), np.eye(8), atol=5.0 * np.sqrt(2.0) * se)


def test_a_score_is_divided_into_what_is_said_wrongly_and_what_chance_decides() -> None:
    """Of probabilities of which bins have one each reliability and refinement add up to the score.

    Of 6,000 right ones reliability exceeds 5.5 times its mean by chance in 1 of 10^3 cases (chi2 of 3); of
    such that say 0.1 too much it is 0.01, to five standard errors.
    """
    rng = np.random.default_rng(4)
    chance = rng.choice([0.15, 0.55, 0.85], 6000)
    happened = rng.uniform(size=6000) < chance
    for added in (0.0, 0.1):
        trials = [Trial(p + added, bool(h)) for p, h in zip(chance, happened, strict=True)]
        divided = Divided.of(trials)
        assert divided.reliability + divided.refinement == pytest.approx(brier(trials)[0])
        if added:
            assert divided.reliability == pytest.approx(0.01, abs=5.0 * 2.0 * 0.1 * np.sqrt(0.17 / 6000))
        else:
            assert divided.reliability < 5.5 * divided.chance
            assert divided.chance == pytest.approx(0.17 * 3 / 6000, rel=0.1)
            assert divided.refinement == pytest.approx(np.mean(chance * (1 - chance)), abs=0.01)
