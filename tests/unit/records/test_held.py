"""Response or held: loads that are constant, drift, lapse, come on late; channels that the user chooses."""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.records.held import (
    Course,
    Leg,
    choose_channels,
    course,
    courses,
    held_channels,
    keep_out_load_off,
    note_held,
    responds,
    rows_of,
)
from sma_bayes.records.ledger import Ledger
from sma_bayes.records.run import Run
from sma_bayes.records.types import Branch, Condition

ROWS = 300
T = np.r_[np.linspace(20.0, 90.0, ROWS), np.linspace(90.0, 20.0, ROWS)]
LEGS = [
    Leg(Branch.HEATING, np.arange(ROWS), 1, 1),
    Leg(Branch.COOLING, np.arange(ROWS, 2 * ROWS), 1, 2),
]
X = 0.02 / (1.0 + np.exp(0.4 * (T - 55.0)))
RNG = np.random.default_rng(12)
NOISE = RNG.normal(size=T.size)


def ledger(**columns: np.ndarray) -> Ledger:
    columns = {"temperature": T, **columns}
    units = {"temperature": "degC", "force": "N", "displacement": "m", "stiffness": "N/m"}
    return Ledger(Run(Condition("a"), "a.csv", np.arange(1, T.size + 1), columns, units))


def chosen(**columns: np.ndarray) -> tuple[str, ...]:
    return choose_channels(ledger(**columns), LEGS, None, 0.05)


def test_course_of_a_sigmoid_of_noise_and_of_a_line() -> None:
    sigmoid = course(T, X)
    assert sigmoid.monotone == pytest.approx(1.0, abs=1e-6)
    assert sigmoid.straight < 0.95
    assert sigmoid.rise == pytest.approx(-0.02, rel=0.01)
    assert course(T, NOISE).monotone < 0.4
    line = course(T, 3.0 * T)
    assert line.straight == pytest.approx(1.0)
    assert course(T, np.full(T.size, 7.0)) == Course(0.0, 0.0, 0.0, 7.0, 7.0)


def test_a_response_is_seen_through_sample_noise_larger_than_itself() -> None:
    temperature = np.tile(T, 50)
    force = np.tile(10.0 + 100.0 * X, 50) + 3.0 * np.random.default_rng(0).normal(size=temperature.size)
    assert course(temperature, force).monotone > 0.9


@pytest.mark.parametrize(
    "load",
    [
        50.0 + 4.0 * NOISE,  # noisy
        50.0 + 1e-3 * np.arange(T.size) + 0.1 * NOISE,  # drifts with time
        50.0 + 0.005 * (T - 20.0) + 0.05 * NOISE,  # follows the temperature by less than 5 %
        50.0 + 15.0 * np.exp(-(((T - 60.0) / 3.0) ** 2)),  # control lapses during the transformation
        np.full(T.size, 50.0),
    ],
)
def test_a_held_load_is_not_fitted(load: np.ndarray) -> None:
    assert chosen(force=load, displacement=X) == ("displacement",)


def test_force_and_displacement_that_both_answer_are_fitted() -> None:
    assert chosen(force=3.0 - 50.0 * X, displacement=X) == ("force", "displacement")


def test_a_length_that_is_held_is_not_fitted() -> None:
    assert chosen(force=3.0 - 50.0 * X, displacement=1e-5 * NOISE) == ("force",)


def test_opposite_directions_are_a_drift_and_not_a_response() -> None:
    up, down = Course(0.9, 0.5, 2.0, 0.0, 2.0), Course(0.9, 0.5, -2.0, 0.0, 2.0)
    assert responds("force", {Branch.HEATING: up, Branch.COOLING: up}, 1.0, 0.05)
    assert not responds("force", {Branch.HEATING: up, Branch.COOLING: down}, 1.0, 0.05)
    assert responds("force", {Branch.HEATING: up}, 1.0, 0.05)
    assert not responds("force", {Branch.HEATING: up}, 100.0, 0.05)
    assert responds("displacement", {Branch.HEATING: up}, 100.0, 0.05)
    assert not responds("force", {}, 1.0, 0.05)


def test_where_nothing_answers_one_channel_is_fitted_all_the_same() -> None:
    assert chosen(displacement=1e-5 * NOISE) == ("displacement",)
    assert len(chosen(force=50.0 + NOISE, displacement=1e-5 * NOISE)) == 1


def test_the_user_is_obeyed() -> None:
    book = ledger(force=50.0 + NOISE, displacement=X)
    assert choose_channels(book, LEGS, ("force",), 0.05) == ("force",)
    assert choose_channels(book, LEGS, ("displacement", "force"), 0.05) == ("force", "displacement")


def test_a_channel_that_is_mostly_missing_is_left_out_with_a_finding() -> None:
    stiffness = np.where(np.arange(T.size) % 3 == 0, 100.0 * X, np.nan)
    book = ledger(stiffness=stiffness, displacement=X)
    assert choose_channels(book, LEGS, None, 0.05) == ("displacement",)
    assert [(f.kind, f.column) for f in book.findings] == [("sparse-channel", "stiffness")]


def test_a_load_that_comes_on_late_and_goes_off_early_is_cut_at_both_ends_only() -> None:
    load = 80.0 + 0.1 * NOISE
    load[:25] = 58.0
    load[-20:] = np.linspace(70.0, 2.0, 20)
    load[140:180] = 110.0  # control lapses in mid-sweep
    book = ledger(force=load, displacement=X)
    assert choose_channels(book, LEGS, None, 0.05) == ("displacement",)
    keep_out_load_off(book, LEGS)
    assert np.flatnonzero(~book.kept).tolist() == [*range(25), *range(580, 600)]
    assert [(f.kind, f.dropped, f.rows[0]) for f in book.findings] == [("load-off", 45, 1)]


def test_noise_of_a_load_is_no_load_off() -> None:
    book = ledger(force=50.0 + 4.0 * NOISE, displacement=X)
    keep_out_load_off(book, LEGS)
    assert book.kept.all()


@pytest.mark.parametrize("overflow", [30.0, 9999.0, 9.9e8])
def test_one_reading_far_out_neither_hides_a_response_nor_moves_the_mean_of_a_held_load(
    overflow: float,
) -> None:
    answers, load = 3.0 - 50.0 * X + 0.01 * NOISE, 50.0 + 0.1 * NOISE
    answers[150], load[150] = 3.0 + overflow, 50.0 + 50.0 * overflow
    assert chosen(force=answers, displacement=X) == ("force", "displacement")
    book = ledger(force=load, displacement=X)
    assert choose_channels(book, LEGS, None, 0.05) == ("displacement",)
    assert held_channels(book.run, rows_of(LEGS), ("displacement",))["force"].mean == pytest.approx(
        50.0, abs=0.05
    )
    note_held(book, LEGS, "force", told=False, min_change=0.05)
    assert [(f.kind, f.rows) for f in book.findings] == [("spike", (151,)), ("constant-load", ())]


def test_courses_leave_out_where_the_load_comes_on() -> None:
    load = np.full(T.size, 80.0)
    load[:25] = 20.0
    along = courses(ledger(force=load, displacement=X).run, LEGS, "force")
    assert along[Branch.HEATING].low == 80.0
    assert set(along) == {Branch.HEATING, Branch.COOLING}
