"""Curve and numbers of sweeps, on sweeps whose curve is not one of the package's."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from sma_bayes.errors import MeasurementError
from sma_bayes.records.types import Branch, Record
from sma_bayes.studies.cycles.sweeps import Strand, fit_strand, sweeps_of


@pytest.fixture(scope="module")
def truth(training_spring: ModuleType) -> Any:
    return training_spring.draw_truth(np.random.default_rng(3), 12)


@pytest.fixture(scope="module")
def measured(training_spring: ModuleType) -> Callable[..., list[Record]]:
    measure: Callable[..., list[Record]] = training_spring.measured
    return measure


def strand(record: Record, channel: str = "displacement", model: str = "sinh_arcsinh") -> Strand:
    sweeps, cycle, told = sweeps_of(record, channel)
    assert told == []
    return fit_strand(sweeps, channel, cycle, model, 0)


def test_numbers_come_back_against_each_other(truth: Any, measured: Callable[..., list[Record]]) -> None:
    """Differences between cycles, in standard deviations: mean square 1 within 3 sd of its 44 degrees of freedom."""
    for record in measured(truth, np.random.default_rng(4)):
        found = strand(record)
        assert found.converged
        assert found.noise / found.range < 0.006
        true = truth.sweep[record.branch]
        z = (found.numbers - found.numbers.mean(axis=0) - (true - true.mean(axis=0))) / found.sds
        assert np.mean(z**2) < 1.0 + 3.0 * np.sqrt(2.0 / 44.0)
        assert np.mean(z**2) > 0.3


def test_a_richer_curve_is_taken_where_it_is_earned(
    truth: Any, measured: Callable[..., list[Record]]
) -> None:
    record = measured(truth, np.random.default_rng(4))[0]
    plain, chosen = strand(record, model="modified_sigmoid"), strand(record, model="auto")
    assert chosen.model.name != "modified_sigmoid"
    assert chosen.noise < 0.6 * plain.noise


def test_standard_deviations_allow_for_the_memory_of_what_is_left(
    truth: Any, measured: Callable[..., list[Record]]
) -> None:
    """AR(1) noise with a correlation of 0.8 makes numbers about three times as uncertain as it seems."""
    rng = np.random.default_rng(5)
    record = measured(truth, rng, noise=0.0)[0]
    n = record.n
    noise = np.empty(n)
    noise[0] = 0.0
    for i in range(1, n):
        noise[i] = 0.8 * noise[i - 1] + 0.6 * rng.standard_normal()
    read = record.observed["displacement"] + 0.004 * 0.02 * noise
    found = strand(replace(record, observed={"displacement": read}))
    assert 0.6 < found.lag1_correlation < 0.85
    true = truth.sweep[record.branch]
    z = (found.numbers - found.numbers.mean(axis=0) - (true - true.mean(axis=0))) / found.sds
    assert 0.3 < np.mean(z**2) < 2.0


def test_short_and_double_sweeps_are_left_out_and_named(
    truth: Any, measured: Callable[..., list[Record]]
) -> None:
    record = measured(truth, np.random.default_rng(4))[0]
    segment, cycle = np.array(record.inputs["segment"]), np.array(record.inputs["cycle"])
    segment[:5] = 100.0  # five samples of cycle 1
    segment[80:95] = 101.0  # fifteen of cycle 3, interrupted
    changed = replace(record, inputs={**record.inputs, "segment": segment, "cycle": cycle})
    sweeps, cycles, told = sweeps_of(changed, "displacement")
    assert cycles.tolist() == list(range(1, 13))
    assert sweeps.n == record.n - 20
    assert "fewer than 8 samples" in told[0]
    assert "cycle 1" in told[0]
    assert "more samples is taken: cycle 3" in told[1]


def test_a_level_channel_has_no_curve(truth: Any, measured: Callable[..., list[Record]]) -> None:
    record = measured(truth, np.random.default_rng(4))[0]
    level = replace(record, observed={"displacement": np.full(record.n, 0.01)})
    with pytest.raises(MeasurementError, match="no curve"):
        strand(level)


def test_the_branches_are_told_apart(truth: Any, measured: Callable[..., list[Record]]) -> None:
    heating, cooling = (strand(r) for r in measured(truth, np.random.default_rng(4)))
    assert heating.record.branch is Branch.HEATING
    assert heating.middle - cooling.middle == pytest.approx(
        15.0 + np.mean(truth.sweep[Branch.HEATING] - truth.sweep[Branch.COOLING], axis=0)[2], abs=1.5
    )
