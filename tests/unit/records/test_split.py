"""A run to its records: what is kept, what is counted, and that real measurements come out right."""

from __future__ import annotations

import pickle
import time
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import curve_fit

from sma_bayes.errors import MeasurementError
from sma_bayes.records.run import Run
from sma_bayes.records.split import SplitSettings, split_run
from sma_bayes.records.types import Branch, Calibration, Condition, Finding, Record

UNITS = {
    "time": "s", "temperature": "degC", "force": "N", "displacement": "m", "stiffness": "N/m", "current": "A",
    "ambient_temperature": "degC", "drive": "1", "cycle": "1", "branch": "1",
}  # fmt: skip
ALL = SplitSettings(max_samples=10**7)


def make_run(file: str = "rig-1.csv", specimen: bool = False, **columns: np.ndarray) -> Run:
    """Run with these columns; line 1 of the file is a header."""
    n = columns["temperature"].size
    columns = {name: np.asarray(values, dtype=float) for name, values in columns.items()}
    units = {name: UNITS[name] for name in columns}
    return Run(Condition("rig-1"), file, np.arange(2, n + 2), columns, units, specimen)


def triangle(rows: int, cycles: float = 1.0) -> np.ndarray:
    """Temperature from 20 to 90 degC and back, `rows` rows a branch."""
    phase = np.arange(round(2 * rows * cycles) + 1) / rows % 2.0
    return 20.0 + 70.0 * (1.0 - np.abs(1.0 - phase))


def force_at(temperature: np.ndarray, at: float = 55.0) -> np.ndarray:
    return 0.5 + 0.7 / (1.0 + np.exp(-0.4 * (temperature - at)))


def spring(rows: int = 100, cycles: float = 2.0, noise: float = 0.002) -> dict[str, np.ndarray]:
    temperature = triangle(rows, cycles)
    rng = np.random.default_rng(17)
    return {
        "time": np.arange(temperature.size) * 0.5,
        "temperature": temperature + rng.normal(0.0, 0.02, temperature.size),
        "force": force_at(temperature) + rng.normal(0.0, noise, temperature.size),
    }


def split(run: Run, settings: SplitSettings = ALL) -> tuple[dict[str, Record], list[Finding]]:
    """Records by branch, after the accounts have been checked."""
    records, findings = split_run(run, settings)
    reduced = {f.branch: f.count for f in findings if f.kind == "reduced"}
    kept = sum(reduced.get(r.branch.value, r.n) for r in records)
    assert kept + sum(f.dropped for f in findings) == run.n
    assert all(f.file == run.file and f.condition == run.condition.id for f in findings)
    assert all(f.dropped in (0, f.count) for f in findings)
    return {r.branch.value: r for r in records}, list(findings)


def kinds(findings: list[Finding]) -> set[str]:
    return {f.kind for f in findings}


def dropped(findings: list[Finding], kind: str) -> int:
    return sum(f.dropped for f in findings if f.kind == kind)


# the plain case


def test_two_cycles_become_one_record_a_branch() -> None:
    run = make_run(**spring())
    records, findings = split(run)
    assert [(b, r.n) for b, r in records.items()] == [("heating", 201), ("cooling", 200)]
    assert findings == []
    heating = records["heating"]
    assert heating.channels == ("force",)
    assert set(heating.inputs) == {"temperature", "time", "cycle", "segment"}
    assert np.unique(heating.inputs["cycle"]).tolist() == [1.0, 2.0]
    assert np.unique(heating.inputs["segment"]).tolist() == [1.0, 3.0]
    assert np.unique(records["cooling"].inputs["segment"]).tolist() == [2.0, 4.0]
    assert heating.rows_averaged == 1
    assert heating.units["cycle"] == "1"
    np.testing.assert_array_equal(heating.temperature, run.columns["temperature"][heating.row - 2])
    np.testing.assert_array_equal(heating.inputs["time"], run.columns["time"][heating.row - 2])


def test_records_carry_what_the_run_knew_and_survive_pickling() -> None:
    columns = spring()
    run = Run(
        Condition("c", load=3.0), "c.csv", np.arange(10, 10 + columns["time"].size), columns,
        {n: UNITS[n] for n in columns}, temperature_sd=0.3, calibration={"force": Calibration(0.02, 0.1, 0.01)},
    )  # fmt: skip
    heating = pickle.loads(pickle.dumps(split(run)[0]["heating"]))
    assert heating.condition == Condition("c", load=3.0)
    assert (heating.source, heating.temperature_sd, heating.specimen) == ("c.csv", 0.3, False)
    assert heating.calibration["force"] == Calibration(0.02, 0.1, 0.01)
    assert heating.branch is Branch.HEATING


def test_default_settings() -> None:
    run = make_run(**spring())
    assert [r.n for r in split_run(run)[0]] == [r.n for r in split_run(run, SplitSettings())[0]]


# sweeps


def test_one_branch_is_fitted_alone_and_said() -> None:
    columns = {name: values[:100] for name, values in spring().items()}
    columns["temperature"] = columns["temperature"] + 0.1234
    records, findings = split(make_run(**columns))
    assert list(records) == ["heating"]
    (only,) = findings
    assert only.kind == "one-branch"
    assert "from 20.15 °C to 89.42 °C" in only.message


def test_part_cycles_are_dropped_or_kept_by_their_span() -> None:
    columns = {name: values[20:545] for name, values in spring(cycles=3).items()}  # 80 %, ..., 45 %
    records, findings = split(make_run(**columns))
    assert records["cooling"].n == pytest.approx(245, abs=3)
    (part,) = (f for f in findings if f.kind == "part-cycle")
    assert (part.dropped, part.branch) == (0, "cooling")
    columns = {name: values[20:525] for name, values in spring(cycles=3).items()}  # the last: 25 %
    records, findings = split(make_run(**columns))
    assert dropped(findings, "part-cycle") == pytest.approx(25, abs=3)
    strict = SplitSettings(max_samples=10**6, min_span=0.9)
    assert dropped(split(make_run(**columns), strict)[1], "part-cycle") == pytest.approx(105, abs=4)


def test_loading_at_constant_temperature_before_the_first_sweep_goes() -> None:
    columns = spring(100, 2)
    before = 600
    rng = np.random.default_rng(0)
    columns["temperature"] = np.r_[20.0 + rng.normal(0.0, 0.05, before), columns["temperature"]]
    columns["force"] = np.r_[np.linspace(0.0, 0.5, before), columns["force"]]
    columns["time"] = np.arange(columns["force"].size) * 0.5
    records, findings = split(make_run(**columns))
    assert dropped(findings, "hold") == pytest.approx(before + 5 - 18, abs=3)
    assert records["heating"].row.min() > 2 + before - 20


def test_an_explicit_branch_column_is_believed_and_contradictions_are_told() -> None:
    columns = spring()
    branch = np.where(np.arange(401) // 100 % 2 == 0, 1.0, -1.0)
    branch[:7] = np.nan
    branch[[100, 200]] = 0.0
    branch[300:] = 1.0
    records, findings = split(make_run(**columns, branch=branch))
    assert records["heating"].n == 93 + 99 + 101
    assert dropped(findings, "no-branch") == 7 + 2
    assert "branch-contradicted" in kinds(findings)


def test_an_explicit_cycle_column_numbers_the_cycles() -> None:
    columns = spring()
    cycle = np.where(np.arange(401) <= 200, 11.0, 12.0)
    cycle[5] = np.nan
    records, _ = split(make_run(**columns, cycle=cycle))
    assert np.unique(records["cooling"].inputs["cycle"]).tolist() == [11.0, 12.0]


def test_the_drive_finds_sweeps_that_noise_hides() -> None:
    columns = spring(60, 3)
    rng = np.random.default_rng(2)
    drive = (np.arange(361) // 60 % 2 == 0) * 5.0
    columns["temperature"] = columns["temperature"] + rng.normal(0.0, 4.0, 361)
    records, findings = split(make_run(**columns, drive=drive))
    assert "drive-ignored" not in kinds(findings)
    starts = [
        records["heating"].row[records["heating"].inputs["segment"] == s].min() for s in (1.0, 3.0, 5.0)
    ]
    assert starts == pytest.approx([2, 122, 242], abs=1)
    assert "drive" not in records["heating"].inputs


def test_a_current_that_is_switched_is_a_drive_and_a_steady_one_is_not() -> None:
    columns = spring(60, 2)
    switched = (np.arange(241) // 60 % 2 == 0) * 2.0
    switched[-1] = 0.0
    records, findings = split(make_run(**columns, current=switched))
    assert set(records["heating"].inputs) >= {"current"}
    assert findings == []
    assert list(split(make_run(**columns, current=np.full(241, 2.0)))[0]) == ["heating", "cooling"]


def test_a_drive_that_explains_nothing_is_ignored_and_said() -> None:
    drive = np.tile(np.repeat([0.0, 1.0], 10), 21)[:401]
    records, findings = split(make_run(**spring(), drive=drive))
    assert kinds(findings) == {"drive-ignored"}
    assert records["heating"].n == 201


def test_a_clock_that_starts_again_begins_a_new_stretch() -> None:
    one = spring(100, 1)
    columns = {name: np.r_[values, values] for name, values in one.items()}
    columns["force"][201:] += 1e-4
    records, findings = split(make_run(**columns))
    assert "time-restart" in kinds(findings)
    assert np.unique(records["heating"].inputs["segment"]).tolist() == [1.0, 3.0]
    assert records["heating"].n + records["cooling"].n == 402


# rows


def test_spoilt_rows_are_kept_out_each_for_one_reason() -> None:
    columns = spring()
    temperature, force, clock = columns["temperature"], columns["force"], columns["time"]
    temperature[[10, 11]] = np.nan
    temperature[50] = np.inf
    temperature[[140, 143]] = 0.0
    temperature[260] += 40.0
    force[70] = np.nan
    force[330] += 0.4
    clock[300] = 1.0
    for name in columns:
        columns[name] = np.insert(columns[name], 220, columns[name][219])
    records, findings = split(make_run(**columns))
    assert {(f.kind, f.column): f.dropped for f in findings} == {
        ("missing", "temperature"): 3, ("duplicate", ""): 1, ("time-reversal", "time"): 1,
        ("drop-out", "temperature"): 2, ("spike", "temperature"): 1, ("missing", "force"): 1,
        ("spike", "force"): 1,
    }  # fmt: skip
    rows = {(f.kind, f.column): f.rows for f in findings}
    assert rows["drop-out", "temperature"] == (142, 145)
    assert rows["duplicate", ""] == (222,)
    assert rows["spike", "force"] == (333,)
    assert all(np.isfinite(r.observed["force"]).all() for r in records.values())


def test_rows_without_a_clock_or_ambient_reading_are_kept_out() -> None:
    columns = spring()
    columns["time"][5] = np.nan
    ambient = np.full(401, 24.0)
    ambient[[7, 8]] = np.nan
    records, findings = split(make_run(**columns, ambient_temperature=ambient))
    assert {f.column: f.dropped for f in findings} == {"time": 1, "ambient_temperature": 2}
    assert "ambient_temperature" in records["heating"].inputs


def test_inputs_that_most_rows_lack_are_left_out() -> None:
    columns = spring()
    columns["time"][np.arange(401) % 4 != 0] = np.nan
    records, findings = split(make_run(**columns))
    assert "time" not in records["heating"].inputs
    assert [(f.kind, f.dropped) for f in findings] == [("sparse-input", 0)]


def test_digits_clipping_gaps_and_equal_stamps_are_only_reported() -> None:
    columns = spring(200, 1)
    columns["time"] = np.floor(columns["time"] / 2.0)
    columns["time"][300:] += 1000.0
    columns["temperature"] = np.round(triangle(200), 1)
    columns["force"] = np.minimum(np.round(force_at(triangle(200)), 2), 0.9)
    records, findings = split(make_run(**columns))
    assert {f.kind for f in findings} == {"repeated-time", "quantised", "clipped", "gap"}
    assert sum(r.n for r in records.values()) == 401


@pytest.mark.parametrize(("step", "said"), [(0.0, True), (0.5, True), (4.0, False)])
def test_a_thermometer_that_stands_still_and_catches_up_is_told(step: float, said: bool) -> None:
    """Whatever the display resolves; neither holds nor a display that is coarser than the pause are mistaken for it."""
    columns = spring(rows=150)
    shown = columns["temperature"] + np.random.default_rng(4).normal(0.0, 0.05, columns["temperature"].size)
    shown = np.round(shown / step) * step if step else shown
    _, findings = split(make_run(**{**columns, "temperature": shown}))
    assert "stuck" not in kinds(findings)
    shown[60 : 85 if said else 66] = shown[60]
    _, findings = split(make_run(**{**columns, "temperature": shown}))
    found = [f for f in findings if f.kind == "stuck"]
    assert bool(found) is said
    if said:
        assert found[0].dropped == 0
        assert found[0].rows[-1] - found[0].rows[0] == 4
        assert set(found[0].rows) <= set(range(58, 70))
        assert "declare that reading as `missing`" in found[0].message


def test_no_transformation_is_said() -> None:
    columns = spring()
    columns["force"] = 3.0 + 0.05 * columns["temperature"]
    records, findings = split(make_run(**columns))
    assert [(f.kind, f.branch) for f in findings] == [
        ("no-transformation", "heating"),
        ("no-transformation", "cooling"),
    ]
    assert records["heating"].n == 201


@pytest.mark.parametrize(("width", "said"), [(4.0, True), (6.0, False)])
def test_a_temperature_that_hardly_varies_is_said(width: float, said: bool) -> None:
    """As where a wire is drawn at one temperature, which drifts while it is."""
    columns = spring(noise=1e-4)
    columns["temperature"] = 40.0 + (columns["temperature"] - 20.0) * width / 70.0
    columns["force"] = force_at(columns["temperature"], 40.0 + 0.5 * width)
    _, findings = split(make_run(**columns))
    assert ("narrow-sweep" in kinds(findings)) == said


# channels


def test_a_constant_load_is_held_in_both_branches_and_said() -> None:
    columns = spring()
    columns["displacement"] = 0.03 - 0.02 * columns["force"]
    columns["force"] = 5.0 + np.random.default_rng(1).normal(0.0, 0.1, 401)
    records, findings = split(make_run(**columns))
    for record in records.values():
        assert record.channels == ("displacement",)
        assert record.held["force"].mean == pytest.approx(5.0, abs=0.05)
        assert record.held["force"].sd == pytest.approx(0.1, rel=0.2)
        assert record.units["force"] == "N"
    assert kinds(findings) == {"constant-load"}
    assert "says nothing about the spring" in findings[0].message


def test_a_load_whose_control_lapses_is_held_and_told_not_to_be_constant() -> None:
    columns = spring()
    temperature = columns["temperature"]
    columns["displacement"] = 0.03 - 0.02 * columns["force"]
    columns["force"] = 98.0 + 29.0 * np.exp(-(((temperature - 55.0) / 4.0) ** 2))
    records, findings = split(make_run(**columns))
    assert records["heating"].channels == ("displacement",)
    assert kinds(findings) == {"load-not-constant"}
    told = SplitSettings(fit_channels=("force", "displacement"), max_samples=10**6)
    records, _ = split(make_run(**columns), told)
    assert records["heating"].channels == ("force", "displacement")
    assert dict(records["heating"].held) == {}


def test_a_channel_that_the_user_leaves_out_is_held() -> None:
    columns = spring()
    columns["displacement"] = 0.03 - 0.02 * columns["force"]
    records, findings = split(make_run(**columns), SplitSettings(fit_channels=("force",), max_samples=10**6))
    assert records["heating"].channels == ("force",)
    assert set(records["heating"].held) == {"displacement"}
    assert kinds(findings) == {"not-fitted"}


# reduction


def test_long_branches_are_averaged_and_said() -> None:
    run = make_run(**spring(3000, 2))
    records, findings = split(run, SplitSettings())
    heating = records["heating"]
    assert 200 <= heating.n <= 400
    assert heating.rows_averaged == 16
    (reduced,) = (f for f in findings if f.branch == "heating" and f.kind == "reduced")
    assert reduced.count == 6001
    assert str(heating.n) in reduced.message
    assert str(reduced.count) in reduced.message
    start, stop = heating.row[10] - 2, heating.row[11] - 2
    for name in ("temperature", "time"):
        assert heating.inputs[name][10] == pytest.approx(run.columns[name][start:stop].mean())
    assert heating.observed["force"][10] == pytest.approx(run.columns["force"][start:stop].mean())
    assert np.unique(heating.inputs["segment"]).tolist() == [1.0, 3.0]


def test_rows_too_far_apart_to_be_averaged_stay_and_it_is_said() -> None:
    records, findings = split(make_run(**spring(30, 3)), SplitSettings(max_samples=50))
    assert records["heating"].n == 91
    assert {(f.kind, f.count, f.dropped) for f in findings} == {
        ("not-reduced", 91, 0),
        ("not-reduced", 90, 0),
    }


# bad input


def test_constant_temperature_is_an_error_with_file_and_column() -> None:
    columns = spring()
    columns["temperature"] = 50.0 + np.random.default_rng(0).normal(0.0, 0.1, 401)
    with pytest.raises(
        MeasurementError, match=r"rig-1.csv, column 'temperature'.*temperature is constant but"
    ) as e:
        split_run(make_run(**columns))
    assert e.value.remedy
    with pytest.raises(MeasurementError, match="constant"):
        split_run(make_run(temperature=np.full(50, 20.0), force=np.arange(50.0)))


@pytest.mark.parametrize("rows", [0, 1, 4, 9])
def test_too_few_rows_are_an_error(rows: int) -> None:
    temperature = np.linspace(20.0, 90.0, rows)
    with pytest.raises(MeasurementError, match=r"rows? with a usable temperature"):
        split_run(make_run(temperature=temperature, force=force_at(temperature)))


def test_a_branch_with_too_few_rows_is_left_out() -> None:
    temperature = np.r_[np.linspace(20.0, 90.0, 60), np.linspace(80.0, 20.0, 7)]
    records, findings = split(make_run(temperature=temperature, force=force_at(temperature)))
    assert list(records) == ["heating"]
    assert dropped(findings, "few-samples") == 7
    assert "one-branch" in kinds(findings)


def test_no_branch_with_enough_rows_is_an_error_that_says_what_was_kept_out() -> None:
    columns = spring(12, 1)
    columns["force"][::2] = np.nan
    columns["force"][1:9] = np.nan
    with pytest.raises(MeasurementError, match=r"no branch has 10 usable rows .*kept out: no force"):
        split_run(make_run(**columns), SplitSettings(fit_channels=("force",)))


def test_jumps_between_two_temperatures_are_no_sweeps() -> None:
    temperature = np.tile(np.repeat([20.0, 90.0], 2), 20)
    with pytest.raises(MeasurementError, match="constant but for noise"):
        split_run(make_run(temperature=temperature, force=np.arange(80.0)))


def test_missing_columns_are_an_error() -> None:
    columns = spring()
    with pytest.raises(MeasurementError, match="'displacement'"):
        split_run(make_run(**columns), SplitSettings(fit_channels=("displacement",)))
    with pytest.raises(MeasurementError, match="has the columns temperature"):
        split_run(make_run(temperature=columns["temperature"]))
    with pytest.raises(MeasurementError, match="no channel has values"):
        split_run(make_run(temperature=columns["temperature"], force=np.full(401, np.nan)))


@pytest.mark.parametrize(
    "wrong",
    [
        {"fit_channels": ("forc",)}, {"fit_channels": ()}, {"max_samples": 5}, {"min_samples": 3},
        {"block_span": 0.0}, {"turn_fraction": 1.0}, {"min_span": float("nan")}, {"hold_share": -1.0},
    ],
)  # fmt: skip
def test_wrong_settings_are_an_error(wrong: dict[str, object]) -> None:
    with pytest.raises(MeasurementError):
        SplitSettings(**wrong)  # type: ignore[arg-type]


def test_long_runs_are_split_fast() -> None:
    run = make_run(**spring(15_000, 1))
    begin = time.process_time()
    split_run(run)
    assert time.process_time() - begin < 0.3


# measurements by other people


def columns_of(path: Path, **options: object) -> np.ndarray:
    return np.loadtxt(path, **options)  # type: ignore[call-overload, no-any-return]


@pytest.mark.parametrize(("stress", "rows"), [(50, 166), (100, 167), (150, 171), (200, 167)])
def test_flexinol_has_one_cycle_at_constant_stress(shared_data: Path, stress: int, rows: int) -> None:
    table = columns_of(shared_data / "flexinol_isobaric" / f"isobaric_{stress}MPa.txt")
    run = make_run(temperature=table[:, 0], displacement=table[:, 1], force=table[:, 2] * 1e6, specimen=True)
    records, findings = split(run)
    blips = dropped(findings, "spike")  # one strain at 50 MPa is 12 standard deviations off its neighbours
    assert blips == (1 if stress == 50 else 0)
    assert {b: r.n for b, r in records.items()} == {"heating": rows, "cooling": 499 - rows - blips}
    assert records["heating"].held["force"].mean == pytest.approx(stress * 1e6, rel=0.01)
    assert "constant-load" in kinds(findings)


@pytest.mark.parametrize(("stress", "gap_row"), [(7, None), (50, None), (150, 272), (200, 244)])
def test_nitico_cools_first_and_its_gaps_are_told(
    shared_data: Path, stress: int, gap_row: int | None
) -> None:
    table = columns_of(shared_data / "smareact_nitico_isobaric" / f"{stress} MPa.txt")
    run = make_run(temperature=table[:, 0], displacement=table[:, 1], force=table[:, 2] * 1e6, specimen=True)
    records, findings = split(run)
    assert records["cooling"].inputs["segment"][0] == 1.0
    assert records["heating"].inputs["segment"][0] == 2.0
    assert records["heating"].n + records["cooling"].n == run.n
    assert "constant-load" in kinds(findings)
    # row numbers of `make_run` count a header line
    assert [f.rows[0] for f in findings if f.kind == "gap"] == ([gap_row + 1] if gap_row else [])


def test_seven_training_cycles(shared_data: Path) -> None:
    lines = (shared_data / "smareact_isobaric_7cycle" / "isobaric_7cycle.txt").read_text().splitlines()
    table = np.array([[float(cell) for cell in line.strip('"').split(",")] for line in lines[6:]])
    run = make_run(
        time=table[:, 0] * 3600.0, temperature=table[:, 3], force=table[:, 1], displacement=table[:, 4] * 1e-3
    )
    records, findings = split(run)
    for branch, first in (("cooling", 1), ("heating", 2)):
        assert np.unique(records[branch].inputs["segment"]).tolist() == [first + 2 * k for k in range(7)]
        assert np.unique(records[branch].inputs["cycle"]).tolist() == [1, 2, 3, 4, 5, 6, 7]
        assert 290 <= records[branch].n <= 310
        assert records[branch].held["force"].mean == pytest.approx(1095.0, abs=2.0)
    # of the ten zeros two lie on the line between their neighbours, as true readings would
    assert dropped(findings, "drop-out") == 8
    assert dropped(findings, "hold") == pytest.approx(566, abs=3)


GUARNEROS_HEATING = {0: 41.79, 1: 42.39, 2: 42.62, 3: 42.58}


@pytest.mark.parametrize("number", range(4))
@pytest.mark.parametrize("driven", [True, False])
def test_a_joule_heated_spring(shared_data: Path, number: int, driven: bool) -> None:
    path = shared_data / "guarneros_spring_force" / "raw" / f"AB{number}.csv"
    table = columns_of(path, delimiter=",", skiprows=1)
    columns = {
        "time": table[:, 0] * 0.01, "temperature": table[:, 1], "ambient_temperature": table[:, 2],
        "force": 7.486899 - 0.008694436 * table[:, 3],
    }  # fmt: skip
    if driven:
        columns["drive"] = table[:, 4]
    records, findings = split(make_run(**columns), SplitSettings())
    heating, cooling = records["heating"], records["cooling"]
    assert heating.row.min() == pytest.approx(820, abs=220)
    assert heating.row.max() == pytest.approx(2800, abs=250)
    assert cooling.row.min() == pytest.approx(2800, abs=250)
    assert cooling.row.max() > 15_000
    assert ("stray-drive" in kinds(findings)) == driven
    assert {heating.n > 300, cooling.n > 300, heating.n <= 400, cooling.n <= 400} == {True}
    assert kinds(findings) >= {"hold", "quantised", "reduced"}

    def curve(t: np.ndarray, b1: float, b2: float, b3: float, b4: float) -> np.ndarray:
        return b1 / (1.0 + np.exp(-b2 * (t - b3))) + b4

    best, _ = curve_fit(curve, heating.temperature, heating.observed["force"], [0.7, 0.4, 42.0, 0.5])
    assert best[2] == pytest.approx(GUARNEROS_HEATING[number], abs=0.15)


@pytest.mark.parametrize(("stress", "zeros", "off"), [(100, 45, 0), (80, 19, 123)])
def test_a_load_frame_that_loses_its_load(shared_data: Path, stress: int, zeros: int, off: int) -> None:
    path = shared_data / "niti_raw_isobaric" / f"raw_{stress}MPa.csv"
    table = columns_of(path, delimiter=",", skiprows=1)
    run = make_run(
        time=table[:, 0], temperature=table[:, 2], force=table[:, 1], displacement=table[:, 3] * 0.0254
    )
    records, findings = split(run)
    assert records["cooling"].inputs["segment"][0] == 1.0
    assert records["heating"].channels == ("displacement",)
    assert dropped(findings, "drop-out") == zeros
    assert dropped(findings, "load-off") == off
    assert "load-not-constant" in kinds(findings)
    assert all((r.temperature != 0.0).sum() >= r.n - 8 for r in records.values())


@pytest.mark.parametrize(("stress", "cooling"), [(100, 27), (300, 27)])
def test_a_few_points_picked_by_hand(shared_data: Path, stress: int, cooling: int) -> None:
    path = shared_data / "nitihf_sparse_isobaric" / f"filtered_data_{stress}MPa.txt"
    table = columns_of(path, skiprows=1)
    records, findings = split(make_run(temperature=table[:, 0], displacement=table[:, 1] / 100.0))
    assert {b: r.n for b, r in records.items()} == {"heating": 28, "cooling": cooling}
    assert records["heating"].inputs["segment"][0] == 1.0
    assert dropped(findings, "duplicate") == (1 if stress == 100 else 0)


def test_a_wire_in_turbulent_water_has_several_sweeps(shared_data: Path) -> None:
    table = columns_of(shared_data / "wire_in_water" / "ele_hys_1.txt")
    run = make_run(temperature=table[:, 2], displacement=table[:, 1] * 1e-3)
    records, findings = split(run)
    assert records["heating"].inputs["segment"].max() >= 2
    assert records["cooling"].inputs["segment"].max() >= 3
    assert "part-cycle" in kinds(findings)


@pytest.mark.parametrize(
    "name", [f"ele_hys_{k}" for k in range(1, 6)] + ["hyd_stp_1", "hyd_stp_3", "hyd_stp_5"]
)
def test_every_wire_run_closes_its_accounts(shared_data: Path, name: str) -> None:
    text = (shared_data / "wire_in_water" / f"{name}.txt").read_bytes().decode()
    table = np.array([[float(c) for c in line.split()] for line in text.splitlines() if line.strip()])
    records, _ = split(make_run(temperature=table[:, 2], displacement=table[:, 1] * 1e-3))
    assert records
