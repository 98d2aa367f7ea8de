"""A condition in the order in which it was measured: branches joined, sweeps and interruptions counted."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.arrays import Floats
from sma_bayes.records.history import RATE_SAMPLES, histories, smoothed, sweep_rate
from sma_bayes.records.types import Branch, Campaign, Condition, HeldChannel, Record

UNITS = {"temperature": "degC", "time": "s", "force": "N", "displacement": "m"}
N, CYCLES = 10, 3


def record(
    branch: Branch, condition: Condition | None = None, *, timed: bool = True, pause: float = 0.0
) -> Record:
    """One branch of three cycles; a sample a second, lines of the file in order; a pause before the third cycle."""
    cooling = branch is Branch.COOLING
    cycle = np.repeat(np.arange(CYCLES), N)
    place = 2 * N * cycle + N * cooling + np.tile(np.arange(N), CYCLES)
    along = np.tile(np.arange(N, dtype=float), CYCLES)
    temperature = 25.0 + 5.0 * (N - 1.0 - along if cooling else along)
    inputs = {
        "temperature": temperature,
        "time": place + pause * (cycle == 2),
        "cycle": cycle + 1.0,
        "segment": cycle.astype(float),
    }
    if not timed:
        del inputs["time"]
    observed = {"displacement": 1e-3 * place, "force": 1.0 + 0.1 * place}
    return Record(condition or Condition("c"), branch, inputs, observed, place + 2, UNITS, source="c.csv")


def joined(*records: Record):
    return histories(Campaign("made up", "", "", records))


@pytest.mark.parametrize("timed", [True, False])
@pytest.mark.parametrize("cooling_first", [True, False])
def test_branches_are_joined_in_the_order_of_measurement(timed: bool, cooling_first: bool) -> None:
    records = [record(b, timed=timed) for b in Branch]
    (h,) = joined(*(records[::-1] if cooling_first else records))
    assert h.n == 2 * N * CYCLES
    np.testing.assert_array_equal(h.row, np.arange(h.n) + 2)
    np.testing.assert_array_equal(h.inputs["order"], np.arange(1, h.n + 1))
    np.testing.assert_array_equal(h.observed["displacement"], 1e-3 * np.arange(h.n))
    np.testing.assert_array_equal(h.inputs["branch"], np.tile(np.repeat([1.0, -1.0], N), CYCLES))
    np.testing.assert_array_equal(h.inputs["cycle"], np.repeat([1.0, 2.0, 3.0], 2 * N))
    np.testing.assert_array_equal(h.inputs["segment"], np.repeat(np.arange(2.0 * CYCLES), N))
    np.testing.assert_array_equal(h.inputs["stretch"], np.zeros(h.n))
    assert ("time" in h.inputs) is timed
    assert ("rate" in h.inputs) is timed
    assert h.channels == ("force", "displacement")


def test_the_clock_counts_not_the_line() -> None:
    """Lines in another order than the clock, as in a file that was sorted by temperature."""
    shuffled = []
    for branch in Branch:
        r = record(branch)
        order = np.random.default_rng(0).permutation(r.n)
        shuffled.append(
            replace(
                r,
                inputs={k: v[order] for k, v in r.inputs.items()},
                observed={k: v[order] for k, v in r.observed.items()},
                row=np.arange(r.n),
            )
        )
    (h,) = joined(*shuffled)
    np.testing.assert_array_equal(h.inputs["time"], np.arange(h.n))
    np.testing.assert_array_equal(h.observed["displacement"], 1e-3 * np.arange(h.n))


def test_a_pause_begins_a_stretch_and_another_file_too() -> None:
    (h,) = joined(*(record(b, pause=100.0) for b in Branch))
    np.testing.assert_array_equal(h.inputs["stretch"], np.repeat([0.0, 0.0, 1.0], 2 * N))
    (h,) = joined(*(record(b, pause=2.0) for b in Branch))
    np.testing.assert_array_equal(h.inputs["stretch"], 0.0)
    later = [replace(record(b), source="d.csv") for b in Branch]
    (h,) = joined(*(record(b) for b in Branch), *later)
    np.testing.assert_array_equal(h.inputs["stretch"], np.repeat([0.0, 1.0], 2 * N * CYCLES))
    np.testing.assert_array_equal(h.row, np.tile(np.arange(2 * N * CYCLES) + 2, 2))
    np.testing.assert_array_equal(h.inputs["segment"], np.repeat(np.arange(4.0 * CYCLES), N))


def test_a_sweep_that_is_sampled_coarsely_does_not_interrupt() -> None:
    """Heating sampled every second, cooling every half a minute."""
    fast, slow = (record(b) for b in Branch)
    period = N + 30.0 * N
    clock = {
        Branch.HEATING: period * (fast.inputs["cycle"] - 1.0) + np.tile(np.arange(N), CYCLES),
        Branch.COOLING: period * (slow.inputs["cycle"] - 1.0) + N + 30.0 * np.tile(np.arange(N), CYCLES),
    }
    (h,) = joined(*(replace(r, inputs={**r.inputs, "time": clock[r.branch]}) for r in (fast, slow)))
    np.testing.assert_array_equal(h.row, np.arange(h.n) + 2)
    np.testing.assert_array_equal(h.inputs["stretch"], 0.0)


def test_without_time_left_out_lines_interrupt() -> None:
    records = [record(b, timed=False) for b in Branch]
    moved = [replace(r, row=np.where(r.inputs["cycle"] > 1.0, r.row + 50, r.row)) for r in records]
    (h,) = joined(*moved)
    np.testing.assert_array_equal(h.inputs["stretch"], np.repeat([0.0, 1.0, 1.0], 2 * N))


def test_each_condition_has_its_own_history_and_settings() -> None:
    one = Condition("one", current=2.0, load=1.5, frequency=0.01)
    a, b = joined(*(record(br, c) for c in (one, Condition("two")) for br in Branch))
    assert (a.condition.id, b.condition.id) == ("one", "two")
    for name, value in (("current", 2.0), ("load", 1.5), ("frequency", 0.01)):
        np.testing.assert_array_equal(a.inputs[name], np.full(a.n, value))
        assert name not in b.inputs
    assert "duty_cycle" not in a.inputs


def test_the_typical_load_is_the_median_of_the_campaign() -> None:
    runs = [record(Branch.HEATING, Condition(f"{load} N", load=load)) for load in (1.0, 1.5, 4.0)]
    assert [float(h.inputs["typical_load"][0]) for h in joined(*runs)] == [1.5, 1.5, 1.5]
    unknown = record(Branch.HEATING, Condition("unknown"))
    assert all("typical_load" not in h.inputs for h in joined(unknown, *runs))


def test_noise_of_the_temperature_is_smoothed_within_sweeps() -> None:
    """Two sweeps of a parabola in time, 100 samples each: a smooth curve has some 5 free values, so the error falls by
    sqrt(100/5), to 0.22 of the noise; the turning point stays sharp. Twice that is allowed."""
    time = np.arange(200.0)
    true = np.r_[20.0 + 0.006 * time[:100] ** 2, 80.0 - 0.8 * (time[100:] - 100.0)]
    segment = np.repeat([0.0, 1.0], 100)
    noise = 0.5 * np.random.default_rng(4).standard_normal(200)
    found = smoothed(true + noise, time, segment)
    assert np.sqrt(np.mean((found - true) ** 2)) < 0.22
    np.testing.assert_allclose(smoothed(true, time, segment), true, atol=1e-6)
    same_time = np.repeat(time[::2], 2)
    np.testing.assert_array_equal(smoothed(true + noise, same_time, segment), true + noise)


def test_temperature_is_an_outcome_where_current_and_time_were_recorded() -> None:
    def driven(r: Record) -> Record:
        return replace(
            r, inputs={**r.inputs, "current": np.linspace(0.0, 2.0, r.n)}, units={**r.units, "current": "A"}
        )

    (h,) = joined(*(driven(record(b, Condition("c", current=9.0))) for b in Branch))
    np.testing.assert_allclose(h.observed["temperature"], h.inputs["temperature"], rtol=1e-12)
    assert h.inputs["current"].max() == 2.0
    (still,) = joined(*(driven(record(b, timed=False)) for b in Branch))
    assert "temperature" not in still.observed


def test_channels_of_one_branch_are_left_out_and_held_ones_told() -> None:
    heating, cooling = (record(b) for b in Branch)
    bare = replace(cooling, observed={"displacement": cooling.observed["displacement"]})
    kept = {"stiffness": HeldChannel(55.0, 0.1)}
    (h,) = joined(replace(heating, held=kept, rows_averaged=3), bare)
    assert h.channels == ("displacement",)
    assert dict(h.held) == {"stiffness": 55.0}
    assert h.averaged == 3


def test_a_part_ends_sweeps_where_samples_are_missing() -> None:
    (h,) = joined(*(record(b) for b in Branch))
    kept = np.ones(h.n, dtype=bool)
    kept[[4, 5]] = False  # inside the first sweep
    kept[2 * N : 4 * N] = False  # the second cycle
    part = h.part(kept)
    assert part.n == kept.sum()
    np.testing.assert_array_equal(part.row, h.row[kept])
    np.testing.assert_array_equal(part.observed["force"], h.observed["force"][kept])
    np.testing.assert_array_equal(part.inputs["segment"], np.repeat(np.arange(5.0), [4, 4, 10, 10, 10]))
    np.testing.assert_array_equal(part.inputs["stretch"], np.repeat([0.0, 1.0, 2.0], [4, 14, 20]))
    np.testing.assert_array_equal(part.inputs["cycle"], h.inputs["cycle"][kept])
    np.testing.assert_array_equal(part.inputs["order"], h.inputs["order"][kept])
    whole = h.part(np.ones(h.n, dtype=bool))
    for name, values in h.inputs.items():
        np.testing.assert_array_equal(whole.inputs[name], values)


def fitted_slope(t: Floats, y: Floats) -> float:
    return float(np.polyfit(t - t.mean(), y, 1)[0])


def test_the_rate_is_the_slope_of_a_line_through_neighbours_of_the_same_sweep() -> None:
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.2, 3.0, 40)) + 1e6  # a clock that has run for days
    temperature = 50.0 + rng.standard_normal(40)
    segment = np.repeat([0.0, 1.0], [25, 15])
    found = sweep_rate(temperature, time, segment)
    half = RATE_SAMPLES // 2
    for low, high in ((0, 25), (25, 40)):
        for i in range(low, high):
            near = slice(max(i - half, low), min(i + half + 1, high))
            assert found[i] == pytest.approx(fitted_slope(time[near], temperature[near]), rel=1e-8, abs=1e-10)


def test_the_rate_of_a_ramp_is_exact_and_of_nothing_0() -> None:
    (h,) = joined(*(record(b) for b in Branch))
    np.testing.assert_allclose(h.inputs["rate"], 5.0 * h.inputs["branch"], rtol=1e-12)
    np.testing.assert_array_equal(sweep_rate(np.array([20.0]), np.array([3.0]), np.zeros(1)), [0.0])
    np.testing.assert_array_equal(
        sweep_rate(np.array([20.0, 30.0]), np.array([3.0, 3.0]), np.zeros(2)), [0.0, 0.0]
    )


def test_it_pickles_and_can_not_be_changed() -> None:
    (h,) = joined(*(record(b) for b in Branch))
    h = replace(h, specimen=True, averaged=3, held={"force": 1.5})
    again = pickle.loads(pickle.dumps(h))
    assert again.condition == h.condition
    assert (again.specimen, again.averaged, again.held, again.units) == (True, 3, {"force": 1.5}, h.units)
    for name, values in h.inputs.items():
        np.testing.assert_array_equal(again.inputs[name], values)
    with pytest.raises(TypeError):
        h.inputs["time"] = np.zeros(h.n)
