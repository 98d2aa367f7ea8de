"""Proposals from which sampling starts: their densities."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from sma_bayes.fitting.first_proposals import PriorOfCurve
from sma_bayes.fitting.posterior import build_posterior
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.types import Record


@pytest.fixture
def proposal(make_record: Callable[..., Record]) -> PriorOfCurve:
    record = make_record(("force", "displacement"))
    posterior = build_posterior([record], NOISE_MODELS["ar1"], read_priors("modified_sigmoid"))
    size = posterior.space.dimension
    return PriorOfCurve.of(posterior, np.zeros(size), np.eye(size))


def test_the_prior_of_the_curve_has_the_density_of_its_two_parts(proposal: PriorOfCurve) -> None:
    z, found = proposal.draw(np.random.default_rng(0), 50)
    others = [(p.prior, z[:, i]) for i, p in enumerate(proposal.space.free) if i not in proposal.at]
    curve = sum(d.log_density(d.transform.constrain(x)) + d.transform.log_jacobian(x) for d, x in others)
    np.testing.assert_allclose(found, curve + proposal.noise.log_density(z[:, proposal.at]), rtol=1e-12)


@pytest.mark.parametrize("far", [-800.0, 800.0])
def test_it_has_a_density_where_the_prior_of_the_noise_has_none(proposal: PriorOfCurve, far: float) -> None:
    """A correlation so near 1 that it is 1 in floating point: the prior is zero there, the Student t is not."""
    z, _ = proposal.draw(np.random.default_rng(0), 1)
    z[:, proposal.at] = far
    with np.errstate(all="ignore"):
        assert not np.isfinite(proposal.space.log_prior(z)).any()
    assert np.isfinite(proposal.log_density(z)).all()
