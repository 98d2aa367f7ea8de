"""Proposals: what is drawn has the density that is claimed, and that density integrates to one."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy import stats

from sma_bayes.sampling.proposals import (
    AnyProposal,
    FactorisedMixture,
    MixedProposal,
    PlainCoordinates,
    Proposal,
    StudentMixture,
)


def covariance(d: int, seed: int = 0) -> np.ndarray:
    a = np.random.default_rng(seed).standard_normal((d, d))
    return a @ a.T + 0.1 * np.eye(d)


def one(d: int = 3, df: float = 5.0, seed: int = 0) -> StudentMixture:
    return StudentMixture.from_covariances(np.ones(1), np.full((1, d), 0.5), covariance(d, seed)[None], df)


def two(d: int = 2) -> StudentMixture:
    means = np.stack([np.full(d, -3.0), np.full(d, 2.0)])
    return StudentMixture.from_covariances(
        np.array([1.0, 3.0]), means, np.stack([covariance(d), 0.3 * np.eye(d)]), 8.0
    )


class Bent:
    """Coordinates with a known Jacobian: u = (x, y - x**2, 2 w, ...), defined for abs(x) < 3 only."""

    def forward(self, z):
        u = z.copy()
        u[:, 1] = z[:, 1] - z[:, 0] ** 2
        u[:, 2:] = 2.0 * z[:, 2:]
        return u, np.full(len(z), (z.shape[1] - 2) * np.log(2.0)), np.abs(z[:, 0]) < 3.0

    def inverse(self, u):
        z = u.copy()
        z[:, 1] = u[:, 1] + u[:, 0] ** 2
        z[:, 2:] = 0.5 * u[:, 2:]
        return z, np.full(len(u), (u.shape[1] - 2) * np.log(2.0)), np.abs(u[:, 0]) < 3.0


def plain() -> Proposal:
    return Proposal(PlainCoordinates(), two(), one(2, 4.0, 1), 0.1)


def bent() -> Proposal:
    narrow = StudentMixture.from_covariances(np.ones(1), np.zeros((1, 3)), 0.5 * np.eye(3)[None], 15.0)
    return Proposal(Bent(), narrow, one(3, 4.0, 2), 0.05)


def factorised() -> Proposal:
    blocks = (np.array([0, 2]), np.array([1]))
    return Proposal(
        PlainCoordinates(), FactorisedMixture(blocks, (two(), one(1, 6.0, 3))), one(3, 4.0, 2), 0.05
    )


def mixed() -> MixedProposal:
    other = Proposal(Bent(), one(3, 15.0, 5), one(3, 4.0, 6), 0.2)
    return MixedProposal(np.array([0.25, 0.75]), (bent(), other))


PROPOSALS = {"plain": plain, "bent": bent, "factorised": factorised, "mixed": mixed}
EACH = pytest.mark.parametrize("make", list(PROPOSALS.values()), ids=list(PROPOSALS))


# --- mixtures -----------------------------------------------------------------------------------------


def test_one_component_is_scipys_multivariate_t() -> None:
    mixture = one(3, 5.0)
    x = np.random.default_rng(1).standard_normal((20, 3))
    scale = covariance(3) * (5.0 - 2.0) / 5.0
    expected = stats.multivariate_t(np.full(3, 0.5), scale, 5.0).logpdf(x)
    np.testing.assert_allclose(mixture.log_density(x), expected, rtol=1e-12)


def test_several_components_are_their_weighted_sum() -> None:
    mixture = two()
    x = np.random.default_rng(1).standard_normal((20, 2))
    density = 0.0
    for weight, mean, c in zip((0.25, 0.75), mixture.mean, (covariance(2), 0.3 * np.eye(2)), strict=True):
        density = density + weight * stats.multivariate_t(mean, c * 6.0 / 8.0, 8.0).pdf(x)
    np.testing.assert_allclose(mixture.log_density(x), np.log(density), rtol=1e-10)


@pytest.mark.parametrize("far", [1e200, -1e300, 1.7e308])
def test_a_point_beyond_all_reach_has_no_density_and_no_warning(far: float) -> None:
    points = np.array([[far, 0.0], [far, far], [0.0, -far], [0.5, 0.5]])
    density = two().log_density(points)
    assert np.all(density[:3] < -700.0)
    assert not np.isnan(density).any()
    assert np.isfinite(density[3])


def test_covariances_are_those_of_the_draws() -> None:
    """100,000 draws with 15 degrees of freedom: within 3 %."""
    mixture = one(3, 15.0)
    x = mixture.draw(np.random.default_rng(2), 100_000)
    scale = np.sqrt(np.diag(covariance(3)))
    np.testing.assert_allclose(
        np.cov(x.T) / np.outer(scale, scale), covariance(3) / np.outer(scale, scale), atol=0.03
    )
    np.testing.assert_allclose(x.mean(axis=0), 0.5, atol=0.03)


@pytest.mark.parametrize("stream", [np.random.default_rng, np.random.RandomState])
def test_either_kind_of_random_stream_will_do(stream) -> None:
    np.testing.assert_array_equal(two().draw(stream(3), 5), two().draw(stream(3), 5))


def test_a_fit_finds_two_lumps() -> None:
    rng = np.random.default_rng(4)
    x = np.concatenate([rng.normal(-4.0, 0.5, (3000, 2)), rng.normal(3.0, 1.0, (1000, 2))])
    start = StudentMixture(
        np.array([0.5, 0.5]), np.array([[-1.0, 0.0], [1.0, 0.0]]), np.tile(3.0 * np.eye(2), (2, 1, 1)), 15.0
    )
    found = start.refitted(x, np.full(len(x), 1.0 / len(x)), rounds=60)
    order = np.argsort(found.mean[:, 0])
    np.testing.assert_allclose(found.weight[order], [0.75, 0.25], atol=0.01)
    np.testing.assert_allclose(found.mean[order], [[-4.0, -4.0], [3.0, 3.0]], atol=0.15)


def test_weights_count_in_a_fit() -> None:
    rng = np.random.default_rng(5)
    x = rng.uniform(-6.0, 6.0, (8000, 1))
    weight = np.exp(-0.5 * ((x[:, 0] - 2.0) / 0.5) ** 2)
    found = one(1).refitted(x, weight / weight.sum(), rounds=20)
    assert found.mean[0, 0] == pytest.approx(2.0, abs=0.05)
    assert found.root[0, 0, 0] == pytest.approx(0.5, rel=0.2)


@pytest.mark.parametrize(("drawn", "found"), [(5.0, {5.0}), (10.0, {10.0}), (1e6, {50.0})])
def test_degrees_of_freedom_are_those_of_the_points(drawn: float, found: set[float]) -> None:
    x = one(3, drawn).draw(np.random.default_rng(7), 8000)
    fitted = one(3, 20.0).refitted(x, np.full(len(x), 1.0 / len(x)), rounds=10)
    assert fitted.df in found
    np.testing.assert_allclose(
        fitted.root[0], one(3, drawn).root[0], rtol=0.1, atol=0.05 * fitted.root[0].max()
    )


def test_uneven_weights_do_not_tell_degrees_of_freedom() -> None:
    x = np.random.default_rng(8).standard_normal((2000, 3))
    weight = np.exp(np.random.default_rng(9).normal(0.0, 1.2, 2000))
    weight = weight / weight.sum()
    assert 0.1 < 1.0 / (2000 * np.sum(weight**2)) < 0.6
    assert one(3, 15.0).refitted(x, weight, rounds=5).df == 15.0


def test_a_component_without_points_is_dropped() -> None:
    x = np.random.default_rng(6).standard_normal((500, 2))
    start = StudentMixture(
        np.array([0.5, 0.5]), np.array([[0.0, 0.0], [90.0, 90.0]]), np.tile(np.eye(2), (2, 1, 1)), 15.0
    )
    assert len(start.refitted(x, np.full(500, 1 / 500), rounds=5).weight) == 1


def test_too_few_points_leave_a_fit_as_it_was() -> None:
    x = np.zeros((100, 3))
    weight = np.zeros(100)
    weight[0] = 1.0
    before = one(3)
    np.testing.assert_array_equal(before.refitted(x, weight, rounds=5).root, before.root)


@pytest.mark.parametrize("scale", [1e-12, 1e12])
def test_nearly_singular_covariances_have_a_root(scale: float) -> None:
    v = np.array([1.0, 2.0, 3.0]) * np.array([1.0, scale, 1.0])
    mixture = StudentMixture.from_covariances(np.ones(1), np.zeros((1, 3)), np.outer(v, v)[None], 5.0)
    assert np.isfinite(mixture.log_density(mixture.draw(np.random.default_rng(0), 10))).all()


# --- proposals ----------------------------------------------------------------------------------------


@EACH
def test_the_density_at_a_draw_is_the_one_that_comes_with_it(make) -> None:
    proposal: AnyProposal = make()
    z, log_q = proposal.draw(np.random.default_rng(7), 2000)
    found = np.isfinite(log_q)
    assert found.mean() > 0.9
    assert np.isnan(z[~found]).all()
    np.testing.assert_allclose(proposal.log_density(z[found]), log_q[found], rtol=1e-10, atol=1e-10)


@EACH
def test_the_density_integrates_to_what_can_be_drawn(make) -> None:
    """Importance estimate with 200,000 draws of a wide t: five standard errors; the seed is fixed."""
    proposal: AnyProposal = make()
    rng = np.random.default_rng(8)
    d = 2 if make is plain else 3
    reference = StudentMixture.from_covariances(np.ones(1), np.zeros((1, d)), 16.0 * np.eye(d)[None], 3.0)
    x = reference.draw(rng, 200_000)
    ratio = np.exp(proposal.log_density(x) - reference.log_density(x))
    error = ratio.std() / np.sqrt(len(x))
    drawn = np.isfinite(proposal.draw(rng, 100_000)[1]).mean()  # the map may have no point for a draw
    assert error < 0.02
    assert abs(ratio.mean() - drawn) < 5.0 * error + 0.003


@EACH
def test_draws_are_distributed_by_the_density(make) -> None:
    """Mean of r/q over draws of q is the integral of r where q reaches: one; five standard errors."""
    proposal: AnyProposal = make()
    centre = {plain: [2.0, 2.0], factorised: [2.0, 0.5, 2.0]}.get(make, [0.0, 0.0, 0.0])
    d = len(centre)
    inner = StudentMixture.from_covariances(np.ones(1), np.array([centre]), 0.1 * np.eye(d)[None], 30.0)
    z, log_q = proposal.draw(np.random.default_rng(9), 100_000)
    ok = np.isfinite(log_q)
    ratio = np.zeros(len(z))
    ratio[ok] = np.exp(inner.log_density(z[ok]) - log_q[ok])
    error = ratio.std() / np.sqrt(len(z))
    assert error < 0.03
    assert abs(ratio.mean() - 1.0) < 5.0 * error


@EACH
def test_the_wide_component_reaches_everywhere(make) -> None:
    proposal: AnyProposal = make()
    d = 2 if make is plain else 3
    far = 50.0 * np.random.default_rng(10).standard_normal((100, d))
    assert np.isfinite(proposal.log_density(far)).all()


@EACH
def test_proposals_pickle_and_repeat(make) -> None:
    proposal: AnyProposal = make()
    again = pickle.loads(pickle.dumps(proposal))
    for first, second in zip(
        proposal.draw(np.random.default_rng(1), 50), again.draw(np.random.default_rng(1), 50), strict=True
    ):
        np.testing.assert_array_equal(first, second)
