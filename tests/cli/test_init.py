"""A first campaign file: what is guessed of real folders is what their worked examples declare."""

from __future__ import annotations

import json
import shutil
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sma_bayes.records.campaign import read_campaign
from sma_bayes.records.guesses import guess_header, guess_unnamed

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "examples"
NOT_GUESSED = {"guarneros_spring_force": {"time"}, "wire_in_water": {"time"}}
"""What only the authors' notes tell: the step of time of a file that counts its rows, or says nothing of time."""
UNITS_UNKNOWN = {("guarneros_spring_force", "force"): "arbitrary"}
"""The calibration of raw counts is not in the files."""
NO_TEMPERATURE = (
    "diamond_load_extension",
    "flexinol_wire_duty_cycle",
    "muscle_wire_electric_cycling",
    "nist_strd",
)


@pytest.fixture
def folder(shared_data: Path, tmp_path: Path) -> Callable[[str], Path]:
    """A copy of a folder of real data."""
    return lambda name: Path(shutil.copytree(shared_data / name, tmp_path / name))


def declared(path: Path) -> dict[str, Any]:
    return tomllib.loads(path.read_text(encoding="utf-8"))


def place(column: dict[str, Any]) -> object:
    return column.get("name", column.get("column"))


@pytest.mark.parametrize("name", sorted(p.stem for p in EXAMPLES.glob("*.toml")))
def test_guesses_are_what_the_worked_example_declares(
    run: Callable[..., Any], folder: Callable[[str], Path], name: str
) -> None:
    path = folder(name)
    outcome = run("init", path, "--json")
    assert outcome.status == 0, outcome.err
    found = json.loads(outcome.out)
    assert found["schema"] == "sma-bayes/init/1"
    guessed, truth = declared(path / "campaign.toml"), declared(EXAMPLES / f"{name}.toml")
    wanted = {q: c for q, c in truth["columns"].items() if q not in NOT_GUESSED.get(name, ())}
    assert {q: place(c) for q, c in guessed["columns"].items()} == {q: place(c) for q, c in wanted.items()}
    for quantity, column in wanted.items():
        unit = UNITS_UNKNOWN.get((name, quantity), column.get("unit"))
        assert guessed["columns"][quantity].get("unit") == unit, quantity
        if 0.0 in column.get("missing", ()):
            assert guessed["columns"][quantity]["missing"] == [0.0]
    files = {c["file"]: c for c in guessed["condition"]}
    for condition in truth["condition"]:
        assert condition["file"] in files
        stress = condition.get("stress_MPa")
        assert files[condition["file"]].get("stress_MPa") == stress
    assert guessed.get("reading", {}).get("quoted_rows") == truth.get("reading", {}).get("quoted_rows")


@pytest.mark.parametrize("name", sorted(p.stem for p in EXAMPLES.glob("*.toml")))
def test_what_is_written_can_be_read(
    folder: Callable[[str], Path], run: Callable[..., Any], name: str
) -> None:
    path = folder(name)
    found = json.loads(run("init", path, "--json").out)
    assert {r.condition.id for r in read_campaign(path).records} == set(found["conditions"])


@pytest.mark.parametrize("name", NO_TEMPERATURE)
def test_data_without_a_temperature_are_told_so(
    run: Callable[..., Any], folder: Callable[[str], Path], name: str
) -> None:
    path = folder(name)
    outcome = run("init", path)
    assert outcome.status == 2
    assert "no column seems to be a temperature" in outcome.err
    assert "data without a temperature can't be used" in outcome.err
    assert not (path / "campaign.toml").exists()


def test_what_can_not_be_fitted_stands_as_a_comment_with_the_reason(
    run: Callable[..., Any], folder: Callable[[str], Path]
) -> None:
    path = folder("muscle_wire_stress_strain")
    found = json.loads(run("init", path, "--json").out)
    assert found["conditions"] == ["March8_2cpm"]
    assert "hardly varies" in found["left_out"]["pseudoelastic_40C.csv"]
    text = (path / "campaign.toml").read_text(encoding="utf-8")
    assert '# file = "pseudoelastic_40C.csv"' in text


def test_nothing_is_overwritten(run: Callable[..., Any], measured: Path, tmp_path: Path) -> None:
    (tmp_path / "campaign.toml").write_text("# mine\n", encoding="utf-8")
    outcome = run("init", tmp_path)
    assert outcome.status == 2
    assert "is there already" in outcome.err
    assert (tmp_path / "campaign.toml").read_text(encoding="utf-8") == "# mine\n"


def written(folder: Path, lines: list[str], name: str = "log.csv") -> Path:
    folder.mkdir()
    (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


@pytest.mark.parametrize("units", ["s,°C,mN", "(s),(°C),(mN)", "[s],[°C],[mN]"])
def test_units_in_a_line_of_their_own_are_those_of_the_columns(
    run: Callable[..., Any], make_sweep: Any, tmp_path: Path, units: str
) -> None:
    rows = [line.rsplit(",", 1)[0] for line in make_sweep()]
    path = written(tmp_path / "log", ["time,temperature,force", units, *rows[1:]])
    alone = json.loads(run("inspect", path / "log.csv", "--json").out)
    assert run("init", path).status == 0
    columns = declared(path / "campaign.toml")["columns"]
    assert {q: c["unit"] for q, c in columns.items()} == {"time": "s", "temperature": "degC", "force": "mN"}
    assert "GUESS:" not in (path / "campaign.toml").read_text(encoding="utf-8")
    assert json.loads(run("inspect", path, "--json").out)["records"][0]["n"] == alone["records"][0]["n"]


@pytest.mark.parametrize(
    ("up", "down", "name"),
    [
        ("2A_heating.csv", "2A_cooling.csv", "2A"),
        ("heating/2A.csv", "cooling/2A.csv", "2A"),
        ("Up 2A.csv", "Down 2A.csv", "2A"),
    ],
)
def test_heating_and_cooling_in_files_of_their_own_are_one_condition(
    run: Callable[..., Any], make_sweep: Any, tmp_path: Path, up: str, down: str, name: str
) -> None:
    head, *rows = make_sweep()
    for file, part in (
        (up, rows[: len(rows) // 2]),
        (down, rows[len(rows) // 2 :]),
        ("1A_heating.csv", rows),
    ):
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_text("\n".join([head, *part]) + "\n", encoding="utf-8")
    if "/" in up:
        (tmp_path / "1A_heating.csv").unlink()
    outcome = run("init", tmp_path)
    conditions = {c["id"]: c["file"] for c in declared(tmp_path / "campaign.toml")["condition"]}
    assert conditions == {name: [up, down]} | ({} if "/" in up else {"1A_heating": "1A_heating.csv"})
    assert "heating and cooling of one condition, from the file names" in outcome.out
    records = json.loads(run("inspect", tmp_path, "--json").out)["records"]
    assert {"heating", "cooling"} == {r["branch"] for r in records if r["condition"] == name}


@pytest.mark.parametrize(
    ("beside", "time"), [("sample no", "Date"), ("elapsed time (s)", "elapsed time (s)")]
)
def test_a_clock_is_the_time_whatever_it_is_called_where_no_other_column_is(
    run: Callable[..., Any], make_sweep: Any, tmp_path: Path, beside: str, time: str
) -> None:
    head, *rows = make_sweep()
    assert head.startswith("time_s,")
    clocks = [f"01.05.2024 09:{k // 60:02d}:{k % 60:02d}" for k in range(len(rows))]
    lines = [
        ",".join(("Date", head.replace("time_s", beside))),
        *map(",".join, zip(clocks, rows, strict=True)),
    ]
    (tmp_path / "1A.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    run("init", tmp_path)
    column = declared(tmp_path / "campaign.toml")["columns"]["time"]
    assert column == {"name": time} | ({} if time == "Date" else {"unit": "s"})


def test_commands_that_are_shown_can_be_copied_where_a_path_has_blanks(
    run: Callable[..., Any], make_sweep: Any, tmp_path: Path
) -> None:
    path = written(tmp_path / "Mes données (été)", make_sweep())
    assert f'sma-bayes init "{path}"' in run("inspect", path).err
    assert f'next: sma-bayes inspect "{path}"' in run("init", path).out
    assert f'#   sma-bayes inspect "{path}"' in (path / "campaign.toml").read_text(encoding="utf-8")


def test_nan_in_many_rows_is_a_missing_value_to_check(
    run: Callable[..., Any], make_sweep: Any, tmp_path: Path
) -> None:
    rows = [line.split(",") for line in make_sweep()]
    lines = [",".join([*r[:2], "NaN" if i % 3 == 1 else r[2], r[3]]) for i, r in enumerate(rows)]
    path = written(tmp_path / "log", lines)
    assert run("init", path).status == 0
    assert declared(path / "campaign.toml")["columns"]["force"]["missing"] == ["NaN"]
    assert run("inspect", path).status == 0


def test_settings_and_odd_units_are_read_off_names(
    run: Callable[..., Any], make_sweep: Any, tmp_path: Path
) -> None:
    for name in ("2A-150g-10mHz.csv", "1A-150g-10mHz.csv"):
        lines = ["Time (ms);Temp. wire (K);Room temp (C);Load cell (g);Stroke in mm;note"]
        for line in make_sweep()[1:]:
            t, temperature, force, stroke = map(float, line.split(","))
            lines.append(
                f"{1000 * t:.0f};{temperature + 273.15:.3f};21;{force / 9.80665e-3:.3f};{stroke:.4f};ok"
            )
        (tmp_path / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
    outcome = run("init", tmp_path)
    assert outcome.status == 0, outcome.err
    assert "next: sma-bayes inspect" in outcome.out
    found = declared(tmp_path / "campaign.toml")
    assert found["columns"] == {
        "time": {"name": "Time (ms)", "unit": "ms"},
        "temperature": {"name": "Temp. wire (K)", "unit": "kelvin"},
        "ambient_temperature": {"name": "Room temp (C)", "unit": "degC"},
        "force": {"name": "Load cell (g)", "unit": "gf"},
        "displacement": {"name": "Stroke in mm", "unit": "mm"},
    }
    assert [c["id"] for c in found["condition"]] == ["1A-150g-10mHz", "2A-150g-10mHz"]
    assert found["condition"][1]["current_A"] == 2
    assert found["condition"][1]["load_g"] == 150
    assert found["condition"][1]["frequency_mHz"] == 10
    assert len(read_campaign(tmp_path).records) == 4


@pytest.mark.parametrize("header", ["Temperature derivative", "T setpoint (C)", "remark"])
def test_headers_that_are_no_reading(header: str) -> None:
    assert guess_header(header) is None


def test_a_raw_reading_has_an_arbitrary_unit_until_it_is_calibrated() -> None:
    guess = guess_header("Force (mV)")
    assert guess is not None
    assert guess.unit == "arbitrary"
    assert guess.doubts == ("a raw reading in mV: give scale, offset and to",)


def test_a_thermometer_is_told_from_a_force_that_spans_more() -> None:
    temperature = 25.0 + 60.0 * np.sin(np.linspace(0.0, np.pi, 300)) ** 2
    force = 400.0 / (1.0 + np.exp(-0.3 * (temperature - 55.0)))
    noise = np.random.default_rng(0).standard_normal(300)
    found = guess_unnamed([{0: noise, 1: force, 2: temperature}], 3, [None])
    assert found.columns["temperature"][0] == 2


def test_a_column_that_one_file_has_and_no_quantity_takes_is_named(
    run: Callable[..., Any], tmp_path: Path
) -> None:
    t = np.concatenate([np.linspace(20.0, 90.0, 60), np.linspace(90.0, 20.0, 60)])
    for name, more in (("a", ""), ("b", ",operator_code")):
        rows = [
            f"{i},{x:.2f},{5.0 + np.tanh((x - 55.0) / 5.0):.4f}{',1' if more else ''}"
            for i, x in enumerate(t)
        ]
        (tmp_path / f"{name}.csv").write_text(
            "\n".join([f"time_s,temperature_C,force_N{more}", *rows]), "utf-8"
        )
    outcome = run("init", tmp_path)
    assert outcome.status == 0, outcome.err
    assert "# columns not used: 'operator_code'" in (tmp_path / "campaign.toml").read_text(encoding="utf-8")
