"""Power scaling against normal posteriors, whose scaled ones are known, and against arviz-stats on named draws."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from sma_bayes.sampling.power_scaling import POWERS, mean_gradient, power_sensitivity

DRAWS = 20_000


def distance(one: tuple[float, float], other: tuple[float, float], ends: tuple[float, float]) -> float:
    """Cumulative Jensen-Shannon distance of two normal distributions, by the trapezoidal rule."""
    x = np.linspace(*ends, 100_001)
    found = []
    for at, sign in ((x, 1.0), (-x[::-1], -1.0)):
        p, q = (norm.cdf(at, sign * m, s) for m, s in (one, other))
        middle = 0.5 * (p + q)
        size = np.trapezoid(p, at), np.trapezoid(q, at)
        apart = [np.trapezoid(f * np.log2(f / middle), at) for f in (p, q)]
        found.append(np.sqrt(max(sum(apart), 0.0) / sum(size)))
    return max(found)


class Conjugate:
    """Mean of a normal distribution of known width, its prior normal."""

    def __init__(self, centre: float, width: float, n: int, noise: float, observed: float) -> None:
        self.prior, self.data = (centre, width), (observed, noise / np.sqrt(n))

    def posterior(self, of_prior: float = 1.0, of_likelihood: float = 1.0) -> tuple[float, float]:
        weight = [of_prior / self.prior[1] ** 2, of_likelihood / self.data[1] ** 2]
        return (weight[0] * self.prior[0] + weight[1] * self.data[0]) / sum(weight), sum(weight) ** -0.5

    def log_density(self, of: tuple[float, float], draws: np.ndarray) -> np.ndarray:
        return -0.5 * ((draws - of[0]) / of[1]) ** 2


CASES = {
    "both have a say": Conjugate(0.0, 1.0, 10, 3.0, 1.5),
    "they disagree": Conjugate(0.0, 0.3, 5, 1.0, 2.0),
    "the data decide": Conjugate(0.0, 10.0, 50, 1.0, 1.0),
    "the prior decides": Conjugate(0.0, 0.1, 1, 5.0, 0.0),
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
@pytest.mark.parametrize("which", ["prior", "likelihood"])
def test_sensitivity_is_that_of_the_scaled_normal(case: Conjugate, which: str) -> None:
    mean, sd = case.posterior()
    draws = mean + sd * np.random.default_rng(1).standard_normal(DRAWS)
    density = case.log_density(case.prior if which == "prior" else case.data, draws)

    def scaled(power: float) -> tuple[float, float]:
        return case.posterior(power) if which == "prior" else case.posterior(1.0, power)

    ends = (float(draws.min()), float(draws.max()))
    exact = np.mean([distance((mean, sd), scaled(p), ends) / abs(np.log2(p)) for p in POWERS])
    (found,) = power_sensitivity(draws[:, None], density)
    # 0.72/sqrt(S) is the standard error of a shift per ln 2; the distance follows it by a factor of about a quarter
    assert found == pytest.approx(exact, abs=4.0 * 0.25 / np.sqrt(DRAWS) + 0.02 * exact)
    gradient = (scaled(1.001)[0] - scaled(0.999)[0]) / (np.log2(1.001) - np.log2(0.999))
    assert mean_gradient(draws[:, None], density)[0] / sd == pytest.approx(
        gradient / sd, abs=5.0 / np.sqrt(DRAWS)
    )


def test_it_is_what_arviz_says_of_the_same_draws(arviz_psens: Callable[..., Any]) -> None:
    rng = np.random.default_rng(2)
    draws = rng.standard_normal((4, 500, 3)) @ np.array([[1.0, 0.4, 0.0], [0.0, 1.0, 0.2], [0.0, 0.0, 2.0]])
    for density in (-0.5 * (draws[..., 0] - 1.0) ** 2, -0.3 * draws[..., 1] ** 4):
        found = power_sensitivity(draws.reshape(-1, 3), density.ravel())
        other = arviz_psens({f"x{i}": draws[..., i] for i in range(3)}, density)
        np.testing.assert_allclose(found, [float(other[f"x{i}"]) for i in range(3)], rtol=0.03, atol=1e-6)


def test_what_is_not_finite_is_left_out() -> None:
    rng = np.random.default_rng(3)
    values = rng.standard_normal((500, 2))
    density = -0.5 * values[:, 0] ** 2
    holes = values.copy()
    holes[::3, 1] = np.inf
    whole, part = power_sensitivity(holes, density)
    assert whole == power_sensitivity(values[:, :1], density)[0]
    kept = np.isfinite(holes[:, 1])
    assert part == power_sensitivity(values[kept, 1:], density[kept])[0]


def test_what_does_not_vary_moves_nothing_and_too_few_draws_tell_nothing() -> None:
    rng = np.random.default_rng(4)
    values = np.stack([rng.standard_normal(100), np.ones(100)], axis=1)
    assert power_sensitivity(values, np.zeros(100)).tolist() == [0.0, 0.0]
    assert power_sensitivity(values, values[:, 0])[1] == 0.0
    assert np.isnan(power_sensitivity(values[:10], values[:10, 0])).all()
