"""Curve and numbers of sweeps, on sweeps whose curve is not one of the package's."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from sma_bayes.errors import MeasurementError
from sma_bayes.records.types import Branch, Calibration, Record
from sma_bayes.studies.cycles.sweeps import Strand, calibration_remarks, fit_strand, sweeps_of


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


def deviations(found: Strand, silent: Record) -> np.ndarray:
    """Numbers less those of the same sweeps without noise about the same curve, in standard deviations."""
    quiet, cycle, _ = sweeps_of(silent, found.channel)
    return np.asarray((found.numbers - found.about(quiet, cycle).numbers) / found.sds)


def test_numbers_and_curves_come_back(
    training_spring: ModuleType, truth: Any, measured: Callable[..., list[Record]]
) -> None:
    """Mean squares of 96 deviations, 1 within 4 sd; curves within 1 % of the stroke of the true ones."""
    z = []
    for record in measured(truth, np.random.default_rng(4)):
        found = strand(record)
        assert found.converged
        assert found.noise / found.range < 0.006
        t = np.linspace(25.0, 90.0, 50)
        true = training_spring.curve(truth.sweep[record.branch], t, record.branch, "displacement")
        assert np.abs(found.curve(found.numbers, t) - true).max() < 0.015 * found.span
        exact = training_spring.curve(
            np.repeat(truth.sweep[record.branch], training_spring.SAMPLES, axis=0),
            record.temperature[:, None], record.branch, "displacement",
        )[:, 0]  # fmt: skip
        z.append(deviations(found, replace(record, observed={"displacement": exact})))
    assert np.mean(np.square(z)) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / 96.0))


@pytest.mark.parametrize("model", ["modified_sigmoid", "sinh_arcsinh", "auto"])
def test_what_a_model_misses_of_all_sweeps_is_in_the_common_curve(
    truth: Any, measured: Callable[..., list[Record]], model: str
) -> None:
    """What is left is the noise, 0.4 % of the span, less what was fitted; the plain sigmoid misses 1.3 % by itself."""
    record = measured(truth, np.random.default_rng(4))[0]
    found = strand(record, model=model)
    assert 0.0034 * 0.02 < found.noise < 0.0046 * 0.02
    plain = replace(found, missed=None, weights=None)
    t = np.linspace(25.0, 90.0, 50)
    if model == "modified_sigmoid":
        assert np.std(found.curve(found.numbers, t) - plain.curve(found.numbers, t)) > 0.005 * found.span


def test_standard_deviations_allow_for_the_memory_of_what_is_left(
    truth: Any, measured: Callable[..., list[Record]]
) -> None:
    """AR(1) noise with a correlation of 0.8: mean square of the deviations of eight records.

    One record's scatters by some 0.5 (12 sweeps, numbers that go together, a memory that is estimated), so the mean of
    eight is within 0.7 of 1 but once in 10,000 times. Without the memory it would be 4 or more.
    """
    found = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        record = measured(truth, rng, noise=0.0)[0]
        noise = lfilter([0.6], [1.0, -0.8], rng.standard_normal(record.n))
        read = record.observed["displacement"] + 0.004 * 0.02 * noise
        noisy = strand(replace(record, observed={"displacement": read}))
        found.append((noisy.lag1_correlation, np.mean(deviations(noisy, record) ** 2)))
    memory, square = np.mean(found, axis=0)
    assert memory == pytest.approx(0.8, abs=0.1)
    assert square == pytest.approx(1.0, abs=0.7)


@pytest.mark.parametrize(
    ("model", "shapes"), [("modified_sigmoid", 0), ("sinh_arcsinh", 2), ("phase_slopes", 2)]
)
def test_errors_of_the_curve_are_what_numbers_of_the_sweeps_can_not_follow(
    truth: Any, measured: Callable[..., list[Record]], model: str, shapes: int
) -> None:
    """Parameters beyond offset, amplitude, rate and midpoint change the shape; numbers follow by least squares.

    What an error leaves of a sweep once its numbers have followed is orthogonal to what each of these does to it.
    """
    record = measured(truth, np.random.default_rng(4))[0]
    found = strand(record, model=model)
    assert found.shape.shape == (found.free.size, shapes)
    assert found.weights is not None
    assert found.responses is not None
    assert found.responses.shape == (12, 4, len(found.weights.axes) + shapes)
    one = found.errors(1, np.random.default_rng(0))
    assert one is not None
    size, moved = 1e-3, found.responses @ one[0]
    for i, own in enumerate(np.split(np.arange(record.n), found.starts[1:])):
        t = record.temperature[own]

        def curve(by: np.ndarray, error: float, i: int = i, t: np.ndarray = t) -> np.ndarray:
            return found.curve((found.numbers[i] + by)[None], t, error * one)[0]

        left = (curve(size * moved[i], size) - curve(-size * moved[i], -size)) / (2.0 * size)
        alone = (curve(np.zeros(4), size) - curve(np.zeros(4), -size)) / (2.0 * size)
        for number in 1e-4 * np.eye(4):
            does = curve(number, 0.0) - curve(-number, 0.0)
            assert abs(left @ does) < 0.01 * np.linalg.norm(alone) * np.linalg.norm(does)


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


def test_what_no_interval_of_a_sweep_holds_is_told(measured: Callable[..., list[Record]], truth: Any) -> None:
    records = measured(truth, np.random.default_rng(0))
    exact = {"temperature": Calibration(0.0, 0.0, 0.0)}
    off = {"temperature": Calibration(0.0, 0.0, 1.0), "displacement": Calibration(0.01, 0.0, 0.0)}
    assert calibration_remarks(records) == []
    assert calibration_remarks(replace(r, calibration=exact) for r in records) == []
    (told,) = calibration_remarks(replace(r, calibration=off) for r in records)
    assert told.startswith("what the calibration of temperature and displacement is off by")
