"""The noise model that the residuals ask for, and the start that goes with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.inference.noise_choice import NoiseChoice, choose_noise, noise_start, posterior_with
from sma_bayes.inference.warm_start import warm_start
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.posterior import build_posterior
from sma_bayes.records.types import Record

DEFAULT = read_priors("modified_sigmoid")


def choice_for(record: Record) -> NoiseChoice:
    posterior = build_posterior([record], NOISE_MODELS["independent"], DEFAULT)
    return choose_noise(posterior, warm_start(posterior, np.random.default_rng(0)), DEFAULT)


def with_even_time(record: Record) -> Record:
    return replace(record, inputs={**record.inputs, "time": np.arange(record.n, dtype=float)})


def with_outliers(record: Record) -> Record:
    rng = np.random.default_rng(3)
    observed = {}
    for channel, y in record.observed.items():
        hit = rng.random(record.n) < 0.08
        observed[channel] = y + hit * 0.1 * np.ptp(y) * rng.standard_normal(record.n)
    return replace(record, observed=observed)


def test_white_residuals_are_independent(make_record: Callable[..., Record]) -> None:
    """Eleven of twelve at least: were another model taken in one record of fifty, it fails once in forty runs."""
    choices = [choice_for(make_record(n=150, seed=seed)) for seed in range(12)]
    assert sum(c.name == "independent" for c in choices) >= 11
    assert sum(any(c.bases) for c in choices) <= 12
    assert all(abs(r) < 0.3 for c in choices for r in c.lag1.values())


@pytest.mark.parametrize("seed", range(3))
def test_residuals_with_a_memory_get_one(make_record: Callable[..., Record], seed: int) -> None:
    choice = choice_for(with_even_time(make_record(n=300, seed=seed, memory=0.8)))
    assert choice.name == "ar1"
    assert all(r > 0.5 for r in choice.lag1.values())
    assert "ar1_time" not in choice.ln_evidence
    assert choice.ln_evidence["ar1"] == 0.0
    assert choice.ln_evidence["independent"] < -10.0


def test_outliers_ask_for_heavy_tails(make_record: Callable[..., Record]) -> None:
    assert choice_for(with_outliers(make_record(n=300))).name == "student_t"


def test_a_memory_in_time_is_told_from_one_in_samples(make_record: Callable[..., Record]) -> None:
    record = make_record(("force",), n=600, noise=1e-6)
    rng = np.random.default_rng(5)
    dt = rng.choice([0.1, 5.0], record.n)
    e = rng.standard_normal(record.n)
    for i in range(1, record.n):
        phi = np.exp(-dt[i] / 3.0)
        e[i] = phi * e[i - 1] + np.sqrt(1.0 - phi**2) * e[i]
    force = record.observed["force"]
    timed = replace(
        record,
        inputs={**record.inputs, "time": np.cumsum(dt)},
        observed={"force": force + 0.01 * np.ptp(force) * e},
    )
    assert choice_for(timed).name == "ar1_time"


def test_the_reason_names_model_rival_and_correlations(make_record: Callable[..., Record]) -> None:
    choice = choice_for(make_record(n=200))
    assert choice.reason.startswith(NOISE_MODELS[choice.name].title)
    for channel, value in choice.lag1.items():
        assert f"{value:.2f} ({channel})" in choice.reason
    assert sum(v == 0.0 for v in choice.ln_evidence.values()) == 1


def test_what_is_no_density_of_the_data_is_not_compared(make_record: Callable[..., Record]) -> None:
    assert all(NOISE_MODELS[name].is_density for name in choice_for(make_record(n=50)).ln_evidence)


@pytest.mark.parametrize("name", list(NOISE_MODELS))
def test_a_start_has_the_curve_and_the_noise_of_the_warm_start(
    make_record: Callable[..., Record], name: str
) -> None:
    record = make_record(n=400, memory=0.6)
    first = build_posterior([record], NOISE_MODELS["independent"], DEFAULT)
    start = warm_start(first, np.random.default_rng(0))
    posterior = posterior_with(name, first, start, DEFAULT)
    z = noise_start(posterior, start)
    theta = posterior.space.to_physical(z)
    np.testing.assert_allclose(theta[: start.theta.size], start.theta, rtol=1e-10)
    for channel in record.channels:
        sd = theta[posterior.space.index(f"{channel}_sd")]
        assert 0.3 < sd / np.std(start.residual[0][channel]) < 1.5
    if name == "ar1":
        assert theta[posterior.space.index("force_phi")] == pytest.approx(0.6, abs=0.15)
    assert np.isfinite(posterior.log_prob(z)[0])


def test_an_exact_curve_still_has_a_start(make_record: Callable[..., Record]) -> None:
    record = make_record(("force",), noise=0.0)
    posterior = build_posterior([record], NOISE_MODELS["independent"], DEFAULT)
    start = warm_start(posterior, np.random.default_rng(0))
    flat = replace(start, residual=({"force": np.zeros(record.n)},))
    assert np.isfinite(noise_start(posterior, flat)).all()
