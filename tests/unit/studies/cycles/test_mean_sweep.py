"""Numbers about the mean sweep, by hand, and whatever common curve they were about before."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

from sma_bayes.records.types import Branch
from sma_bayes.response import RESPONSE_MODELS
from sma_bayes.studies.cycles.mean_sweep import about_mean_sweep, mean_sweep
from sma_bayes.studies.cycles.sweeps import Strand, fit_strand, sweeps_of

AMPLITUDE, RATE, MIDPOINT, OFFSET = 0.02, 0.3, 60.0, 0.001
NUMBERS = np.array([[0.02, -0.1, 3.0, 0.2], [-0.05, 0.05, -1.0, -0.1], [0.0, 0.1, 0.5, 0.05]])
EVERY = np.arange(3)


@pytest.fixture(scope="module")
def strand(training_spring: ModuleType) -> Strand:
    """A sigmoid between 20 and 95 °C that stands, with three sweeps."""
    truth = training_spring.draw_truth(np.random.default_rng(3), 3)
    record = training_spring.measured(truth, np.random.default_rng(4))[0]
    model = RESPONSE_MODELS["modified_sigmoid"].made_for((record,))
    theta = np.zeros(len(model.parameter_names))
    theta[[model.parameter_names.index(n) for n in ("A1", "A2", "A3", "A4")]] = (
        AMPLITUDE,
        RATE,
        MIDPOINT,
        OFFSET,
    )
    none = np.zeros((3, 4))
    starts = np.array([0, 40, 80])
    return Strand(
        record, "displacement", starts, np.arange(3.0), NUMBERS, none, model, theta, np.arange(4),
        OFFSET + 0.5 * AMPLITUDE, AMPLITUDE, MIDPOINT,
    )  # fmt: skip


def test_about_a_curve_with_level_plateaus_the_numbers_are_less_their_means(strand: Strand) -> None:
    """Plateaus are level to 1e-4 of the span at the ends, so that level, span and middle are those of the sigmoid."""
    found = about_mean_sweep(strand, NUMBERS[None], None, EVERY)[0]
    _, _, d, w = (NUMBERS - NUMBERS.mean(axis=0)).T
    assert found[:, 0] == pytest.approx(strand.level + AMPLITUDE * NUMBERS[:, 0], abs=2e-4 * AMPLITUDE)
    assert found[:, 1] == pytest.approx(AMPLITUDE * np.exp(NUMBERS[:, 1]), rel=2e-4)
    assert found[:, 2] == pytest.approx(d, abs=2e-3)
    assert found[:, 3] == pytest.approx(np.exp(w), rel=1e-12)


def test_the_same_sweeps_about_another_common_curve_have_the_same_numbers(strand: Strand) -> None:
    """A curve that is stretched, moved and wider, and sweeps that are all less so by as much."""
    stretched, later, wider, raised = 1.3, 4.0, 1.25, 0.004
    theta = np.array(strand.theta)
    names = list(strand.model.parameter_names)
    for name, value in {
        "A1": AMPLITUDE * stretched, "A2": RATE / wider, "A3": MIDPOINT + later, "A4": OFFSET + raised,
    }.items():  # fmt: skip
        theta[names.index(name)] = value
    level, span = OFFSET + raised + 0.5 * AMPLITUDE * stretched, AMPLITUDE * stretched
    other = replace(strand, theta=theta, level=level, span=span, middle=MIDPOINT + later)
    a, g, d, w = NUMBERS.T
    numbers = np.column_stack([
        (strand.level + AMPLITUDE * a - level) / span, g - np.log(stretched), d - later, w - np.log(wider)
    ])  # fmt: skip
    t = np.linspace(*strand.ends, 50)
    assert other.curve(numbers, t) == pytest.approx(strand.curve(NUMBERS, t), abs=1e-12)
    here, there = (
        about_mean_sweep(s, n[None], None, EVERY)[0] for s, n in ((strand, NUMBERS), (other, numbers))
    )
    assert there == pytest.approx(here, rel=1e-9, abs=1e-9)


def test_errors_of_the_curve_move_the_mean_sweep(training_spring: ModuleType) -> None:
    """Level, span and middle of each draw are those of its own curve."""
    truth = training_spring.draw_truth(np.random.default_rng(3), 6)
    record = training_spring.measured(truth, np.random.default_rng(4), ends=(45.0, 70.0))[0]
    sweeps, cycle, _ = sweeps_of(record, "displacement")
    found = fit_strand(sweeps, "displacement", cycle, "modified_sigmoid", 0)
    errors = found.errors(50, np.random.default_rng(0))
    assert errors is not None
    mean = mean_sweep(found, np.broadcast_to(found.numbers, (50, 6, 4)), errors, np.arange(6))
    at = np.column_stack([np.tile(found.ends, (50, 1)), mean.middle])
    low, high, halfway = found.curve(mean.numbers, at, errors).T
    assert found.record.branch is Branch.HEATING
    assert mean.level == pytest.approx(0.5 * (low + high))
    assert mean.span == pytest.approx(high - low)
    assert halfway == pytest.approx(mean.level, abs=1e-9 * found.span)
    assert np.std(mean.span) > 1e-4 * found.span
