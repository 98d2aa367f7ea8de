"""Posteriors of the channels alone: what is their product, and what is none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.fitting.fit_records import fit_records
from sma_bayes.fitting.noise_choice import discrepancy_bases
from sma_bayes.fitting.posterior import Posterior, build_posterior
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.parameters.priors_file import PriorSet, read_priors
from sma_bayes.parameters.space import ParameterSpace
from sma_bayes.records.types import Record
from sma_bayes.response import RESPONSE_MODELS
from sma_bayes.sampling.ensembles import sample

BOTH = ("force", "displacement")
DEFAULT = read_priors("modified_sigmoid")
SHIFT = 0.15
"""Difference of means, in standard deviations, and of ln of these, that the draws of two runs may have: each has 1,000
effective draws at least, so that 0.15 is 3.4 standard errors of a difference of means: a false alarm in 150 files."""


def near_centre(posterior: Posterior, size: int = 8) -> np.ndarray:
    step = np.random.default_rng(1).standard_normal((size, posterior.space.dimension))
    return posterior.space.prior_centre() + 0.2 * posterior.space.prior_sd() * step


def is_product(posterior: Posterior) -> bool:
    """Whether there are factors; those there are must be its channels', and their product the posterior."""
    factors = posterior.factors()
    if not factors:
        return False
    assert [f.name for f in factors] == list(posterior.records[0].channels)
    z = near_centre(posterior)
    for factor in factors:
        assert factor.density.names == tuple(posterior.names[i] for i in factor.at)
    total = np.sum([f.density.log_prob(z[:, f.at]) for f in factors], axis=0)
    whole = posterior.log_prob(z)
    assert np.isfinite(whole).all()
    np.testing.assert_allclose(total, whole, rtol=1e-11)
    return True


@pytest.mark.parametrize("name", sorted(n for n, m in RESPONSE_MODELS.items() if not m.refusal(BOTH)))
def test_a_model_of_two_channels_is_a_product_unless_they_share_a_parameter(
    name: str, make_record: Callable[..., Record]
) -> None:
    record = make_record(BOTH, n=40)
    model = RESPONSE_MODELS[name].made_for([record])
    posterior = build_posterior([record], NOISE_MODELS["independent"], model.default_priors(), model=model)
    assert is_product(posterior) == (name != "modified_sigmoid_tied")


@pytest.mark.parametrize("name", [*sorted(NOISE_MODELS), "ar1+growing", "independent+temperature_error"])
def test_noise_is_each_channels_own_unless_the_thermometer_errs(
    name: str, make_record: Callable[..., Record]
) -> None:
    record = make_record(BOTH, n=40)
    memory = [dict.fromkeys(BOTH, 3.0)]
    posterior = build_posterior([record], NOISE_MODELS[name], DEFAULT, memory=memory)
    assert is_product(posterior) == (not NOISE_MODELS[name].feels_temperature)


@pytest.mark.parametrize("channels", [("force",), ("force", "displacement", "stiffness")])
def test_one_channel_and_stiffness_beside_what_it_follows_from_have_no_factors(
    channels: tuple[str, ...], make_record: Callable[..., Record]
) -> None:
    posterior = build_posterior([make_record(channels, n=40)], NOISE_MODELS["independent"], DEFAULT)
    assert not posterior.factors()


def test_a_declared_error_of_the_thermometer_joins_the_channels(make_record: Callable[..., Record]) -> None:
    record = make_record(BOTH, n=40, temperature_sd=0.2)
    assert not build_posterior([record], NOISE_MODELS["ar1"], DEFAULT).factors()


def test_discrepancies_and_records_that_share_a_curve_stay_with_their_channels(
    make_record: Callable[..., Record],
) -> None:
    records = [make_record(BOTH, n=40, seed=i, condition=f"c{i}") for i in range(2)]
    first = build_posterior(records, NOISE_MODELS["ar1"], DEFAULT)
    bases = discrepancy_bases(first, first.space.constrain(first.space.prior_centre())[:8])
    assert all(set(b) == set(BOTH) for b in bases)
    assert is_product(build_posterior(records, NOISE_MODELS["ar1"], DEFAULT, discrepancy=bases))
    one_of_them = [{"force": b["force"]} for b in bases]
    assert is_product(build_posterior(records, NOISE_MODELS["ar1"], DEFAULT, discrepancy=one_of_them))


def held(priors: PriorSet, record: Record, *names: str) -> Posterior:
    """A posterior with some parameters held at the medians of their priors."""
    whole = build_posterior([record], NOISE_MODELS["independent"], priors)
    parameters = [
        replace(p, fixed=float(p.prior.quantile(np.array(0.5)))) if p.name in names else p
        for p in whole.space.parameters
    ]
    return whole.on([record], space=ParameterSpace(tuple(parameters)))


def test_parameters_that_are_held_stay_out_of_the_coordinates(make_record: Callable[..., Record]) -> None:
    record = make_record(BOTH, n=40)
    assert is_product(held(DEFAULT, record, "A4", "B2"))
    every = build_posterior([record], NOISE_MODELS["independent"], DEFAULT).space.names
    force_alone = held(DEFAULT, record, *(n for n in every if n[0] == "B" or n == "force_sd"))
    assert not force_alone.factors()


def test_a_fit_by_factors_has_the_draws_of_the_whole(make_record: Callable[..., Record]) -> None:
    """Against the same posterior sampled at once: moments of every parameter, and the evidence."""
    fit = fit_records([make_record(BOTH, n=60, memory=0.4)], DEFAULT, noise="ar1", discrepancy=False)
    posterior = fit.posterior
    assert posterior.factors()
    start = posterior.space.unconstrain(fit.start)
    whole = sample(posterior, [start], posterior.space.prior_sd(), np.random.SeedSequence(1))
    assert fit.converged
    assert whole.convergence.converged
    one, other = (d.z.reshape(-1, posterior.space.dimension) for d in (fit.draws, whole))
    assert np.abs((one.mean(axis=0) - other.mean(axis=0)) / other.std(axis=0)).max() < SHIFT
    assert np.abs(np.log(one.std(axis=0) / other.std(axis=0))).max() < SHIFT
    error = np.hypot(fit.draws.ln_evidence_sd, whole.ln_evidence_sd)
    assert abs(fit.draws.ln_evidence - whole.ln_evidence) < 4.0 * error
    at_last = fit.draws.z[0, -1]
    np.testing.assert_allclose(fit.draws.log_prob[0, -1], posterior.log_prob(at_last), rtol=1e-10)
