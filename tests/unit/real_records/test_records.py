"""What is held out of a record, and what its readings scatter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from real_records.records import (
    EXAMPLES,
    SETS,
    held_out_blocks,
    held_out_ends,
    held_out_sweeps,
    measured_records,
    scatter_of_readings,
)

from sma_bayes.records.types import Record

MakeRecord = Callable[..., Record]


def test_every_example_is_a_set() -> None:
    assert set(SETS) == {path.stem for path in EXAMPLES.glob("*.toml")}


@pytest.mark.parametrize("n", [18, 27, 100, 331])
def test_inner_samples_are_held_out_once_and_the_ends_apart(make_record: MakeRecord, n: int) -> None:
    record = make_record(n=n)
    inner = np.sum(held_out_blocks(record), axis=0)
    ends = np.sum(held_out_ends(record), axis=0)
    assert set((inner + ends).tolist()) == {1}
    assert ends[0] == ends[-1] == 1
    assert 1 <= ends.sum() <= 0.15 * n
    assert all(0 < mask.sum() < n / 2 for mask in held_out_blocks(record))


def test_blocks_are_of_neighbours(make_record: MakeRecord) -> None:
    """20 blocks of 5 samples, the inner 18 in five folds: no fold has more than 4 runs."""
    for mask in held_out_blocks(make_record(n=100)):
        runs = np.diff(np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]]))))[::2]
        assert runs.tolist() == [5] * len(runs)
        assert len(runs) in (3, 4)


def test_sweeps_are_held_out_where_there_are_several(make_record: MakeRecord) -> None:
    assert held_out_sweeps(make_record(segments=2)) == []
    several = make_record(n=60, segments=4)
    assert [int(mask.sum()) for mask in held_out_sweeps(several)] == [15] * 4


@pytest.mark.parametrize("even", [True, False])
def test_the_scatter_of_readings_is_the_noise(make_record: MakeRecord, even: bool) -> None:
    record = make_record(n=2000, noise=0.002, channels=("force",))
    t = np.linspace(30.0, 70.0, 2000)
    if not even:
        t = np.sort(np.random.default_rng(1).uniform(30.0, 70.0, 2000))
    noise = 0.005 * np.random.default_rng(2).standard_normal(t.size)
    y = 1.0 + 2.0 / (1.0 + np.exp(-0.3 * (t - 50.0))) + noise
    again = replace(record, inputs={"temperature": t}, observed={"force": y})
    assert scatter_of_readings(again, "force") == pytest.approx(0.005, rel=0.08)


def test_outliers_and_the_order_of_the_samples_do_not_change_the_scatter(make_record: MakeRecord) -> None:
    record = make_record(n=400, noise=0.01, channels=("force",))
    spoiled = record.observed["force"].copy()
    spoiled[::40] += 5.0
    order = np.random.default_rng(0).permutation(record.n)
    shuffled = replace(
        record, inputs={"temperature": record.temperature[order]}, observed={"force": spoiled[order]}
    )
    plain = scatter_of_readings(record, "force")
    assert scatter_of_readings(shuffled, "force") == pytest.approx(plain, rel=0.25)


def test_rounded_readings_still_scatter(make_record: MakeRecord) -> None:
    """Where most neighbours agree to the last digit the median is zero."""
    record = make_record(n=300, noise=0.0, channels=("force",))
    rounded = np.round(record.observed["force"], 1)
    assert scatter_of_readings(replace(record, observed={"force": rounded}), "force") > 0.0


def test_each_cycle_is_a_record_of_its_own(shared_data: Path) -> None:
    found = {m.key: m for m in measured_records(shared_data)}
    assert {m.example for m in found.values()} == set(SETS)
    cycles = [m for key, m in found.items() if "cycle" in key.partition("/")[2]]
    assert len(cycles) == 14
    assert all(m.sweeps == 1 for m in cycles)
    whole = found["smareact_isobaric_7cycle/1096N-heating"]
    assert whole.sweeps == 7
    assert sum(m.record.n for m in cycles if m.record.branch == "heating") == whole.record.n
