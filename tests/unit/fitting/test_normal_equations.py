"""The normal distribution of the model's parameters given the noise."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from sma_bayes.fitting.normal_equations import NormalEquations
from sma_bayes.fitting.posterior import Posterior, build_posterior
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.types import Record

BOTH = ("force", "displacement")


def equations_for(posterior: Posterior, rng: np.random.Generator, mixed: bool = False) -> NormalEquations:
    """Equations of random rows, each parameter moving one channel, or both if they are mixed."""
    (record,) = posterior.records
    m = len(posterior.model.parameter_names)
    rows = {}
    for i, channel in enumerate(record.channels):
        block = rng.standard_normal((m + 1, record.n))
        if not mixed:
            block[: m // 2 if i else 0] = 0.0
            block[m if i or len(record.channels) == 1 else m // 2 : m] = 0.0
        rows[channel] = block
    root = rng.standard_normal((m, m)) if mixed else np.diag(rng.uniform(0.1, 3.0, m))
    return NormalEquations(
        posterior, m, (rows,), ({},), root @ root.T + 0.1 * np.eye(m), rng.standard_normal(m)
    )


@pytest.mark.parametrize(
    ("channels", "noise", "mixed"),
    [
        (BOTH, "independent", False),
        (BOTH, "student_t", False),
        (("stiffness",), "independent", True),
        (BOTH, "independent", True),
        (BOTH, "ar1", False),
    ],
)
def test_it_is_the_solution_of_the_normal_equations(
    make_record: Callable[..., Record], channels: tuple[str, ...], noise: str, mixed: bool
) -> None:
    """Against dense linear algebra, one value of the noise after the other."""
    rng = np.random.default_rng(0)
    posterior = build_posterior([make_record(channels)], NOISE_MODELS[noise], read_priors("modified_sigmoid"))
    equations = equations_for(posterior, rng, mixed)
    theta = posterior.space.constrain(posterior.draw_prior(rng, 30))
    normal, squares, added = equations.solved(theta)
    np.testing.assert_array_equal(added, 0.0)  # nothing stands beside the curve
    assert normal.usable.all()
    m = equations.count
    x = rng.standard_normal((30, m))
    v = normal.whiten(x)
    np.testing.assert_allclose(normal.colour(v), x, atol=1e-8)
    for w in range(30):
        precision, pull, total = equations.precision.copy(), equations.pull.copy(), 0.0
        for rows, at, steps in equations.channels():
            gram = posterior.noise.information(theta[w : w + 1, at[1:]], steps).gram(rows)[0]
            gram = gram / theta[w, at[0]] ** 2
            precision += gram[:m, :m]
            pull += gram[m, :m]
            total += gram[m, m]
        mean = np.linalg.solve(precision, pull)
        assert squares[w] == pytest.approx(total, rel=1e-9)
        assert normal.log_volume[w] == pytest.approx(0.5 * np.linalg.slogdet(precision)[1], abs=1e-8)
        assert normal.pull_squared[w] == pytest.approx(pull @ mean, rel=1e-8)
        distance = (x[w] - mean) @ precision @ (x[w] - mean)
        assert v[w] @ v[w] == pytest.approx(distance, rel=1e-7)


@pytest.mark.parametrize("noise", ["independent", "ar1"])
def test_noise_beyond_all_bounds_is_not_usable_and_spares_the_rest(
    make_record: Callable[..., Record], noise: str
) -> None:
    rng = np.random.default_rng(1)
    posterior = build_posterior([make_record(BOTH)], NOISE_MODELS[noise], read_priors("modified_sigmoid"))
    equations = equations_for(posterior, rng)
    theta = posterior.space.constrain(posterior.draw_prior(rng, 4))
    wild = theta.copy()
    wild[1, posterior.layout[0].noise["force"][0]] = 0.0
    wild[2, posterior.layout[0].noise["force"][0]] = np.nan
    good, bad = equations.solved(theta)[0], equations.solved(wild)[0]
    assert bad.usable.tolist() == [True, False, False, True]
    x = rng.standard_normal((4, equations.count))
    assert np.isfinite(bad.whiten(x)).all()
    np.testing.assert_array_equal(bad.whiten(x)[[0, 3]], good.whiten(x)[[0, 3]])
