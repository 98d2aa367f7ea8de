"""One condition from several files, clocks, decimal commas and settings in columns: as the same data in one file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sma_bayes.errors import SmaBayesError
from sma_bayes.records.campaign import read_campaign
from sma_bayes.records.severity import severity
from sma_bayes.records.types import Campaign

T = np.r_[np.linspace(25.0, 90.0, 120), np.linspace(90.0, 25.0, 120)]
RNG = np.random.default_rng(0)
F = 0.5 + 2.5 / (1.0 + np.exp(-0.3 * (T - 55.0))) + 0.01 * RNG.standard_normal(T.size)
X = 1.0 + 20.0 / (1.0 + np.exp(-0.25 * (T - 50.0))) + 0.05 * RNG.standard_normal(T.size)
S = 0.5 * np.arange(T.size)
COLUMNS = {"time_s": S, "temperature_C": T, "force_N": F, "displacement_mm": X}


def write(path: Path, columns: dict[str, object], *, delimiter: str = ",", decimal: str = ".") -> None:
    def cell(value: object) -> str:
        return value if isinstance(value, str) else f"{value:.5f}".replace(".", decimal)

    rows = zip(*columns.values(), strict=True)
    lines = [delimiter.join(columns), *(delimiter.join(map(cell, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def rows(columns: dict[str, np.ndarray], keep: slice) -> dict[str, object]:
    return {name: values[keep] for name, values in columns.items()}


def declared(folder: Path, file: str, more: str = "") -> Campaign:
    (folder / "campaign.toml").write_text(
        f'{more}\n[[condition]]\nid = "c"\nfile = {file}\n', encoding="utf-8"
    )
    return read_campaign(folder)


@pytest.fixture
def whole(tmp_path: Path) -> Campaign:
    folder = tmp_path / "whole"
    folder.mkdir()
    write(folder / "c.csv", COLUMNS)
    return read_campaign(folder / "c.csv")


def same(found: Campaign, expected: Campaign, tolerance: float = 1e-12) -> None:
    for a, b in zip(found.records, expected.records, strict=True):
        assert a.branch is b.branch
        assert a.temperature == pytest.approx(b.temperature, abs=tolerance)
        for channel in b.channels:
            assert a.observed[channel] == pytest.approx(b.observed[channel], abs=1e-12)


def kinds(campaign: Campaign) -> dict[str, str]:
    return {f.kind: f.message for f in campaign.findings}


@pytest.mark.parametrize(
    "file", ['["up.csv", "down.csv"]', '"*.csv"', '["up.*", "down.*"]', '"{here}/*.csv"']
)
def test_heating_and_cooling_in_files_of_their_own(tmp_path: Path, whole: Campaign, file: str) -> None:
    write(tmp_path / "up.csv", rows(COLUMNS, slice(0, 120)))
    again = rows(COLUMNS, slice(120, None)) | {"time_s": S[:120]}  # the clock begins again
    write(tmp_path / "down.csv", again)
    found = declared(tmp_path, file.replace("{here}", tmp_path.as_posix()))
    assert sorted(r.branch.value for r in found.records) == ["cooling", "heating"]
    assert "one after the other" in kinds(found)["joined"]
    assert "goes on where the one before ended" in kinds(found)["joined"]
    assert sum(r.n for r in found.records) == sum(r.n for r in whole.records)


def test_a_channel_a_file(tmp_path: Path, whole: Campaign) -> None:
    for name in ("temperature_C", "force_N", "displacement_mm"):
        write(tmp_path / f"c_{name}.csv", {"time_s": S, name: COLUMNS[name]})
    found = declared(tmp_path, '"c_*.csv"')
    same(found, whole)
    assert "joined at the 240 times" in kinds(found)["joined"]


def test_two_loggers_with_other_headers_and_rates(tmp_path: Path, whole: Campaign) -> None:
    fine = np.linspace(0.0, S[-1], 10 * (S.size - 1) + 1)
    write(tmp_path / "bath.csv", {"ms": 1000 * fine, "Temp": np.interp(fine, S, T)})
    write(tmp_path / "frame.csv", {"sec": S, "F": F, "X": X})
    more = """
[columns]
time = [{ name = "ms", unit = "ms", file = "bath*" }, { name = "sec", unit = "s", file = "frame.csv" }]
temperature = { name = "Temp", unit = "degC" }
force = { name = "F", unit = "N" }
displacement = { name = "X", unit = "mm" }
"""
    found = declared(tmp_path, '["bath.csv", "frame.csv"]', more)
    same(found, whole, tolerance=1e-5)
    assert "temperature of bath.csv at 240 of them" in kinds(found)["joined"]


def test_loggers_that_did_not_run_together(tmp_path: Path) -> None:
    write(tmp_path / "a.csv", {"time_s": S + 1e6, "temperature_C": T})
    write(tmp_path / "b.csv", {"time_s": S, "force_N": F})
    with pytest.raises(SmaBayesError, match="nothing to join") as caught:
        declared(tmp_path, '["a.csv", "b.csv"]')
    assert "offset" in str(caught.value)


def test_files_without_a_time_can_not_be_joined(tmp_path: Path) -> None:
    write(tmp_path / "a.csv", {"temperature_C": T})
    write(tmp_path / "b.csv", {"force_N": F})
    with pytest.raises(SmaBayesError, match="has no time"):
        declared(tmp_path, '["a.csv", "b.csv"]')


def test_a_channel_is_not_interpolated_where_its_logger_was_silent(tmp_path: Path) -> None:
    write(tmp_path / "t.csv", {"time_s": S, "temperature_C": T, "displacement_mm": X})
    write(tmp_path / "f.csv", {"time_s": S[:200], "force_N": F[:200]})
    found = declared(tmp_path, '["t.csv", "f.csv"]')
    assert sum(r.n for r in found.records) == 200
    silent = np.r_[0:60, 90:240]
    write(tmp_path / "t.csv", {"time_s": S[silent], "temperature_C": T[silent]})
    write(tmp_path / "f.csv", {"time_s": S, "force_N": F})
    write(tmp_path / "x.csv", {"time_s": S, "displacement_mm": X})
    found = declared(tmp_path, '["t.csv", "f.csv", "x.csv"]')
    assert sum(r.n for r in found.records) <= 211


def test_a_semicolon_file_with_decimal_commas_needs_no_word(tmp_path: Path, whole: Campaign) -> None:
    write(tmp_path / "c.csv", COLUMNS, delimiter=";", decimal=",")
    found = read_campaign(tmp_path / "c.csv")
    same(found, whole)
    assert "decimal-comma" in kinds(found)


def test_thousands_that_may_be_decimals_stay_an_error(tmp_path: Path) -> None:
    lines = ["temperature_C;force_N", *(f"{t:.0f};1,{i:03d}" for i, t in enumerate(T))]
    (tmp_path / "c.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    with pytest.raises(SmaBayesError, match="found '1,000'") as caught:
        read_campaign(tmp_path / "c.csv")
    assert 'decimal = ","' in str(caught.value)


@pytest.mark.parametrize("text", ["#N/A", "n/a"])
def test_not_available_is_missing_and_counted(tmp_path: Path, text: str) -> None:
    force = [text if i in (20, 150) else f"{v:.4f}" for i, v in enumerate(F)]
    write(tmp_path / "c.csv", {"temperature_C": T, "force_N": force})
    found = read_campaign(tmp_path / "c.csv")
    assert f"2 cells with a missing-value code ({text})" in kinds(found)["missing-code"]
    assert sum(f.dropped for f in found.findings) == 2


@pytest.mark.parametrize("header", ["timestamp", "Time", "time_s"])
def test_a_clock_gives_seconds_from_the_first_reading(tmp_path: Path, whole: Campaign, header: str) -> None:
    clock = [f"23:{59 if s < 60 else 60}:{s % 60:06.3f}".replace("23:60", "00:00") for s in S]
    write(tmp_path / "c.csv", {header: clock, "temperature_C": T, "force_N": F, "displacement_mm": X})
    found = read_campaign(tmp_path / "c.csv")
    same(found, whole)
    for a, b in zip(found.records, whole.records, strict=True):
        assert a.inputs["time"] == pytest.approx(b.inputs["time"], abs=1e-6)


def test_a_declared_clock_needs_no_unit_and_numbers_do(tmp_path: Path) -> None:
    more = (
        '[columns]\ntime = { name = "t" }\ntemperature = { name = "T", unit = "degC" }\n'
        'force = { name = "F", unit = "N" }'
    )
    clock = [f"2024-05-01T12:{int(s) // 60:02d}:{s % 60:06.3f}" for s in S]
    write(tmp_path / "c.csv", {"t": clock, "T": T, "F": F})
    assert declared(tmp_path, '"c.csv"', more).records[0].inputs["time"][1] == pytest.approx(0.5)
    write(tmp_path / "c.csv", {"t": S, "T": T, "F": F})
    with pytest.raises(SmaBayesError, match="no unit") as caught:
        declared(tmp_path, '"c.csv"', more)
    assert "key 'columns.time'" in str(caught.value)


def test_a_load_in_a_column_is_the_load_of_the_condition(tmp_path: Path) -> None:
    write(
        tmp_path / "c.csv",
        COLUMNS | {"load_g": np.full(T.size, 150.0), "frequency_mHz": np.full(T.size, 10.0)},
    )
    (record, _) = read_campaign(tmp_path / "c.csv").records
    assert record.condition.load == pytest.approx(0.150 * 9.80665)
    assert record.condition.frequency == pytest.approx(0.010)


def test_a_load_that_changes_in_steps_is_told_with_its_rows(tmp_path: Path) -> None:
    twice = {name: np.r_[values, values] for name, values in COLUMNS.items()} | {
        "time_s": 0.5 * np.arange(480)
    }
    write(tmp_path / "c.csv", twice | {"load_g": np.repeat([100.0, 150.0], 240)})
    found = kinds(read_campaign(tmp_path / "c.csv"))
    assert "0.9807 N in rows 2 to 241, 1.471 N in rows 242 to 481" in found["load-steps"]


def test_a_measured_force_that_changes_in_steps_is_told_too(tmp_path: Path) -> None:
    force = np.repeat([1.0, 1.5], 240) + 0.003 * RNG.standard_normal(480)
    write(
        tmp_path / "c.csv", {"temperature_C": np.r_[T, T], "force_N": force, "displacement_mm": np.r_[X, X]}
    )
    assert "force changes in steps" in kinds(read_campaign(tmp_path / "c.csv"))["load-steps"]


def test_kelvin_row_numbers_and_near_names_are_told(tmp_path: Path) -> None:
    write(tmp_path / "k.csv", COLUMNS | {"temperature_C": T + 273.15})
    assert 'unit = "kelvin"' in kinds(read_campaign(tmp_path / "k.csv"))["kelvin"]
    assert severity("kelvin") == "serious"  # all temperatures of transformation are 273 too high
    write(tmp_path / "r.csv", {"temperature_C": np.arange(1.0, 121.0), "force_N": F[:120]})
    assert "counts the rows" in kinds(read_campaign(tmp_path / "r.csv"))["row-numbers"]
    write(tmp_path / "n.csv", {"temperature_C": T, "force_N": F, "displacment_mm": X})
    assert "'displacment_mm' (a displacement?)" in kinds(read_campaign(tmp_path / "n.csv"))["unused-column"]


def test_good_data_have_none_of_these_findings(whole: Campaign) -> None:
    assert not {"kelvin", "row-numbers", "unused-column", "load-steps", "setting-varies"} & set(kinds(whole))


def test_a_file_without_a_header_shows_how_it_begins(tmp_path: Path) -> None:
    (tmp_path / "c.csv").write_text(
        "".join(f"{t:.1f},{f:.3f}\n" for t, f in zip(T, F, strict=True)), encoding="utf-8"
    )
    with pytest.raises(SmaBayesError) as caught:
        read_campaign(tmp_path / "c.csv")
    assert "has no header but 2 columns, which begin: 25.0 0.5" in str(caught.value)
    assert "data without a temperature can't be used" in str(caught.value)


def test_decimal_commas_between_commas_are_named(tmp_path: Path) -> None:
    def cell(x: float) -> str:
        return f"{x:.3f}".replace(".", ",")

    rows = [",".join(map(cell, pair)) for pair in zip(T, F, strict=True)]
    (tmp_path / "c.csv").write_text("\n".join(["temperature_C,force_N", *rows]), encoding="utf-8")
    with pytest.raises(SmaBayesError, match="write points for decimal commas, or semicolons between columns"):
        read_campaign(tmp_path / "c.csv")


def test_a_spike_is_no_unit_that_is_wrong_and_a_stalled_clock_has_digits_enough(tmp_path: Path) -> None:
    time, force = 0.5 * np.arange(T.size), F.copy()
    force[len(F) // 3] = 2e9
    time[50:60] = time[50]
    write(tmp_path / "d.csv", {"time_s": time, "temperature_C": T, "force_N": force})
    found = kinds(read_campaign(tmp_path / "d.csv"))
    assert "spike" in found
    assert "implausible" not in found
    assert "the clock stood still for 9 of them on end" in found["repeated-time"]
    coarse = {"time_s": np.repeat(np.arange(T.size), 3)[: T.size], "temperature_C": T, "force_N": 1e9 * F}
    write(tmp_path / "e.csv", coarse)
    found = kinds(read_campaign(tmp_path / "e.csv"))
    assert "time has too few digits" in found["repeated-time"]
    assert "implausible" in found


def test_the_unit_that_was_meant(tmp_path: Path) -> None:
    write(tmp_path / "c.csv", {"T": T, "F": F})
    more = '[columns]\ntemperature = { name = "T", unit = "C" }\nforce = { name = "F", unit = "N" }'
    with pytest.raises(SmaBayesError, match="wrong kind") as caught:
        declared(tmp_path, '"c.csv"', more)
    assert "did you mean 'degC'?" in str(caught.value)
    with pytest.raises(SmaBayesError) as caught:
        declared(tmp_path, '"c.csv"', more.replace('"C"', '"degC"').replace('"N"', '"g"'))
    assert "did you mean 'gf'?" in str(caught.value)
