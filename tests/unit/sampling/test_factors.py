"""A product of densities, sampled factor by factor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sma_bayes.sampling.density import DensityFactor, Factorisable
from sma_bayes.sampling.ensembles import METHODS, Plan, sample
from sma_bayes.sampling.factors import sample_by_factors
from sma_bayes.sampling.moves import SAMPLERS

SD = np.array([0.5, 2.0])
WIDTH = np.array([4.0, 4.0, 4.0, 4.0])
BENT, PLAIN = np.array([3, 0]), np.array([2, 1])


class Bent:
    """``x ~ N(0, 1)``, ``y ~ N(x**2 / 5, 1)``."""

    names = ("x", "y")

    def log_prob(self, z: np.ndarray) -> np.ndarray:
        return -0.5 * (z[:, 0] ** 2 + (z[:, 1] - 0.2 * z[:, 0] ** 2) ** 2)

    def draw_prior(self, rng: np.random.Generator, size: int) -> np.ndarray:
        return rng.normal(0.0, 4.0, (size, 2))


class Normal:
    """Two independent normals of standard deviations `SD`."""

    names = ("u", "v")

    def log_prob(self, z: np.ndarray) -> np.ndarray:
        return -0.5 * np.sum((z / SD) ** 2, axis=1)

    def draw_prior(self, rng: np.random.Generator, size: int) -> np.ndarray:
        return rng.normal(0.0, 4.0, (size, 2))


class Product:
    """Both, their coordinates mixed up."""

    names = ("y", "v", "u", "x")

    def factors(self) -> tuple[DensityFactor, ...]:
        return DensityFactor("bent", Bent(), BENT), DensityFactor("plain", Normal(), PLAIN)

    def log_prob(self, z: np.ndarray) -> np.ndarray:
        return Bent().log_prob(z[:, BENT]) + Normal().log_prob(z[:, PLAIN])

    def draw_prior(self, rng: np.random.Generator, size: int) -> np.ndarray:
        return rng.normal(0.0, 4.0, (size, 4))


def sampled(density: object, plan: Plan | None = None, **options: object):
    return sample_by_factors(density, [np.zeros(4)], WIDTH, np.random.SeedSequence(4), plan, **options)


def test_coordinates_come_back_in_the_order_of_the_product() -> None:
    """Moments to five standard errors of 1,000 effective draws, a false alarm in some 100,000 for each of eight."""
    density = Product()
    assert isinstance(density, Factorisable)
    draws = sampled(density)
    z = draws.z.reshape(-1, 4)
    assert draws.convergence.converged
    sd = np.array([np.sqrt(1.08), SD[1], SD[0], 1.0])
    error = 5.0 / np.sqrt(1000.0)
    assert (np.abs(z.mean(axis=0) - [0.2, 0.0, 0.0, 0.0]) < error * sd).all()
    assert (np.abs(z.std(axis=0) / sd - 1.0) < error * np.sqrt(0.5)).all()
    assert abs(np.corrcoef(z[:, 0], z[:, 3] ** 2)[0, 1] - 0.4 / np.sqrt(2.0 * 1.08)) < error
    np.testing.assert_allclose(density.log_prob(z), draws.log_prob.ravel(), rtol=1e-12)


def test_the_evidence_is_the_product_of_the_factors() -> None:
    draws = sampled(Product())
    wanted = 2.0 * np.log(2.0 * np.pi) + np.log(SD).sum()
    assert draws.ln_evidence_sd < 0.1
    assert abs(draws.ln_evidence - wanted) < 4.0 * draws.ln_evidence_sd
    assert draws.method in METHODS
    assert draws.convergence.rhat.shape == (4,)
    mode = draws.modes[0]
    np.testing.assert_allclose(mode.z, 0.0, atol=1e-3)
    np.testing.assert_allclose(np.diag(mode.covariance), [1.0, 4.0, 0.25, 1.0], rtol=1e-2)


def test_a_sampler_that_was_asked_for_samples_the_whole() -> None:
    plan = Plan(sampler=SAMPLERS["de"], explore_block=50, evaluations=20_000)
    np.testing.assert_array_equal(
        sampled(Product(), plan).z,
        sample(Product(), [np.zeros(4)], WIDTH, np.random.SeedSequence(4), plan).z,
    )


def test_a_density_without_factors_is_sampled_as_it_was() -> None:
    found = sample_by_factors(Bent(), [np.zeros(2)], WIDTH[:2], np.random.SeedSequence(4))
    wanted = sample(Bent(), [np.zeros(2)], WIDTH[:2], np.random.SeedSequence(4))
    np.testing.assert_array_equal(found.z, wanted.z)


def test_what_is_going_on_is_told_with_the_name_of_the_factor() -> None:
    told: list[str] = []
    sampled(Product(), progress=told.append)
    assert {message.partition(":")[0] for message in told} == {"bent", "plain"}


def test_a_run_that_is_killed_goes_on_and_comes_out_the_same(tmp_path: Path) -> None:
    """Killed while the second factor is at work: the first is read, not run again."""
    whole = sampled(Product())
    options = {"checkpoint": tmp_path / "a.h5", "fingerprint": "one"}

    def killed(message: str) -> None:
        if message.startswith("plain: independence"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sampled(Product(), progress=killed, **options)
    assert (tmp_path / "a-bent.h5").exists()
    again = sampled(Product(), **options)
    np.testing.assert_array_equal(whole.z, again.z)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a-bent.h5", "a-plain.h5"]
