"""Splitting loses no row, invents none, and finds the planted cycles in any unit and under stated noise."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings, strategies as st

from sma_bayes.records.run import Run
from sma_bayes.records.segmentation import smooth, sweeps_of_temperature
from sma_bayes.records.split import SplitSettings, split_run
from sma_bayes.records.types import Branch, Condition, Finding, Record

ALL = SplitSettings(max_samples=10**7)
UNITS = {"time": "s", "temperature": "degC", "force": "N", "displacement": "m"}
seeds = st.integers(0, 2**32 - 1)


def planted(rows: int, cycles: int, sinusoidal: bool) -> np.ndarray:
    """Temperature between 0 and 1, `rows` readings a branch."""
    phase = np.arange(2 * rows * cycles + 1) / rows
    if sinusoidal:
        return 0.5 - 0.5 * np.cos(np.pi * phase)
    return 1.0 - np.abs(1.0 - phase % 2.0)


def spoilt_run(seed: int, rows: int, cycles: int) -> Run:
    """Cycles with holds, a start in mid-branch, noise, held samples, drop-outs, spikes and missing values."""
    rng = np.random.default_rng(seed)
    temperature = 20.0 + 70.0 * planted(rows, cycles, bool(rng.integers(2)))[rng.integers(rows) :]
    temperature = np.r_[np.full(rng.integers(300), temperature[0]), temperature]
    temperature = np.repeat(temperature, rng.integers(1, 4)) + 0.0
    temperature += rng.normal(0.0, rng.choice([0.0, 0.1, 1.0]), temperature.size)
    n = temperature.size
    force = 1.0 / (1.0 + np.exp(-0.4 * (temperature - 55.0))) + rng.normal(0.0, 0.01, n)
    time = np.cumsum(rng.choice([0.1, 1.0], n))
    for column, value in (
        (temperature, 0.0),
        (temperature, np.nan),
        (force, np.nan),
        (force, 9.0),
        (time, 3.0),
    ):
        column[rng.choice(n, rng.integers(4), replace=False)] = value
    columns = {"time": time, "temperature": temperature, "force": force, "displacement": rng.normal(size=n)}
    return Run(Condition("a"), "a.csv", np.arange(1, n + 1), columns, UNITS)


def rows_kept(records: tuple[Record, ...]) -> np.ndarray:
    return np.concatenate([record.row for record in records])


def rows_dropped(findings: tuple[Finding, ...]) -> int:
    return sum(finding.dropped for finding in findings)


@settings(max_examples=80, deadline=None, derandomize=True)
@given(seeds, st.integers(30, 80), st.integers(1, 4))
def test_every_row_is_in_one_record_or_in_one_finding(seed: int, rows: int, cycles: int) -> None:
    run = spoilt_run(seed, rows, cycles)
    records, findings = split_run(run, ALL)
    kept = rows_kept(records)
    assert np.unique(kept).size == kept.size
    assert kept.size + rows_dropped(findings) == run.n
    for record in records:
        at = record.row - 1
        np.testing.assert_array_equal(record.temperature, run.columns["temperature"][at])
        for channel in record.channels:
            np.testing.assert_array_equal(record.observed[channel], run.columns[channel][at])
        same_sweep = np.diff(record.inputs["segment"]) == 0
        assert np.all(np.diff(record.row)[same_sweep] > 0)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(seeds, st.integers(30, 80), st.integers(1, 4), st.integers(20, 100))
def test_averaging_keeps_the_accounts_and_the_means(seed: int, rows: int, cycles: int, most: int) -> None:
    run = spoilt_run(seed, rows, cycles)
    whole, _ = split_run(run, ALL)
    short, findings = split_run(run, SplitSettings(max_samples=most))
    averaged = {f.branch: f.count for f in findings if f.kind == "reduced"}
    for record, full in zip(short, whole, strict=True):
        assert averaged.get(record.branch.value, record.n) == full.n
        assert set(record.row.tolist()) <= set(full.row.tolist())
        at = np.searchsorted(full.row, record.row)
        told = {f.kind for f in findings if f.branch == record.branch.value}
        if full.n > most:
            assert told & {"reduced", "not-reduced"}
            assert np.all(np.diff(at) <= record.rows_averaged)
        share = np.diff(np.r_[at, full.n]) / full.n
        np.testing.assert_allclose(share @ record.temperature, full.temperature.mean(), rtol=1e-9)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    seeds,
    st.integers(30, 80),
    st.integers(1, 3),
    st.sampled_from([-273.15, -40.0, 0.25, 1e3]),
    st.sampled_from([1.8, 1e-3, 1e4]),
)
def test_neither_origin_nor_unit_of_the_temperature_matters(
    seed: int, rows: int, cycles: int, shift: float, scale: float
) -> None:
    rng = np.random.default_rng(seed)
    temperature = 300.0 + 70.0 * planted(rows, cycles, bool(rng.integers(2)))
    temperature = np.r_[np.full(50, temperature[0]), temperature] + rng.normal(
        0.0, 0.3, temperature.size + 50
    )
    force = 1.0 / (1.0 + np.exp(-0.4 * (temperature - 335.0)))
    found = []
    for values in (temperature, temperature + shift, temperature * scale):
        run = Run(
            Condition("a"), "a.csv", np.arange(values.size), {"temperature": values, "force": force}, UNITS
        )
        records, findings = split_run(run, ALL)
        # that a sweep is narrow or in kelvin is told from degrees, which shifted and scaled values only claim to be
        degrees = ("narrow-sweep", "kelvin")
        told = [(f.kind, f.rows, f.dropped) for f in findings if f.kind not in degrees]
        found.append(([r.row.tolist() for r in records], told))
    assert found[0] == found[1] == found[2]


@settings(max_examples=60, deadline=None, derandomize=True)
@given(seeds, st.integers(0, 3), st.booleans())
def test_planted_cycles_are_found_under_noise(seed: int, kind: int, sinusoidal: bool) -> None:
    """The bound that `segmentation` states, in units of the span of a sweep."""
    rng = np.random.default_rng(seed)
    rows, noise = [(4, 0.03), (12, 0.03), (50, 0.1), (400, 0.1)][kind]
    rows, cycles = int(rows * rng.uniform(1.0, 2.0)), int(rng.integers(1, 9))
    temperature = planted(rows, cycles, sinusoidal)
    temperature += rng.normal(0.0, noise * rng.uniform(), temperature.size)
    found = sweeps_of_temperature(smooth(temperature))
    assert [s.heating for s in found] == [True, False] * cycles
    off = [abs(s.start - k * rows) / rows for k, s in enumerate(found) if k]
    assert max(off) <= 0.5


@settings(max_examples=30, deadline=None, derandomize=True)
@given(seeds, st.integers(12, 60), st.integers(1, 4), st.integers(1, 12))
def test_held_samples_change_nothing_but_the_number_of_rows(
    seed: int, rows: int, cycles: int, held: int
) -> None:
    temperature = 20.0 + 70.0 * planted(rows, cycles, True)
    temperature += np.random.default_rng(seed).normal(0.0, 0.5, temperature.size)
    once = sweeps_of_temperature(smooth(temperature))
    many = sweeps_of_temperature(smooth(np.repeat(temperature, held)))
    assert [s.heating for s in many] == [s.heating for s in once]
    assert [abs(m.start - held * s.start) < held for m, s in zip(many, once, strict=True)] == [True] * len(
        once
    )


@settings(max_examples=30, deadline=None, derandomize=True)
@given(seeds, st.integers(20, 60), st.integers(1, 3))
def test_backwards_in_time_heating_is_cooling(seed: int, rows: int, cycles: int) -> None:
    temperature = 20.0 + 70.0 * planted(rows, cycles, False)
    temperature += np.random.default_rng(seed).normal(0.0, 0.2, temperature.size)
    force = 1.0 / (1.0 + np.exp(-0.4 * (temperature - 55.0)))
    counts = []
    for step in (1, -1):
        columns = {"temperature": temperature[::step], "force": force[::step]}
        run = Run(Condition("a"), "a.csv", np.arange(temperature.size), columns, UNITS)
        counts.append({r.branch: r.n for r in split_run(run, ALL)[0]})
    assert abs(counts[0][Branch.HEATING] - counts[1][Branch.COOLING]) <= 2 * cycles + 1
