"""The curve of the measured sweeps is sampled; that of all sweeps is given back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.arrays import Floats
from sma_bayes.fitting.fit_records import fit_records
from sma_bayes.fitting.mean_sweep import of_all_sweeps, of_measured_sweeps
from sma_bayes.fitting.noise_choice import choose_noise, noise_start, posterior_with
from sma_bayes.fitting.posterior import Posterior, build_posterior
from sma_bayes.fitting.warm_start import WarmStart, warm_start
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.types import Branch, Condition, Record
from sma_bayes.sampling.factors import sample_by_factors

DEFAULT = read_priors("modified_sigmoid")
SWEEPS = 6


def measured(apart: float, seed: int = 1, condition: str = "a") -> Record:
    """Force and displacement in sweeps, each of which has an offset, a stroke and a place of its own."""
    rng, t = np.random.default_rng([seed, 79]), np.linspace(20.0, 80.0, 30)
    observed: dict[str, list[Floats]] = {"force": [], "displacement": []}
    for offset, stroke, place in apart * rng.standard_normal((SWEEPS, 3)):
        for found, at, size in zip(observed.values(), (52.0, 50.0), (2.5, 0.02), strict=True):
            x = 1.0 / (1.0 + np.exp(-0.2 * (t - at - place))) + 0.05 * np.sin(0.2 * t)
            found.append(
                size * (0.2 + 0.02 * offset + (1.0 + 0.03 * stroke) * x + 0.004 * rng.standard_normal(t.size))
            )
    inputs = {
        "temperature": np.tile(t, SWEEPS),
        "time": np.arange(float(SWEEPS * t.size)),
        "segment": np.repeat(np.arange(float(SWEEPS)), t.size),
    }
    units = {"temperature": "degC", "time": "s", "force": "N", "displacement": "m"}
    rows = np.arange(SWEEPS * t.size) + 2
    joined = {channel: np.concatenate(found) for channel, found in observed.items()}
    return Record(Condition(condition), Branch.HEATING, inputs, joined, rows, units)


def described(records: list[Record]) -> tuple[Posterior, Floats, WarmStart]:
    """Posterior with what stands beside the curve, and where sampling begins."""
    first = build_posterior(records, NOISE_MODELS["independent"], DEFAULT)
    start = warm_start(first, np.random.default_rng(0))
    choice = choose_noise(first, start, DEFAULT, noise="independent", sweeps=True)
    posterior = posterior_with("independent", first, start, DEFAULT, choice)
    return posterior, noise_start(posterior, start, choice), start


def test_both_posteriors_are_the_same_where_the_curve_is_nearly_linear() -> None:
    """Of 3,400 draws and more, each within 5 standard errors: means, standard deviations, ln Z."""
    posterior, start, _ = described([measured(0.4)])
    sampled = of_measured_sweeps(posterior)
    assert sampled is not posterior
    width, rng = posterior.space.prior_sd(), np.random.default_rng(3)
    plain = sample_by_factors(posterior, [start], width, np.random.SeedSequence(1))
    of_measured = sample_by_factors(sampled, [start], width, np.random.SeedSequence(2))
    moved = of_all_sweeps(of_measured, sampled, start, rng)
    assert plain.convergence.converged
    assert moved.convergence.converged
    assert moved.ln_evidence == pytest.approx(plain.ln_evidence, abs=0.1)
    one, other = (d.z.reshape(-1, d.z.shape[-1]) for d in (plain, moved))
    curve = posterior.sampled_model.size
    assert (other.mean(axis=0) - one.mean(axis=0)) / one.std(axis=0) == pytest.approx(0.0, abs=0.15)
    assert other.std(axis=0) / one.std(axis=0) == pytest.approx(1.0, abs=0.1)
    # what is sampled is known better, by more than the sizes of what stands beside the curve are
    within = of_measured.z.reshape(-1, one.shape[1]).std(axis=0)[:curve]
    assert np.all(within < 0.8 * one.std(axis=0)[:curve])


def test_the_mean_over_all_sweeps_is_as_uncertain_as_so_few_of_them_leave_it() -> None:
    fit = fit_records([measured(1.0)], DEFAULT, noise="independent")
    assert fit.converged
    posterior = fit.posterior
    own = posterior.discrepancy[0]["displacement"].sweep_functions
    assert own is not None
    assert own.change is not None
    at = posterior.model.parameter_names.index("A4")
    between = fit.flat[:, posterior.layout[0].between["displacement"]]
    of_few = np.sqrt(np.mean(between**2) / SWEEPS) * np.linalg.norm(own.change[at])
    assert of_few < fit.flat[:, at].std() < 1.2 * of_few


def test_records_that_share_a_curve_are_left_as_they_are() -> None:
    posterior, *_ = described([measured(1.0), measured(1.0, seed=2, condition="b")])
    assert any(b.sweep_functions is not None for bases in posterior.discrepancy for b in bases.values())
    assert of_measured_sweeps(posterior) is posterior


def test_channels_whose_sweeps_change_the_same_parameter_are_left_as_they_are() -> None:
    posterior, *_ = described([measured(1.0)])
    shared = {}
    for channel, basis in posterior.discrepancy[0].items():
        assert basis.sweep_functions is not None
        assert basis.sweep_functions.change is not None
        own = replace(basis.sweep_functions, change=np.ones_like(basis.sweep_functions.change))
        shared[channel] = replace(basis, sweep_functions=own)
    posterior = replace(posterior, discrepancy=(shared,))
    assert of_measured_sweeps(posterior) is posterior


def test_sweeps_that_are_alike_are_left_as_they_are() -> None:
    posterior, start, _ = described([measured(0.0)])
    assert of_measured_sweeps(posterior) is posterior
    draws = sample_by_factors(posterior, [start], posterior.space.prior_sd(), np.random.SeedSequence(1))
    assert of_all_sweeps(draws, posterior, start, np.random.default_rng(0)) is draws
