"""Every prior family: agrees with scipy, integrates to one where it is sampled, can be rescaled and pickled."""

from __future__ import annotations

import pickle
from dataclasses import fields

import numpy as np
import pytest
from scipy import integrate, stats

from sma_bayes.errors import PriorError
from sma_bayes.parameters.distributions import (
    FAMILIES,
    Beta,
    Distribution,
    Gamma,
    HalfNormal,
    LogNormal,
    Normal,
    StudentT,
    TruncatedNormal,
    Uniform,
    family_name,
    numbers,
)


class Mirrored:
    """Minus a random variable, with the few methods of scipy that the tests use."""

    def __init__(self, inner) -> None:
        self.inner = inner

    def logpdf(self, x):
        return self.inner.logpdf(-x)

    def ppf(self, p):
        return -self.inner.isf(p)


EXAMPLES = {
    "normal": [(Normal(-3.0, 0.5), stats.norm(-3.0, 0.5))],
    "lognormal": [
        (LogNormal(0.02, 1.3), stats.lognorm(1.3, scale=0.02)),
        (LogNormal(4.0, 0.3, -1.0), Mirrored(stats.lognorm(0.3, scale=4.0))),
    ],
    "half_normal": [(HalfNormal(0.1), stats.halfnorm(scale=0.1))],
    "gamma": [
        (Gamma(2.0, 10.0), stats.gamma(2.0, scale=10.0)),
        (Gamma(0.4, 1e-3), stats.gamma(0.4, scale=1e-3)),
        (Gamma(2.0, 10.0, 2.0), stats.gamma(2.0, loc=2.0, scale=10.0)),
    ],
    "uniform": [(Uniform(-1.0, 1.0), stats.uniform(-1.0, 2.0)), (Uniform(20.0, 90.0), stats.uniform(20.0, 70.0))],
    "truncated_normal": [
        (TruncatedNormal(50.0, 10.0, 20.0, 55.0), stats.truncnorm(-3.0, 0.5, 50.0, 10.0)),
        (TruncatedNormal(0.0, 1.0, 4.0, 6.0), stats.truncnorm(4.0, 6.0)),
        (TruncatedNormal(0.0, 1.0, -6.0, -4.0), stats.truncnorm(-6.0, -4.0)),
        (TruncatedNormal(0.0, 1.0, 40.0, 41.0), stats.truncnorm(40.0, 41.0)),
    ],
    "student_t": [(StudentT(3.0, 45.0, 5.0), stats.t(3.0, 45.0, 5.0))],
    "beta": [
        (Beta(2.0, 5.0), stats.beta(2.0, 5.0)),
        (Beta(2.0, 3.0, -1.0, 1.0), stats.beta(2.0, 3.0, -1.0, 2.0)),
        (Beta(0.5, 0.4), stats.beta(0.5, 0.4)),
    ],
}  # fmt: skip

CASES = pytest.mark.parametrize(
    ("prior", "reference"),
    [
        pytest.param(*case, id=f"{name}-{i}")
        for name, cases in EXAMPLES.items()
        for i, case in enumerate(cases)
    ],
)
PROBABILITIES = np.array([1e-4, 0.01, 0.05, 0.3, 0.5, 0.8, 0.95, 0.99, 0.9999])


def test_every_family_is_tried() -> None:
    assert set(EXAMPLES) == set(FAMILIES)
    for name, cases in EXAMPLES.items():
        assert {family_name(prior) for prior, _ in cases} == {name}


@CASES
def test_density_is_that_of_scipy(prior: Distribution, reference) -> None:
    x = reference.ppf(PROBABILITIES)
    np.testing.assert_allclose(prior.log_density(x), reference.logpdf(x), rtol=1e-9, atol=1e-9)


@CASES
def test_quantiles_are_those_of_scipy(prior: Distribution, reference) -> None:
    np.testing.assert_allclose(prior.quantile(PROBABILITIES), reference.ppf(PROBABILITIES), rtol=1e-8)


@CASES
def test_density_is_zero_outside_the_support(prior: Distribution, reference) -> None:
    low, high = prior.quantile(np.array([0.0, 1.0]))
    outside = np.array([low - 1e-3 * (1 + abs(low)), high + 1e-3 * (1 + abs(high))])
    outside = outside[np.isfinite(outside)]
    np.testing.assert_array_equal(prior.log_density(outside), np.full(outside.size, -np.inf))


@CASES
def test_density_in_the_sampled_coordinate_integrates_to_one(prior: Distribution, reference) -> None:
    def density(z: float) -> float:
        x = prior.transform.constrain(np.array(z))
        return float(np.exp(prior.log_density(x) + prior.transform.log_jacobian(np.array(z))))

    ends = np.sort(prior.transform.unconstrain(prior.quantile(np.array([1e-6, 0.5, 1 - 1e-6]))))
    width = np.ptp(ends)
    total, _ = integrate.quad(
        density, ends[0] - 0.3 * width, ends[2] + 0.3 * width, points=[ends[1]], limit=400
    )
    assert total == pytest.approx(1.0, abs=1e-6)


@CASES
def test_draws_by_quantile_have_the_density(prior: Distribution, reference) -> None:
    """Bins of equal probability hold equal counts; false alarm in one of a million runs, the seed is fixed."""
    x = prior.quantile(np.random.default_rng(1).random(20_000))
    edges = reference.ppf(np.linspace(0, 1, 21)[1:-1])
    counts = np.bincount(np.searchsorted(edges, x), minlength=20)
    assert stats.chisquare(counts).pvalue > 1e-6


@CASES
def test_arrays_keep_their_shape(prior: Distribution, reference) -> None:
    p = np.random.default_rng(0).random((3, 4))
    x = prior.quantile(p)
    assert x.shape == prior.log_density(x).shape == (3, 4)
    assert prior.transform.unconstrain(x).shape == (3, 4)
    np.testing.assert_array_equal(prior.log_density(x)[1, 2], prior.log_density(x[1, 2]))


@CASES
def test_transform_goes_both_ways(prior: Distribution, reference) -> None:
    x = prior.quantile(PROBABILITIES)
    z = prior.transform.unconstrain(x)
    assert np.isfinite(z).all()
    np.testing.assert_allclose(prior.transform.constrain(z), x, rtol=1e-10)


@CASES
def test_rescaling_moves_every_quantile(prior: Distribution, reference) -> None:
    np.testing.assert_allclose(
        prior.rescaled(2.5).quantile(PROBABILITIES), 2.5 * prior.quantile(PROBABILITIES), rtol=1e-12
    )
    if family_name(prior) in {"lognormal", "half_normal", "gamma"}:
        with pytest.raises(PriorError, match="can't be moved away from zero"):
            prior.rescaled(1.0, 0.5)
    else:
        moved = prior.rescaled(2.5, -7.0)
        np.testing.assert_allclose(
            moved.quantile(PROBABILITIES), 2.5 * prior.quantile(PROBABILITIES) - 7.0, rtol=1e-10, atol=1e-12
        )


@CASES
def test_priors_pickle_and_say_their_numbers(prior: Distribution, reference) -> None:
    assert pickle.loads(pickle.dumps(prior)) == prior
    assert type(prior)(**numbers(prior)) == prior
    assert FAMILIES[family_name(prior)] is type(prior)


POSITIVE = {"sd", "median", "sigma", "shape", "scale", "df", "a", "b"}


@pytest.mark.parametrize("name", list(FAMILIES))
@pytest.mark.parametrize("bad", [float("nan"), float("inf"), 0.0, -1.0])
def test_wrong_numbers_are_refused(name: str, bad: float) -> None:
    good = numbers(EXAMPLES[name][0][0])
    for field in fields(FAMILIES[name]):
        if np.isfinite(bad) and field.name not in POSITIVE:
            continue
        with pytest.raises(PriorError):
            FAMILIES[name](**good | {field.name: bad})


def test_an_empty_interval_is_refused() -> None:
    with pytest.raises(PriorError, match="low"):
        Uniform(1.0, 1.0)
    with pytest.raises(PriorError, match="low"):
        TruncatedNormal(0.0, 1.0, 2.0, 1.0)
    with pytest.raises(PriorError, match="low"):
        Beta(1.0, 1.0, 1.0, 0.0)


@pytest.mark.parametrize("sign", [0.0, 0.5, 2.0, float("nan")])
def test_a_sign_is_plus_or_minus_one(sign: float) -> None:
    with pytest.raises(PriorError, match="sign"):
        LogNormal(1.0, 1.0, sign)
