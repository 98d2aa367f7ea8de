"""How samples follow each other: what a noise model knows of a record."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.noise import NOISE_MODELS, Steps
from sma_bayes.noise.ar1 import best_memory, memory_innovations, memory_log_density, memory_series
from sma_bayes.records.types import Record


def test_a_new_memory_starts_with_every_sweep(make_record: Callable[..., Record]) -> None:
    record = make_record(n=12, segments=3)
    steps = Steps.of(record)
    np.testing.assert_array_equal(np.flatnonzero(steps.first), [0, 4, 8])
    np.testing.assert_allclose(
        steps.dt[~steps.first], np.diff(record.inputs["time"])[[0, 1, 2, 4, 5, 6, 8, 9, 10]]
    )
    np.testing.assert_array_equal(steps.dt[steps.first], 1.0)
    assert steps.timed


def test_without_time_all_steps_are_one(make_record: Callable[..., Record]) -> None:
    record = make_record(n=12)
    bare = replace(record, inputs={"temperature": record.temperature})
    steps = Steps.of(bare)
    assert not steps.timed
    np.testing.assert_array_equal(steps.dt, np.ones(12))
    np.testing.assert_array_equal(np.flatnonzero(steps.first), [0])


def test_time_never_runs_backwards(make_record: Callable[..., Record]) -> None:
    record = make_record(n=5)
    inputs = {**record.inputs, "time": np.array([0.0, 1.0, 0.5, 0.5, 2.0])}
    np.testing.assert_array_equal(Steps.of(replace(record, inputs=inputs)).dt, [1.0, 1.0, 0.0, 0.0, 1.5])


def test_memory_is_taken_out_and_put_back() -> None:
    rng = np.random.default_rng(0)
    phi = np.where(np.arange(50) % 20 == 0, 0.0, rng.uniform(-0.9, 0.9, 50))
    innovations = rng.standard_normal((3, 50))
    e = memory_series(innovations, np.tile(phi, (3, 1)))
    white = memory_innovations(e, phi)
    np.testing.assert_allclose(white, innovations, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(white, memory_innovations(e, np.tile(phi, (3, 1))))
    rebuilt = white.copy()
    for i in range(1, 50):
        rebuilt[:, i] = phi[i] * rebuilt[:, i - 1] + np.sqrt(1.0 - phi[i] ** 2) * white[:, i]
    np.testing.assert_allclose(rebuilt, e, rtol=1e-12, atol=1e-12)
    density = memory_log_density(e, phi).sum(axis=1)
    expected = (-0.5 * white**2 - 0.5 * np.log(2 * np.pi * (1 - phi**2))).sum(axis=1)
    np.testing.assert_allclose(density, expected, rtol=1e-12)


@pytest.mark.parametrize("phi", [-0.5, 0.0, 0.7, 0.99])
def test_the_best_memory_is_that_of_greatest_likelihood(phi: float) -> None:
    steps = Steps(np.arange(3000) == 0, np.ones(3000), timed=False)
    noise = NOISE_MODELS["ar1"]
    residual = 2.0 * noise.draw(np.random.default_rng(1), np.array([[phi]]), steps)[0]
    candidates = np.linspace(-0.95, 0.995, 390)[:, None]
    sd, found = best_memory(noise, residual, candidates, steps)
    assert found == pytest.approx(phi, abs=0.05)
    assert sd == pytest.approx(2.0, rel=0.25)
