"""What sweeps have of their own, against the whole covariance, and on sweeps that do have it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from sma_bayes.fitting.discrepancy import MEDIAN_SIZE, SIGMA_OF_SIZE, build_basis
from sma_bayes.studies.cycles.own_shape import (
    SD_OF_LN_SIZE,
    CycleScatter,
    OwnShapeToCome,
    SweepResidual,
    scatter_of,
)

SPAN, NOISE = 2.0, 0.01
SIZES = np.array([0.2, 0.08, 0.03, 0.03, 0.03])
COMMON = 3


def simulated(seed: int = 0, samples: int = 40, sizes: np.ndarray = SIZES) -> list[SweepResidual]:
    """Sweeps of a common curve with three functions."""
    rng = np.random.default_rng(seed)
    error, found = 0.02 * rng.standard_normal(COMMON), []
    for size in sizes:
        t = np.sort(rng.uniform(0.0, 100.0, samples))
        nodes = np.linspace(0.0, 100.0, 161)
        numbers, at_nodes = (np.vander((x - 50.0) / 50.0, 4) for x in (t, nodes))
        basis = build_basis(t, nodes, np.tanh((nodes - 50.0) / 10.0), numbers, at_nodes)
        assert basis is not None
        q = np.linalg.qr(numbers)[0]
        common = np.sin(np.outer(t, np.arange(1, 4)) / 15.0)
        common -= q @ (q.T @ common)
        noise = NOISE * rng.standard_normal(samples)
        own = basis.rows.T @ (size * rng.standard_normal(basis.count))
        found.append(SweepResidual(common @ error + own + noise - q @ (q.T @ noise), common, basis))
    return found


def density(sweeps: list[SweepResidual], x: np.ndarray, usual_size: float) -> float:
    """Log posterior density of noise, size of the common curve's errors, and sizes, by dense matrices."""
    noise, of_common, sizes = np.exp(x[0]), np.exp(x[1]), np.exp(x[2:])
    n = [s.residual.size for s in sweeps]
    whole = np.zeros((sum(n), sum(n)))
    at = 0
    for s, size in zip(sweeps, sizes, strict=True):
        own = slice(at, at + s.residual.size)
        whole[own, own] = noise**2 * np.eye(s.residual.size) + size**2 * s.basis.rows.T @ s.basis.rows
        at += s.residual.size
    common = np.vstack([s.common for s in sweeps])
    whole += of_common**2 * common @ common.T
    r = np.concatenate([s.residual for s in sweeps])
    ln_evidence = -0.5 * (r @ np.linalg.solve(whole, r) + np.linalg.slogdet(whole)[1])
    ln_evidence += 4.0 * len(sweeps) * np.log(noise)  # four samples of each that the numbers account for
    ln_prior = -0.5 * ((x[1] - np.log(MEDIAN_SIZE * SPAN)) / SIGMA_OF_SIZE) ** 2
    return float(ln_evidence + ln_prior - 0.5 * np.sum(((x[2:] - np.log(usual_size)) / SD_OF_LN_SIZE) ** 2))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_scatter_is_that_of_the_greatest_density(seed: int) -> None:
    """Sizes lie on a grid whose values are 19 % apart; no search without it finds more than it allows for."""
    sweeps = simulated(seed)
    found = scatter_of(sweeps, COMMON, SPAN, 0.05)
    start = np.log(np.concatenate([[found.noise, 0.02], found.sizes]))
    best = minimize(
        lambda x: -density(sweeps, x, found.usual_size),
        start,
        method="Nelder-Mead",
        options={"maxiter": 4000, "maxfev": 4000},
    )
    assert np.exp(best.x[0]) == pytest.approx(found.noise, rel=0.02)
    assert np.exp(best.x[2:]) == pytest.approx(found.sizes, rel=0.15)


def test_sizes_and_noise_come_back() -> None:
    """Each size is told by some eight functions, so that its logarithm scatters by 0.3: 150 within four of these,
    means of 30 too; a size that is hardly seen comes out too small rather than too large."""
    found = [scatter_of(simulated(seed), COMMON, SPAN, 0.05) for seed in range(10, 40)]
    assert np.mean([s.noise for s in found]) == pytest.approx(NOISE, rel=0.05)
    ratio = np.log([s.sizes / SIZES for s in found])
    assert np.abs(ratio).max() < 1.2
    assert np.abs(ratio.mean(axis=0)).max() < 0.2


def test_own_shape_is_the_conditional_distribution() -> None:
    """Mean and covariance of the own weights given residual and common curve, by dense matrices."""
    sweeps, common = simulated(), np.array([0.01, -0.02, 0.03])
    scatter = CycleScatter(NOISE, SIZES, 0.03)
    for s, size, own in zip(sweeps, SIZES, scatter.own(sweeps, common), strict=True):
        design = s.basis.rows.T
        whole = np.linalg.inv(design.T @ design / NOISE**2 + np.eye(s.basis.count) / size**2)
        mean = whole @ design.T @ (s.residual - s.common @ common) / NOISE**2
        assert own.expected == pytest.approx(mean, rel=1e-6, abs=1e-9)
        assert own.sd**2 == pytest.approx(np.diag(whole), rel=1e-6)
        moved = whole @ design.T @ (s.residual - s.common @ (common + np.array([0.0, 1e-3, 0.0]))) / NOISE**2
        assert 1e-3 * own.follows[1] == pytest.approx(moved - mean, rel=1e-6, abs=1e-12)


def test_sweeps_tell_together_that_they_have_nothing_of_their_own() -> None:
    """Of twenty sweeps of one curve the usual size falls to where the noise hides it, from 0.01 spans."""
    scatter = scatter_of(simulated(sizes=np.zeros(20)), COMMON, SPAN, 0.05)
    assert scatter.usual_size < 0.0015 * SPAN
    assert scatter.sizes.max() < 0.003 * SPAN
    assert scatter.noise == pytest.approx(NOISE, rel=0.05)


def test_a_shape_to_come_is_that_of_one_of_the_sweeps() -> None:
    """Draws beside errors of the common curve: mean and variance are those of a mixture of the shapes."""
    t, errors = np.linspace(2.0, 98.0, 30), np.array([0.05, -0.02, 0.03])
    shapes = CycleScatter(NOISE, SIZES, 0.03).own(simulated(), np.zeros(COMMON))[2:]
    to_come = OwnShapeToCome.of(shapes)
    rng = np.random.default_rng(5)
    drawn = to_come.basis.function(to_come.draw(np.tile(errors, (20_000, 1)), 20_000, rng), t)
    means = np.array([(s.expected + errors @ s.follows) @ s.basis.at(t).T for s in shapes])
    variances = np.array([s.basis.at(t) ** 2 @ s.sd**2 for s in shapes])
    sd = np.sqrt(variances.mean(axis=0) + means.var(axis=0))
    assert np.abs(drawn.mean(axis=0) - means.mean(axis=0)).max() < 5.0 * sd.max() / np.sqrt(20_000)
    assert drawn.std(axis=0) == pytest.approx(sd, rel=0.03)
    assert to_come.basis.function(to_come.expected[None], t)[0] == pytest.approx(
        np.mean([s.basis.at(t) @ s.expected for s in shapes], axis=0), abs=1e-4
    )
